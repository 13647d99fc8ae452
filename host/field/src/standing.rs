//! How far a camera is from its sources, in a measure that is comparable between a target and a held-out source.

use glam::DVec3;
use serde::Serialize;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_scene::rig::Rig;

/// Least squared gap: smaller ones are raised to it.
const MIN_SQUARED_GAP: f64 = 1.0e-8;

/// A camera's geometry among its sources. With `g_i^2 = (d_i / D)^2 + a_i^2`, where `d_i` is the distance of the
/// centres, `D` that to what the cameras look at, and `a_i` the angle between the principal axes in radians:
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Standing {
    /// `(sum_i 1 / g_i^2)^(-1/2)`: at most the gap to the nearest source, less with every further one.
    pub gap: f64,
    /// `|sum_i v_i / g_i^2| / sum_i |v_i| / g_i^2` with `v_i` from the camera to a source: near 0 in the middle of the
    /// sources, 1 if all of them are in one direction.
    pub outside: f64,
}

/// The unit of distances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Measure {
    /// Distance from the cameras to what they look at, world units.
    distance: f64,
}

impl Measure {
    /// From the cameras of all sources.
    pub(crate) fn of(cameras: &[Camera]) -> Measure {
        Measure { distance: f64::from(Rig::of(cameras).distance).max(1.0e-12) }
    }

    /// The geometry of a camera among its sources.
    pub(crate) fn standing<'a>(&self, camera: &Pose, sources: impl Iterator<Item = &'a Pose>) -> Standing {
        let (mut sum, mut offset, mut length) = (0.0, DVec3::ZERO, 0.0);
        for source in sources {
            let towards = (source.centre_world() - camera.centre_world()).as_dvec3() / self.distance;
            let angle = f64::from(source.axis_angle(camera));
            let weight = (towards.length_squared() + angle * angle).max(MIN_SQUARED_GAP).recip();
            sum += weight;
            offset += weight * towards;
            length += weight * towards.length();
        }
        let gap = if sum > 0.0 { sum.sqrt().recip() } else { 1.0 };
        let outside = if length > 0.0 { offset.length() / length } else { 0.0 };
        Standing { gap, outside }
    }
}
