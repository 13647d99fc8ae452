//! From noise to a picture.

use super::{Vulkan, count_of};
use crate::kernels::sampler::SamplerKernels;
use bytemuck::bytes_of;
use viewfuse_core::sampler::{MOST_RESULTS, Mix, NoiseBlock};
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, VulkanError};

impl SamplerKernels for Vulkan {
    fn mix_pictures(
        &self,
        mix: &Mix,
        state: &Buffer<f32>,
        results: [&Buffer<f32>; MOST_RESULTS],
        mixed: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let [newest, second, third, fourth] = results.map(Buffer::bind);
        let arrays = [state.bind(), newest, second, third, fourth, mixed.bind()];
        self.gpu.dispatch(Kernel::MixPictures, bytes_of(mix), 0..count_of(mixed.len()), &arrays)
    }

    fn add_noise(&self, block: &NoiseBlock, picture: &Buffer<f32>, noisy: &mut Buffer<f32>) -> Result<(), VulkanError> {
        let arrays = [picture.bind(), noisy.bind()];
        self.gpu.dispatch(Kernel::AddNoise, bytes_of(block), 0..count_of(noisy.len()), &arrays)
    }
}
