//! Layers of networks, one of which may be wrong.

use super::Faulty;
use std::convert::Infallible;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Layer, NetworkKernels};
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_vulkan::kernel::Kernel;

/// The same layer for the CPU.
fn on_cpu(layer: &Layer<Faulty>) -> Layer<Cpu> {
    Layer::new(layer.weights().clone(), layer.bias().clone())
}

impl NetworkKernels for Faulty {
    fn convolve(
        &self,
        block: &ConvolveBlock,
        inputs: &Vec<f32>,
        layer: &Layer<Self>,
        addend: Option<&Vec<f32>>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.convolve(block, inputs, &on_cpu(layer), addend, outputs)?;
        self.spoil(Kernel::Convolve, outputs);
        Ok(())
    }

    fn max_pool(&self, block: &PoolBlock, inputs: &Vec<f32>, outputs: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.max_pool(block, inputs, outputs)?;
        self.spoil(Kernel::MaxPool, outputs);
        Ok(())
    }

    fn upsample(&self, block: &UpsampleBlock, inputs: &Vec<f32>, outputs: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.upsample(block, inputs, outputs)?;
        self.spoil(Kernel::Upsample, outputs);
        Ok(())
    }

    fn product(
        &self,
        block: &ProductBlock,
        inputs: &Vec<f32>,
        layer: &Layer<Self>,
        addend: Option<&Vec<f32>>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.product(block, inputs, &on_cpu(layer), addend, outputs)?;
        self.spoil(Kernel::Product, outputs);
        Ok(())
    }
}
