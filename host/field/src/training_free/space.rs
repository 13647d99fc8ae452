//! Which depths there are in a scene: near and far bounds of the planes, for any camera.

use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock};

/// The nearest and the farthest percentile of the points that counts.
const PERCENTILES: [f64; 2] = [0.01, 0.99];
/// How far before the nearest and behind the farthest point there may be something.
const MARGINS: [f32; 2] = [0.85, 1.3];
/// Fewest points from which bounds are told.
const FEWEST_POINTS: usize = 32;

/// Points of the scene's surfaces.
#[derive(Clone, Debug, Default)]
pub(super) struct Space {
    points: Vec<Vec3>,
}

impl Space {
    pub(super) fn new(points: Vec<Vec3>) -> Space {
        Space { points }
    }

    pub(super) fn count(&self) -> usize {
        self.points.len()
    }

    /// Least and greatest disparity in a camera's frustum, from the points that it sees; `None` if it sees too few.
    pub(super) fn disparities(&self, camera: &CameraBlock) -> Option<[f32; 2]> {
        let seen = self.points.iter().map(|point| camera.project(*point)).filter(|seen| seen.in_image);
        let mut depths: Vec<f32> = seen.map(|seen| seen.depth).collect();
        if depths.len() < FEWEST_POINTS {
            return None;
        }
        depths.sort_by(f32::total_cmp);
        let at = |share: f64| depths[((depths.len() - 1) as f64 * share).round() as usize];
        let [near, far] = [MARGINS[0] * at(PERCENTILES[0]), MARGINS[1] * at(PERCENTILES[1])];
        Some([1.0 / far, 1.0 / near])
    }
}

/// The greatest disparity worth a look before anything is known: that at the distance of neighbouring cameras, in the median.
pub(super) fn first_guess(cameras: &[Camera]) -> [f32; 2] {
    let centres: Vec<Vec3> = cameras.iter().map(|camera| camera.pose.centre_world()).collect();
    let nearest = |own: usize| {
        let others = centres.iter().enumerate().filter(|(other, _)| *other != own);
        others.map(|(_, other)| other.distance(centres[own])).fold(f32::INFINITY, f32::min)
    };
    let mut gaps: Vec<f32> = (0..centres.len()).map(nearest).filter(|gap| *gap > 0.0 && gap.is_finite()).collect();
    gaps.sort_by(f32::total_cmp);
    let gap = gaps.get(gaps.len() / 2).copied().unwrap_or(1.0);
    [0.0, 1.0 / gap]
}
