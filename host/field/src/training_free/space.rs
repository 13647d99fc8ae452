//! The depth range of a scene: near and far bounds of the planes, for any camera.

use crate::Surfaces;
use std::cell::RefCell;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, CameraBlock};
use viewfuse_device::parallel::map;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::rig::Rig;

/// The percentiles of the points that are used as nearest and farthest.
const PERCENTILES: [f64; 2] = [0.01, 0.99];
/// Margin in front of the nearest and behind the farthest point.
const MARGINS: [f32; 2] = [0.85, 1.3];
/// Fewest points from which bounds are estimated.
const MIN_POINTS: usize = 32;
/// Most cameras whose range is kept.
const MAX_KNOWN: usize = 256;

/// The known depths of a scene.
#[derive(Clone, Debug)]
pub(super) struct Space {
    /// Surface points.
    points: Vec<Vec3>,
    /// Least and greatest disparity for a camera that sees too few points; `None` if unknown.
    bounds: Option<[f32; 2]>,
    /// Of the cameras that were asked for last: trials of settings ask for the same ones again and again.
    known: RefCell<Vec<(CameraBlock, [f32; 2])>>,
}

impl Space {
    fn new(points: Vec<Vec3>, bounds: Option<[f32; 2]>) -> Space {
        Space { points, bounds, known: RefCell::default() }
    }

    /// The depths in the scene's files: bounds first, because they also state the intended range, then points.
    pub(super) fn of(sources: &SourceImages) -> Space {
        if let Some([near, far]) = sources.near_far {
            return Space::new(Vec::new(), Some([1.0 / far, 1.0 / near]));
        }
        let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
        let points = sources.points.clone();
        if points.len() < MIN_POINTS { Space::new(points, None) } else { Space::of_points(points, &cameras) }
    }

    /// From surface points. For a camera that sees too few, the bounds are those of all the cameras that see enough; if
    /// there are none, those of the volume common to all cameras.
    pub(super) fn of_points(points: Vec<Vec3>, cameras: &[Camera]) -> Space {
        let seen = map(cameras.len(), 1, |camera| in_frustum(&points, &cameras[camera].block(0)));
        let bounds = seen
            .into_iter()
            .flatten()
            .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
            .unwrap_or_else(|| common_volume(cameras));
        Space::new(points, Some(bounds))
    }

    /// Whether bounds are known.
    pub(super) fn is_known(&self) -> bool {
        self.bounds.is_some()
    }

    /// The same for others.
    pub(super) fn surfaces(&self) -> Surfaces {
        match self.bounds {
            // With points, the bounds follow from them.
            Some([least, greatest]) if self.points.len() < MIN_POINTS => {
                Surfaces { points: Vec::new(), near_far: Some([1.0 / greatest, 1.0 / least]) }
            }
            _ => Surfaces { points: self.points.clone(), near_far: None },
        }
    }

    /// Least and greatest disparity in a camera's frustum.
    pub(super) fn disparities(&self, camera: &CameraBlock) -> [f32; 2] {
        let mut known = self.known.borrow_mut();
        if let Some((_, disparities)) = known.iter().find(|(known, _)| known == camera) {
            return *disparities;
        }
        let disparities = in_frustum(&self.points, camera).or(self.bounds).unwrap_or([0.0, 1.0]);
        if known.len() == MAX_KNOWN {
            known.remove(0);
        }
        known.push((*camera, disparities));
        disparities
    }
}

/// Least and greatest disparity of the points that a camera sees; `None` if it sees too few.
fn in_frustum(points: &[Vec3], camera: &CameraBlock) -> Option<[f32; 2]> {
    let seen = points.iter().map(|point| camera.project(*point)).filter(|seen| seen.in_image);
    let mut depths: Vec<f32> = seen.map(|seen| seen.depth).collect();
    if depths.len() < MIN_POINTS {
        return None;
    }
    let [near, far] = PERCENTILES.map(|share| {
        let place = ((depths.len() - 1) as f64 * share).round() as usize;
        *depths.select_nth_unstable_by(place, f32::total_cmp).1
    });
    Some([1.0 / (MARGINS[1] * far), 1.0 / (MARGINS[0] * near)])
}

/// The disparities of the ball that all cameras see, around the point that they look at.
fn common_volume(cameras: &[Camera]) -> [f32; 2] {
    let rig = Rig::of(cameras);
    let near = (rig.distance - rig.subject_radius).max(0.1 * rig.distance);
    [1.0 / (rig.distance + rig.subject_radius), 1.0 / near]
}

/// The greatest disparity that is searched when nothing is known: that at the median distance of neighbouring cameras.
pub(super) fn first_guess(cameras: &[Camera]) -> [f32; 2] {
    let centres: Vec<Vec3> = cameras.iter().map(|camera| camera.pose.centre_world()).collect();
    let nearest = |camera: usize| {
        let others = centres.iter().enumerate().filter(|(other, _)| *other != camera);
        others.map(|(_, other)| other.distance(centres[camera])).fold(f32::INFINITY, f32::min)
    };
    let mut gaps: Vec<f32> = (0..centres.len()).map(nearest).filter(|gap| *gap > 0.0 && gap.is_finite()).collect();
    gaps.sort_by(f32::total_cmp);
    let gap = gaps.get(gaps.len() / 2).copied().unwrap_or(1.0);
    [0.0, 1.0 / gap]
}
