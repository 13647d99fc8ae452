//! Buffers that belong together.

use super::error::DeviceError;
use super::kernels::{Device, LayerShape};
use super::memory::Memory;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::TargetRay;
use viewfuse_kernels::visual_hull::ObjectBlock;

/// The parameters of a layer in a device's memory. They never change, and all blocks that they are used with have the
/// same inner index and columns.
pub struct Layer<D: Device + ?Sized> {
    /// In the device's own form.
    pub weights: D::Weights,
    /// `[column]`.
    pub bias: D::Buffer<f32>,
}

impl<D: Device + ?Sized> Layer<D> {
    /// A layer of `weights[inner][column]` (for a convolution `[row of the window][column of the window][input
    /// channel][output channel]`) and `bias[column]` (for a transposed convolution `bias[output channel]`).
    ///
    /// # Errors
    /// If the device has no memory left.
    pub fn new(device: &D, shape: &LayerShape, weights: &[f32], bias: &[f32]) -> Result<Layer<D>, DeviceError> {
        Ok(Layer { weights: device.weights(shape, weights)?, bias: device.upload(bias)? })
    }
}

/// Rays of a target in a device's memory.
pub struct Rays<D: Memory + ?Sized> {
    /// How many there are; buffers may be longer.
    pub count: u32,
    /// `[ray]`: their pixels, flat and row-major.
    pub pixels: D::Buffer<u32>,
    /// `[ray]`.
    pub rays: D::Buffer<TargetRay>,
}

/// A target picture in a device's memory.
pub struct Pixels<D: Memory + ?Sized> {
    /// `[row][column]`: red, green, blue, opacity.
    pub colours: D::Buffer<[f32; 4]>,
    /// `[row][column]`: depth along the principal axis; 0 where there is no surface.
    pub depths: D::Buffer<f32>,
}

/// Views and object of the training-free field in a device's memory; see [`viewfuse_kernels::visual_hull`].
pub struct HullScene<D: Memory + ?Sized> {
    /// The object's box and the number of views.
    pub object: ObjectBlock,
    /// The same in the device's memory.
    pub object_buffer: D::Buffer<ObjectBlock>,
    /// The source cameras on the host: shapes of the buffers.
    pub cameras: Vec<CameraBlock>,
    /// `[view]`: the source cameras.
    pub views: D::Buffer<CameraBlock>,
    /// `[view]`: a pixel's side at the middle of the object, world units.
    pub footprints: D::Buffer<f32>,
    /// `[view][row][column]`: premultiplied RGBA.
    pub texels: D::Buffer<[f32; 4]>,
}
