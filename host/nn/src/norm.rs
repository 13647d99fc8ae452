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
        let mut parts = device.zeros((block.part_count() * block.group_count) as usize)?;
        let mut statistics = device.zeros(block.group_count as usize)?;
        device.group_norm_partials(&block, &image.values, &mut parts)?;
        device.group_norm_statistics(&block, &parts, &mut statistics)?;
        let mut output = scratch.image(image.size)?;
        device.group_norm(&block, &image.values, &statistics, &self.weights, &self.bias, &mut output.values)?;
        Ok(output)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Size;
    use viewfuse_device::cpu::Cpu;

    #[test]
    fn groups_are_normalised_on_their_own() -> Result<(), DeviceError> {
        let norm =
            GroupNorm::<Cpu> { weights: vec![2.0; 4], bias: vec![0.5; 4], channels: 4, group_count: 2, epsilon: 0.0 };
        let mut scratch = Scratch::new(&Cpu);
        // The first group is 1 and 3, the second 100 and 500, half of them in each pixel.
        let values = [1.0, 1.0, 100.0, 500.0, 3.0, 3.0, 500.0, 100.0];
        let image = Image::upload(&Cpu, Size { height: 1, width: 2, channels: 4 }, &values)?;
        let output = norm.run(&mut scratch, &image, false)?;
        assert_eq!(output.values, [-1.5, -1.5, -1.5, 2.5, 2.5, 2.5, 2.5, -1.5]);
        let silu = norm.run(&mut scratch, &image, true)?;
        assert!((silu.values[0] + 1.5 / (1.0 + 1.5_f32.exp())).abs() < 1.0e-6, "{}", silu.values[0]);
        Ok(())
    }
}
