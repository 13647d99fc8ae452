//! What trained networks of this kind share: how they are shown photographs, and where their rays begin and end.

use viewfuse_core::camera::Camera;
use viewfuse_scene::rig::Rig;

/// Where rays begin and end as published for SRN's cars (0.8 and 1.8 of cameras at distance 1.3), as shares of the
/// cameras' distance from what they look at.
const NEAR_FAR_SHARES: [f32; 2] = [8.0 / 13.0, 18.0 / 13.0];

/// Where rays begin and end unless a person says so: by the mean distance of the cameras from what they look at. A single
/// camera does not show that: its distance from the world's origin counts then, where SRN's objects stand.
pub fn default_near_far(cameras: &[Camera]) -> [f32; 2] {
    let distance = match cameras {
        [camera] => camera.pose.centre_world().length(),
        cameras => Rig::of(cameras).distance,
    };
    NEAR_FAR_SHARES.map(|share| share * if distance > 0.0 { distance } else { 1.0 })
}

/// Rays are to end where they begin or before, or one of the two is NaN or infinite.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the near bound of rays, {near}, must be below the far bound, {far}, and both must be finite")]
pub struct NoDepths {
    /// Where they begin.
    pub near: f32,
    /// Where they end.
    pub far: f32,
}

impl NoDepths {
    /// Near and far bounds as they are, if there is something between them.
    ///
    /// # Errors
    /// [`NoDepths`].
    pub fn check([near, far]: [f32; 2]) -> Result<[f32; 2], NoDepths> {
        // Not the other way round: NaN is no depth either.
        if near < far && (far - near).is_finite() { Ok([near, far]) } else { Err(NoDepths { near, far }) }
    }
}

/// A texel (colour times opacity, opacity) over white: red, green, blue in `[-1, 1]`.
pub(super) fn over_white([red, green, blue, alpha]: [f32; 4]) -> [f32; 3] {
    [red, green, blue].map(|colour| 2.0 * (colour + 1.0 - alpha) - 1.0)
}
