//! Products of matrices that are both computed, and softmax.

use super::Vulkan;
use crate::kernels::matrices::MatrixKernels;
use bytemuck::bytes_of;
use viewfuse_core::network::attend::MatrixBlock;
use viewfuse_vulkan::kernel::{Kernel, tile_elements};
use viewfuse_vulkan::{Buffer, VulkanError};

impl MatrixKernels for Vulkan {
    fn multiply_matrices(
        &self,
        block: &MatrixBlock,
        left: &Buffer<f32>,
        right: &Buffer<f32>,
        outputs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let elements = tile_elements(block.row_count, block.column_count);
        let arrays = [left.bind(), right.bind(), outputs.bind()];
        self.gpu.dispatch(Kernel::MultiplyMatrices, bytes_of(block), 0..elements, &arrays)
    }

    fn softmax_rows(
        &self,
        row_count: u32,
        column_count: u32,
        scores: &Buffer<f32>,
        weights: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [scores.bind(), weights.bind()];
        self.gpu.dispatch(Kernel::SoftmaxRows, bytes_of(&column_count), 0..row_count, &arrays)
    }
}
