//! A Gaussian's ellipse in a picture, with what its derivatives need: the steps of
//! [`image_axes`](viewfuse_core::gaussian::image_axes), kept.

use glam::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::{GaussianBlock, MARGIN, axes};
use viewfuse_core::math::{clamp, exp, norm3};

/// A Gaussian's ellipse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// The mean in the camera's axes, world units.
    pub place: Vec3,
    /// The mean's slopes to the right and downwards, limited to a little beyond the picture.
    pub slopes: [f32; 2],
    /// Whether a slope was limited.
    pub limited: [bool; 2],
    /// Image coordinates right and down by world coordinates, linear around the mean; pixels a world unit.
    pub jacobian: [Vec3; 2],
    /// The unit quaternion w, x, y, z.
    pub unit: [f32; 4],
    /// The length of the Gaussian's own quaternion.
    pub length: f32,
    /// The Gaussian's axes in world coordinates, unit.
    pub axes: [Vec3; 3],
    /// Standard deviations along them, world units.
    pub scales: [f32; 3],
    /// The axes, each a standard deviation long, in the picture: right and down, pixels.
    pub image_axes: [Vec3; 2],
}

impl Footprint {
    /// The ellipse of a Gaussian that is drawn: its mean lies before the camera. A quaternion that is zero or not
    /// finite has the axes of the identity, and the length 1.
    #[inline(always)]
    pub fn of(gaussian: &GaussianBlock, camera: &CameraBlock) -> Footprint {
        let [focal_x, focal_y, principal_x, principal_y] = camera.intrinsics;
        let [x, y, z] = gaussian.position;
        let place = camera.pose.rotate_to_camera(Vec3::new(x, y, z) - camera.centre_world());
        let (width, height) = (camera.width as f32, camera.height as f32);
        let free = [place.x / place.z, place.y / place.z];
        let limit = |slope: f32, size: f32, principal: f32, focal: f32| {
            let beyond = 0.5 * MARGIN * size;
            clamp(slope, (-beyond - principal) / focal, (size + beyond - principal) / focal)
        };
        let slopes = [limit(free[0], width, principal_x, focal_x), limit(free[1], height, principal_y, focal_y)];
        let axis = |row: [f32; 4]| Vec3::new(row[0], row[1], row[2]);
        let forward = axis(camera.pose.forward);
        let jacobian = [
            (axis(camera.pose.right) - forward * slopes[0]) * (focal_x / place.z),
            (axis(camera.pose.down) - forward * slopes[1]) * (focal_y / place.z),
        ];
        let [w, a, b, c] = gaussian.rotation;
        let length = norm3(w, norm3(a, b, c), 0.0);
        let (unit, length) = match length > 0.0 && length < f32::MAX {
            true => ([w / length, a / length, b / length, c / length], length),
            false => ([1.0, 0.0, 0.0, 0.0], 1.0),
        };
        let axes = axes(gaussian.rotation);
        let [first, second, third] = gaussian.log_scales;
        let scales = [exp(first), exp(second), exp(third)];
        let along = |row: Vec3| {
            Vec3::new(row.dot(axes[0]) * scales[0], row.dot(axes[1]) * scales[1], row.dot(axes[2]) * scales[2])
        };
        let image_axes = [along(jacobian[0]), along(jacobian[1])];
        let limited = [slopes[0] != free[0], slopes[1] != free[1]];
        Footprint { place, slopes, limited, jacobian, unit, length, axes, scales, image_axes }
    }
}
