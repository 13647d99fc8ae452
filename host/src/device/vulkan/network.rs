//! Layers of networks.

use super::Vulkan;
use crate::device::kernels::network::{Layer, NetworkKernels};
use bytemuck::bytes_of;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_vulkan::kernel::{Kernel, tile_elements};
use viewfuse_vulkan::{Buffer, VulkanError};

impl NetworkKernels for Vulkan {
    fn convolve(
        &self,
        block: &ConvolveBlock,
        inputs: &Buffer<f32>,
        layer: &Layer<Self>,
        addend: Option<&Buffer<f32>>,
        outputs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let block = ConvolveBlock { has_addend: u32::from(addend.is_some()), ..*block };
        // Something must be bound.
        let addend = addend.unwrap_or(layer.bias());
        let arrays = [inputs.bind(), layer.weights().bind(), layer.bias().bind(), addend.bind(), outputs.bind()];
        let elements = tile_elements(block.pixel_count(), block.out_channels);
        self.gpu.dispatch(Kernel::Convolve, bytes_of(&block), 0..elements, &arrays)
    }

    fn max_pool(&self, block: &PoolBlock, inputs: &Buffer<f32>, outputs: &mut Buffer<f32>) -> Result<(), VulkanError> {
        let elements = block.out_height * block.out_width * block.channels;
        self.gpu.dispatch(Kernel::MaxPool, bytes_of(block), 0..elements, &[inputs.bind(), outputs.bind()])
    }

    fn upsample(
        &self,
        block: &UpsampleBlock,
        inputs: &Buffer<f32>,
        outputs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let elements = block.out_height * block.out_width * block.in_channels;
        self.gpu.dispatch(Kernel::Upsample, bytes_of(block), 0..elements, &[inputs.bind(), outputs.bind()])
    }

    fn product(
        &self,
        block: &ProductBlock,
        inputs: &Buffer<f32>,
        layer: &Layer<Self>,
        addend: Option<&Buffer<f32>>,
        outputs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let block = ProductBlock { has_addend: u32::from(addend.is_some()), ..*block };
        let addend = addend.unwrap_or(layer.bias());
        let arrays = [inputs.bind(), layer.weights().bind(), layer.bias().bind(), addend.bind(), outputs.bind()];
        let elements = tile_elements(block.row_count, block.column_count);
        self.gpu.dispatch(Kernel::Product, bytes_of(&block), 0..elements, &arrays)
    }
}
