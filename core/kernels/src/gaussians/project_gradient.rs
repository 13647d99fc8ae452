//! Derivatives of splats by the Gaussians that they are projections of.

use super::SplatBlock;
use super::blend_gradient::SplatGradient;
use super::footprint::Footprint;
use glam::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::gaussian::{GaussianBlock, ProjectedGaussian, opacity};

/// The derivative of a loss by a Gaussian's parameters, in their own places, from what all tiles say of its splat. Zero
/// if nothing of it is seen.
#[inline(always)]
pub fn project_gradient(
    block: &SplatBlock,
    gaussian: &GaussianBlock,
    splat: &ProjectedGaussian,
    sums: &SplatGradient,
) -> GaussianBlock {
    if !(splat.opacity > 0.0) {
        return GaussianBlock {
            position: [0.0; 3],
            opacity: 0.0,
            log_scales: [0.0; 3],
            padding: 0.0,
            rotation: [0.0; 4],
            colour: [0.0; 3],
            padding_end: 0.0,
        };
    }
    let camera = &block.camera;
    let footprint = Footprint::of(gaussian, camera);
    let mut by_axes = by_axes(&footprint, splat, sums);
    if block.is_antialiased != 0 {
        let [right, down] = by_fading(&footprint, splat);
        by_axes = [by_axes[0] + right * sums.opacity, by_axes[1] + down * sums.opacity];
    }
    let Footprint { jacobian, axes, scales, image_axes, .. } = &footprint;
    let across = |axis: usize| {
        // The derivatives by the projection of this axis, and what follows for the axis itself.
        let by = [component(&by_axes[0], axis), component(&by_axes[1], axis)];
        let by_scale = by[0] * component(&image_axes[0], axis) + by[1] * component(&image_axes[1], axis);
        ((jacobian[0] * by[0] + jacobian[1] * by[1]) * scales[axis], by_scale)
    };
    let [(first, by_first), (second, by_second), (third, by_third)] = [across(0), across(1), across(2)];
    let by_jacobian = |row: usize| {
        axes[0] * (by_axes[row].x * scales[0])
            + axes[1] * (by_axes[row].y * scales[1])
            + axes[2] * (by_axes[row].z * scales[2])
    };
    let by_place = by_place(&footprint, camera, splat, sums, [by_jacobian(0), by_jacobian(1)]);
    GaussianBlock {
        position: camera.pose.rotate_to_world(by_place.x, by_place.y, by_place.z).to_array(),
        opacity: sums.opacity * (1.0 - opacity(gaussian.opacity)),
        log_scales: [by_first, by_second, by_third],
        padding: 0.0,
        rotation: by_quaternion(&footprint, [first, second, third]),
        colour: sums.colour,
        padding_end: 0.0,
    }
}

#[inline(always)]
fn component(vector: &Vec3, axis: usize) -> f32 {
    match axis {
        0 => vector.x,
        1 => vector.y,
        _ => vector.z,
    }
}

/// Derivatives by [`Footprint::image_axes`]: the conic is the inverse of the covariance, which is the product of the
/// axes with themselves.
#[inline(always)]
fn by_axes(footprint: &Footprint, splat: &ProjectedGaussian, sums: &SplatGradient) -> [Vec3; 2] {
    let [a, b, c] = splat.conic;
    // By the conic, as a symmetric matrix.
    let (xx, xy, yy) = (-0.5 * sums.squares[0], -0.5 * sums.squares[1], -0.5 * sums.squares[2]);
    // -K G K.
    let (left, middle) = (a * xx + b * xy, a * xy + b * yy);
    let (lower, last) = (b * xx + c * xy, b * xy + c * yy);
    let covariance = [-(left * a + middle * b), -(left * b + middle * c), -(lower * b + last * c)];
    let [right, down] = footprint.image_axes;
    [(right * covariance[0] + down * covariance[1]) * 2.0, (right * covariance[1] + down * covariance[2]) * 2.0]
}

/// Derivatives by [`Footprint::image_axes`] of the logarithm of what an antialiased splat's opacity is multiplied by:
/// half of the covariance's inverse before the dilation less that after it, times the derivatives of the covariance.
/// The first is that of the axes' cross product, whose square is the determinant; it is above 0 for what is seen.
#[inline(always)]
fn by_fading(footprint: &Footprint, splat: &ProjectedGaussian) -> [Vec3; 2] {
    let ([a, b, c], [right, down]) = (splat.conic, footprint.image_axes);
    let cross = right.cross(down);
    let inverse = 1.0 / cross.dot(cross);
    [down.cross(cross) * inverse - (right * a + down * b), cross.cross(right) * inverse - (right * b + down * c)]
}

/// Derivative by the centre in camera coordinates.
#[inline(always)]
fn by_place(
    footprint: &Footprint,
    camera: &CameraBlock,
    splat: &ProjectedGaussian,
    sums: &SplatGradient,
    by_jacobian: [Vec3; 2],
) -> Vec3 {
    let Footprint { place, slopes, limited, jacobian, .. } = footprint;
    let [focal_x, focal_y, ..] = camera.intrinsics;
    let inverse = 1.0 / place.z;
    let ([a, b, c], [along_x, along_y]) = (splat.conic, sums.along);
    let (by_x, by_y) = (a * along_x + b * along_y, b * along_x + c * along_y);
    // The centre's image coordinates are focal lengths times unlimited slopes.
    let mut slope_x = by_x * focal_x;
    let mut slope_y = by_y * focal_y;
    let mut depth = -(slope_x * place.x + slope_y * place.y) * inverse * inverse;
    let forward = Vec3::new(camera.pose.forward[0], camera.pose.forward[1], camera.pose.forward[2]);
    depth -= (by_jacobian[0].dot(jacobian[0]) + by_jacobian[1].dot(jacobian[1])) * inverse;
    let limited_x = -by_jacobian[0].dot(forward) * (focal_x * inverse);
    let limited_y = -by_jacobian[1].dot(forward) * (focal_y * inverse);
    if !limited[0] {
        slope_x += limited_x;
        depth -= limited_x * slopes[0] * inverse;
    }
    if !limited[1] {
        slope_y += limited_y;
        depth -= limited_y * slopes[1] * inverse;
    }
    Vec3::new(slope_x * inverse, slope_y * inverse, depth)
}

/// Derivative by a quaternion of any length, from those by the axes that it makes.
#[inline(always)]
fn by_quaternion(footprint: &Footprint, [first, second, third]: [Vec3; 3]) -> [f32; 4] {
    let [w, x, y, z] = footprint.unit;
    let by_w = z * (first.y - second.x) + y * (third.x - first.z) + x * (second.z - third.y);
    let by_x =
        y * (first.y + second.x) + z * (first.z + third.x) + w * (second.z - third.y) - 2.0 * x * (second.y + third.z);
    let by_y =
        x * (first.y + second.x) + z * (second.z + third.y) + w * (third.x - first.z) - 2.0 * y * (first.x + third.z);
    let by_z =
        x * (first.z + third.x) + y * (second.z + third.y) + w * (first.y - second.x) - 2.0 * z * (first.x + second.y);
    let along = by_w * w + by_x * x + by_y * y + by_z * z;
    let factor = 2.0 / footprint.length;
    [(by_w - along * w) * factor, (by_x - along * x) * factor, (by_y - along * y) * factor, (by_z - along * z) * factor]
}
