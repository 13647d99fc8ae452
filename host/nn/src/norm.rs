//! Group norm. (Batch norms are folded into the convolutions before them, see [`crate::weights::BatchNorm`].)

use super::image::Image;
use super::scratch::Scratch;
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::network::group_norm::GroupNormBlock;

/// A group norm on a device.
pub struct GroupNorm<D: Device> {
    pub(crate) weights: D::Buffer<f32>,
    pub(crate) bias: D::Buffer<f32>,
    /// Channels of its images.
    pub channels: u32,
    /// Groups of neighbouring channels.
    pub(crate) group_count: u32,
    /// Added to variances (epsilon).
    pub(crate) epsilon: f32,
}

impl<D: Device> GroupNorm<D> {
    /// Normalises an image into a new one: mean 0 and variance 1 in each group of channels, then `weights[channel]`
    /// times that plus `bias[channel]`; with `silu`, outputs `x` become `x / (1 + e^-x)`.
    ///
    /// # Errors
    /// If the device is lost or has no memory left.
    pub fn run(&self, scratch: &mut Scratch<'_, D>, image: &Image<D>, silu: bool) -> Result<Image<D>, DeviceError> {
        let device = scratch.device();
        let block = GroupNormBlock {
            pixel_count: image.size.pixel_count(),
            channels: image.size.channels,
            in_pitch: image.pitch,
            in_first: image.first,
            group_count: self.group_count,
            variance_floor: self.epsilon,
            silu_outputs: u32::from(silu),
        };
        let mut output = scratch.image(image.size)?;
        let partials = scratch.partials((block.part_count() * block.group_count) as usize)?;
        device.group_norm_partials(&block, &image.values, partials)?;
        device.group_norm(&block, &image.values, partials, &self.weights, &self.bias, &mut output.values)?;
        Ok(output)
    }
}
