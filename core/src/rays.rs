//! Rays of a target and the points on them.

use crate::camera::CameraBlock;
use crate::fetch::Fetch;
use crate::math::{max, norm3};
use bytemuck::{Pod, Zeroable};

/// A ray of a target with its near and far bounds, as plain data. World coordinates; `near` and `far` are distances
/// from the origin in lengths of `direction`, `far` at least `near`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct TargetRay {
    /// The ray's origin.
    pub origin: [f32; 3],
    /// Near bound.
    pub near: f32,
    /// Vector along it: of length 1, or, where depths are along the principal axis, with 1 along that.
    pub direction: [f32; 3],
    /// Far bound.
    pub far: f32,
}

/// A dispatch of [`cast_ray`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CastBlock {
    /// The target.
    pub camera: CameraBlock,
    /// See [`TargetRay::near`].
    pub near: f32,
    /// See [`TargetRay::far`].
    pub far: f32,
    /// Where in a pixel its centre is: 0.5 in this crate's convention, 0 in published PixelNeRF's, whose rays go
    /// through the pixels' upper left corners.
    pub pixel_centre: f32,
    /// 1 if depths are measured along the target's principal axis, 0 if along the rays.
    pub along_axis: u32,
}

/// The ray through a pixel (flat, row-major).
#[inline]
pub fn cast_ray(block: &CastBlock, pixel: u32) -> TargetRay {
    let camera = &block.camera;
    let (column, row) = (pixel % camera.width, pixel / camera.width);
    let towards = camera.towards(column as f32 + block.pixel_centre, row as f32 + block.pixel_centre);
    let length = if block.along_axis != 0 { 1.0 } else { norm3(towards.x, towards.y, towards.z) };
    TargetRay {
        origin: camera.centre_world().to_array(),
        near: block.near,
        direction: [towards.x / length, towards.y / length, towards.z / length],
        far: block.far,
    }
}

/// A point on a ray at which a field is evaluated, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct RayPoint {
    /// World coordinates.
    pub position: [f32; 3],
    /// Length of ray that it represents: up to the next sample, for the last one up to `far`.
    pub length: f32,
    /// Vector along its ray, see [`TargetRay::direction`].
    pub direction: [f32; 3],
    /// Which sample it is, flat in `[ray][sample]`.
    pub sample: u32,
}

/// A dispatch of [`place_point`], as plain data. The yes-or-no field is 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PlaceBlock {
    /// Samples on each ray.
    pub sample_count: u32,
    /// The first place of the list that becomes a point.
    pub first: u32,
    /// Whether there is a list of samples; without one every sample is in it, in order.
    pub has_samples: u32,
}

impl PlaceBlock {
    /// The sample that point `point` is of.
    #[inline]
    pub fn sample(&self, samples: &(impl Fetch<u32> + ?Sized), point: u32) -> u32 {
        let place = self.first + point;
        if self.has_samples != 0 { samples.fetch(place as usize) } else { place }
    }
}

/// The point of sample number `sample` of `depths[ray][sample]`, which increase along each ray of `sample_count`, at least
/// one.
#[inline]
pub fn place_point(
    rays: &(impl Fetch<TargetRay> + ?Sized),
    depths: &(impl Fetch<f32> + ?Sized),
    sample_count: u32,
    sample: u32,
) -> RayPoint {
    let ray = rays.fetch((sample / sample_count) as usize);
    let depth = depths.fetch(sample as usize);
    let is_last = sample % sample_count + 1 == sample_count;
    let behind = if is_last { ray.far } else { depths.fetch(sample as usize + 1) };
    let [x, y, z] = ray.direction;
    RayPoint {
        position: [ray.origin[0] + x * depth, ray.origin[1] + y * depth, ray.origin[2] + z * depth],
        length: max(behind - depth, 0.0),
        direction: ray.direction,
        sample,
    }
}
