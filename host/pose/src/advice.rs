//! Where more photographs help.

use serde::Serialize;
use viewfuse_scene::Scene;
use viewfuse_scene::rig::Rig;

/// Neighbouring photographs further apart than this, in degrees, leave depths open.
const MAX_GAP: f32 = 15.0;

/// The photographs as neighbours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Neighbours {
    /// Median angle between a photograph and the nearest other one, degrees, seen from what the cameras look at.
    pub median: f32,
    /// The greatest of these angles.
    pub greatest: f32,
    /// Pairs of photographs with a gap of more than 15 degrees between them, and no way around it over smaller ones:
    /// their names and the gap, the greatest first.
    pub gaps: Vec<(String, String, f32)>,
}

impl Neighbours {
    /// Of a scene with at least two photographs.
    pub fn of(scene: &Scene) -> Neighbours {
        let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
        let rig = Rig::of(&cameras);
        let nearest = rig.gaps(&cameras);
        let at = |place: usize| nearest.get(place).copied().unwrap_or_default();
        let direction = |view: usize| (cameras[view].pose.centre_world() - rig.focus).normalize_or_zero();
        let angle = |a: usize, b: usize| direction(a).dot(direction(b)).clamp(-1.0, 1.0).acos().to_degrees();
        // The tree of least angles (Prim): its long edges are the gaps.
        let (mut inside, mut gaps) = (vec![0], Vec::new());
        while inside.len() < cameras.len() {
            let outside: Vec<usize> = (0..cameras.len()).filter(|view| !inside.contains(view)).collect();
            let edges = inside.iter().flat_map(|from| outside.iter().map(move |to| (*from, *to)));
            let Some((from, to)) = edges.min_by(|a, b| angle(a.0, a.1).total_cmp(&angle(b.0, b.1))) else { break };
            if angle(from, to) > MAX_GAP {
                let [first, second] = [from.min(to), from.max(to)].map(|view| scene.views[view].name.clone());
                gaps.push((first, second, angle(from, to)));
            }
            inside.push(to);
        }
        gaps.sort_by(|a, b| b.2.total_cmp(&a.2));
        Neighbours { median: at(nearest.len() / 2), greatest: at(nearest.len().saturating_sub(1)), gaps }
    }
}
