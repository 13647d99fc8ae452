//! Common parts of learned fields: the form of their input images, near and far bounds, and the unit of length.

use super::options::list;
use viewfuse_core::camera::Camera;
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::rig::Rig;
use viewfuse_scene::unit::{RigUnit, SRN_DISTANCE};

/// Help of the flag of near and far bounds.
pub(super) const NEAR_FAR: &str = "Near and far bounds of rays, world units [default: 8/13 and 18/13 of the cameras' \
    distance from the point that they look at]";

/// The value of that flag.
pub(super) fn parse_near_far(text: &str) -> Result<[f32; 2], String> {
    let bounds: Option<[f32; 2]> = list(text).and_then(|bounds| bounds.try_into().ok());
    let fits = |[near, far]: &[f32; 2]| *near >= 0.0 && near < far && far.is_finite();
    bounds
        .filter(fits)
        .ok_or_else(|| "two distances, for example 0.8,1.8, the first at least 0 and less than the second".to_owned())
}

/// Near and far bounds as published for SRN's cars (0.8 and 1.8 for cameras at distance 1.3), as multiples of the
/// cameras' distance from the point that they look at.
const NEAR_FAR_SHARES: [f32; 2] = [8.0 / 13.0, 18.0 / 13.0];

/// Default near and far bounds, from the mean distance of the cameras to the point that they look at. A single camera
/// does not define that point: then it is the world's origin, where SRN's objects are.
pub fn default_near_far(cameras: &[Camera]) -> [f32; 2] {
    let distance = match cameras {
        [camera] => camera.pose.centre_world().length(),
        cameras => Rig::of(cameras).distance,
    };
    NEAR_FAR_SHARES.map(|share| share * if distance > 0.0 { distance } else { 1.0 })
}

/// The unit in which a network measures lengths, and the cameras of its sources in it.
pub(super) fn in_network_unit(sources: &SourceImages) -> (RigUnit, Vec<Camera>) {
    let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
    let unit = RigUnit::of_network(&cameras);
    let cameras = cameras.iter().map(|camera| unit.camera(camera)).collect();
    (unit, cameras)
}

/// Relative difference from [`SRN_DISTANCE`] up to which cameras count as being at it.
const SAME_DISTANCE: f32 = 0.1;

/// Says that a network measures in another unit than the world's, if it does; or that it measures in the world's, where
/// its cameras may have been nearer or farther while it learned.
pub(super) fn warn_of_unit(unit: RigUnit, sources: &SourceImages, progress: &dyn Progress) {
    let cameras: Vec<Camera> = sources.images.iter().map(|image| image.camera).collect();
    let distance = SRN_DISTANCE * RigUnit::of(&cameras).length();
    if unit.is_world() && (distance / SRN_DISTANCE - 1.0).abs() > SAME_DISTANCE {
        progress.warn(&format!(
            "the cameras are {distance:.2} units from what they look at, and the network takes lengths as they are: a \
             network that learned from cameras at another distance ({SRN_DISTANCE} in SRN's cars) draws something \
             else; scale the scene to what it learned from"
        ));
    }
    if !unit.is_world() {
        progress.warn(&format!(
            "the cameras are {:.3e} units from what they look at: for the network all lengths are divided by {:.3e}, \
             so that this distance is {SRN_DISTANCE}, as in the scenes that published networks learned from",
            unit.length() * SRN_DISTANCE,
            unit.length()
        ));
    }
}

/// The far bound of rays is not above the near bound, or a bound is NaN or infinite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the near bound of rays, {near}, must be below the far bound, {far}, and both must be finite")]
pub struct NoDepths {
    /// The near bound.
    pub near: f32,
    /// The far bound.
    pub far: f32,
}

impl NoDepths {
    /// Returns the bounds unchanged, if the far bound is above the near bound and both are finite.
    ///
    /// # Errors
    /// [`NoDepths`].
    pub fn check([near, far]: [f32; 2]) -> Result<[f32; 2], NoDepths> {
        // Not the other way round: NaN must fail, too.
        if near < far && (far - near).is_finite() { Ok([near, far]) } else { Err(NoDepths { near, far }) }
    }
}

/// A texel (colour times opacity, opacity) over white: red, green, blue in `[-1, 1]`.
pub(super) fn over_white([red, green, blue, alpha]: [f32; 4]) -> [f32; 3] {
    [red, green, blue].map(|colour| 2.0 * (colour + 1.0 - alpha) - 1.0)
}
