//! The distance of a scene from a camera, as the depth of one plane.
//!
//! Parallax is proportional to disparity, the reciprocal of depth. The plane with the least residual parallax is at the
//! mean disparity, so means of depths are harmonic here.

use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_scene::rig::nearest_point_to_lines;

/// Fewest points in the picture from which the depth is estimated.
pub const MIN_POINTS: usize = 8;

/// The depth along the target's principal axis in world units, from the first of these that is known: the sparse points
/// that are inside the target's picture, if there are at least [`MIN_POINTS`]; the target's near and far bound; the
/// point that all cameras look at. Infinite where none is known, which gives the homography of a pure rotation.
pub fn plane_depth(
    target: &Camera,
    points: impl IntoIterator<Item = Vec3>,
    near_far: Option<[f32; 2]>,
    cameras: &[Camera],
) -> f64 {
    depth_of_points(target, points)
        .or_else(|| near_far.and_then(depth_of_bounds))
        .or_else(|| depth_of_focus(target, cameras))
        .unwrap_or(f64::INFINITY)
}

/// The harmonic mean of the depths of the points inside the target's picture; `None` for fewer than [`MIN_POINTS`].
pub fn depth_of_points(target: &Camera, points: impl IntoIterator<Item = Vec3>) -> Option<f64> {
    let seen = points.into_iter().map(|point| target.project(point)).filter(|place| place.in_image);
    let (sum, count) = seen.fold((0.0, 0_usize), |(sum, count), place| (sum + 1.0 / f64::from(place.depth), count + 1));
    (count >= MIN_POINTS && sum > 0.0).then(|| count as f64 / sum)
}

/// The depth in the middle of the disparities between a near and a far bound; `None` unless `0 < near <= far`. The far
/// bound may be infinite.
pub fn depth_of_bounds([near, far]: [f32; 2]) -> Option<f64> {
    (near > 0.0 && near <= far).then(|| 2.0 / (1.0 / f64::from(near) + 1.0 / f64::from(far)))
}

/// The depth of the point that the cameras look at; `None` if their axes are parallel or it is not in front of the
/// target.
pub fn depth_of_focus(target: &Camera, cameras: &[Camera]) -> Option<f64> {
    let axes: Vec<(Vec3, Vec3)> =
        cameras.iter().map(|camera| (camera.pose.centre_world(), camera.pose.forward_world())).collect();
    let depth = f64::from(target.pose.to_camera(nearest_point_to_lines(&axes)?).z);
    (depth > 0.0).then_some(depth)
}
