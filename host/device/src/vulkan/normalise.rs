//! Means of images and normalisation by them.

use super::Vulkan;
use crate::kernels::normalise::NormaliseKernels;
use bytemuck::bytes_of;
use viewfuse_core::network::normalise::{MeanBlock, NormaliseBlock};
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, VulkanError};

impl NormaliseKernels for Vulkan {
    fn channel_means(
        &self,
        block: &MeanBlock,
        inputs: &Buffer<f32>,
        means: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        self.gpu.dispatch(Kernel::ChannelMeans, bytes_of(block), 0..block.channels, &[inputs.bind(), means.bind()])
    }

    fn part_moments(
        &self,
        block: &NormaliseBlock,
        inputs: &Buffer<f32>,
        parts: &mut Buffer<[f32; 2]>,
    ) -> Result<(), VulkanError> {
        let elements = block.part_count() * block.group_count;
        self.gpu.dispatch(Kernel::PartMoments, bytes_of(block), 0..elements, &[inputs.bind(), parts.bind()])
    }

    fn merge_moments(
        &self,
        block: &NormaliseBlock,
        parts: &Buffer<[f32; 2]>,
        moments: &mut Buffer<[f32; 2]>,
    ) -> Result<(), VulkanError> {
        let arrays = [parts.bind(), moments.bind()];
        self.gpu.dispatch(Kernel::MergeMoments, bytes_of(block), 0..block.group_count, &arrays)
    }

    fn normalise(
        &self,
        block: &NormaliseBlock,
        inputs: &Buffer<f32>,
        moments: &Buffer<[f32; 2]>,
        weights: &Buffer<f32>,
        bias: &Buffer<f32>,
        outputs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [inputs.bind(), moments.bind(), weights.bind(), bias.bind(), outputs.bind()];
        let elements = block.pixel_count * block.channels;
        self.gpu.dispatch(Kernel::Normalise, bytes_of(block), 0..elements, &arrays)
    }
}
