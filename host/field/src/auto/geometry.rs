//! How far a camera is from its sources, in a measure that compares a target with a source that was left out.

use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_scene::rig::Rig;

/// Squared gap below which sources count as one with the camera.
const LEAST_SQUARED_GAP: f64 = 1.0e-8;

/// What distances are measured by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measure {
    /// Distance from the cameras to what they look at, world units.
    distance: f64,
}

impl Measure {
    /// From the cameras of all sources.
    pub(super) fn of(cameras: &[Camera]) -> Measure {
        Measure { distance: f64::from(Rig::of(cameras).distance).max(1.0e-12) }
    }

    /// The gap between a camera and its sources: `(sum_i 1 / g_i^2)^(-1/2)` with `g_i^2 = (d_i / D)^2 + a_i^2`, where `d_i` is
    /// the distance of the centres, `D` that to what the cameras look at, and `a_i` the angle between the principal axes in
    /// radians. It is at most that to the nearest source, and becomes smaller with every further one.
    pub(super) fn gap<'a>(&self, camera: &Pose, sources: impl Iterator<Item = &'a Pose>) -> f64 {
        let squared = |source: &Pose| {
            let distance = f64::from(source.distance(camera)) / self.distance;
            let angle = f64::from(source.axis_angle(camera));
            (distance * distance + angle * angle).max(LEAST_SQUARED_GAP)
        };
        let sum: f64 = sources.map(|source| 1.0 / squared(source)).sum();
        if sum > 0.0 { sum.sqrt().recip() } else { 1.0 }
    }
}
