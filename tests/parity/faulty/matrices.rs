//! Products of matrices that are both computed and softmax, one of which may be wrong.

use super::Faulty;
use std::convert::Infallible;
use viewfuse::device::MatrixKernels;
use viewfuse::device::cpu::Cpu;
use viewfuse_core::network::attend::MatrixBlock;
use viewfuse_vulkan::kernel::Kernel;

impl MatrixKernels for Faulty {
    fn multiply_matrices(
        &self,
        block: &MatrixBlock,
        left: &Vec<f32>,
        right: &Vec<f32>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.multiply_matrices(block, left, right, outputs)?;
        self.spoil(Kernel::MultiplyMatrices, outputs);
        Ok(())
    }

    fn softmax_rows(
        &self,
        row_count: u32,
        column_count: u32,
        scores: &Vec<f32>,
        weights: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.softmax_rows(row_count, column_count, scores, weights)?;
        self.spoil(Kernel::SoftmaxRows, weights);
        Ok(())
    }
}
