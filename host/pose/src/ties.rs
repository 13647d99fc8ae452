//! What ties a photograph to the others: the points that they share, and how far away the nearest one is.

use crate::solution::Solution;
use serde::Serialize;
use viewfuse_scene::Scene;
use viewfuse_scene::rig::Rig;

/// What ties a photograph to the others that are accepted with it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ties {
    /// Degrees to the nearest photograph, seen from what the cameras look at.
    pub nearest: f32,
    /// Points that it and at least two other photographs see: two alone meet wherever their rays do.
    pub points_of_three: usize,
    /// Points that it shares with one photograph, of the second most: with one alone its distance is open.
    pub second_shared: usize,
}

impl Ties {
    /// Of these photographs of a solution, ascending, which are the views of a scene.
    pub(crate) fn of_all(solution: &Solution, photos: &[usize], scene: &Scene) -> Vec<Ties> {
        let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
        let nearest = Rig::of(&cameras).nearest(&cameras);
        let mut of_three = vec![0; photos.len()];
        let mut shared = vec![vec![0; photos.len()]; photos.len()];
        for point in &solution.points {
            let mut seen: Vec<usize> =
                point.seen.iter().filter_map(|(photo, _)| photos.binary_search(photo).ok()).collect();
            seen.sort_unstable();
            seen.dedup();
            for &a in &seen {
                of_three[a] += usize::from(seen.len() > 2);
                seen.iter().filter(|b| **b != a).for_each(|b| shared[a][*b] += 1);
            }
        }
        let ties = |(place, shared): (usize, &mut Vec<usize>)| {
            shared.sort_unstable_by(|a, b| b.cmp(a));
            Ties {
                nearest: nearest.get(place).copied().unwrap_or(f32::INFINITY),
                points_of_three: of_three[place],
                second_shared: shared.get(1).copied().unwrap_or(0),
            }
        };
        shared.iter_mut().enumerate().map(ties).collect()
    }
}
