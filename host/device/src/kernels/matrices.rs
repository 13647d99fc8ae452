//! Products of matrices that are both computed, and softmax.

use super::super::memory::Memory;
use viewfuse_core::network::attend::MatrixBlock;

/// Kernels of [`viewfuse_core::network::attend`]. Buffers may be longer than a block says.
pub trait MatrixKernels: Memory {
    /// Kernel `multiply_matrices` for every number of `outputs[row][column]`. The matrices may lie in one buffer. Sums
    /// run in an order of the device's choice.
    ///
    /// # Errors
    /// If the device is lost.
    fn multiply_matrices(
        &self,
        block: &MatrixBlock,
        left: &Self::Buffer<f32>,
        right: &Self::Buffer<f32>,
        outputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `softmax_rows` for every row of `scores[row][column]`: writes `weights[row][column]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn softmax_rows(
        &self,
        row_count: u32,
        column_count: u32,
        scores: &Self::Buffer<f32>,
        weights: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;
}
