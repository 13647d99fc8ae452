//! Layers of networks.

use super::Vulkan;
use crate::kernels::network::{Layer, LayerShape, NetworkKernels};
use crate::memory::Memory;
use bytemuck::bytes_of;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::depthwise::DepthwiseBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_core::network::transpose::TransposedBlock;
use viewfuse_vulkan::kernel::{Kernel, tile_elements};
use viewfuse_vulkan::{Buffer, VulkanError};

impl NetworkKernels for Vulkan {
    type Weights = Buffer<f32>;

    fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Buffer<f32>, VulkanError> {
        self.upload(&weights[..shape.inner_count * shape.column_count])
    }

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
        let addend = addend.unwrap_or(&layer.bias);
        let arrays = [inputs.bind(), layer.weights.bind(), layer.bias.bind(), addend.bind(), outputs.bind()];
        let elements = tile_elements(block.pixel_count(), block.out_channels);
        self.gpu.dispatch(Kernel::Convolve, bytes_of(&block), 0..elements, &arrays)
    }

    fn convolve_depthwise(
        &self,
        block: &DepthwiseBlock,
        inputs: &Buffer<f32>,
        weights: &Buffer<f32>,
        outputs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [inputs.bind(), weights.bind(), outputs.bind()];
        let elements = block.pixel_count() * block.channels;
        self.gpu.dispatch(Kernel::ConvolveDepthwise, bytes_of(block), 0..elements, &arrays)
    }

    fn convolve_transposed(
        &self,
        block: &TransposedBlock,
        inputs: &Buffer<f32>,
        layer: &Layer<Self>,
        outputs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [inputs.bind(), layer.weights.bind(), layer.bias.bind(), outputs.bind()];
        let elements = tile_elements(block.pixel_count(), block.column_count());
        self.gpu.dispatch(Kernel::ConvolveTransposed, bytes_of(block), 0..elements, &arrays)
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
        let addend = addend.unwrap_or(&layer.bias);
        let arrays = [inputs.bind(), layer.weights.bind(), layer.bias.bind(), addend.bind(), outputs.bind()];
        let elements = tile_elements(block.row_count, block.column_count);
        self.gpu.dispatch(Kernel::Product, bytes_of(&block), 0..elements, &arrays)
    }
}
