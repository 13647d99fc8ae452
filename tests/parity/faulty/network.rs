//! Layers of networks, one of which may be wrong.

use super::Faulty;
use std::convert::Infallible;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Layer, LayerShape, NetworkKernels};
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::depthwise::DepthwiseBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_core::network::transpose::TransposedBlock;
use viewfuse_vulkan::kernel::Kernel;

/// The same layer for the CPU.
fn on_cpu(layer: &Layer<Faulty>) -> Layer<Cpu> {
    let (shape, weights) = &layer.weights;
    let Ok(layer) = Layer::new(&Cpu, shape, weights, &layer.bias);
    layer
}

impl NetworkKernels for Faulty {
    type Weights = (LayerShape, Vec<f32>);

    fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Self::Weights, Infallible> {
        Ok((*shape, weights.to_vec()))
    }

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

    fn convolve_depthwise(
        &self,
        block: &DepthwiseBlock,
        inputs: &Vec<f32>,
        weights: &Vec<f32>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.convolve_depthwise(block, inputs, weights, outputs)?;
        self.spoil(Kernel::ConvolveDepthwise, outputs);
        Ok(())
    }

    fn convolve_transposed(
        &self,
        block: &TransposedBlock,
        inputs: &Vec<f32>,
        layer: &Layer<Self>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.convolve_transposed(block, inputs, &on_cpu(layer), outputs)?;
        self.spoil(Kernel::ConvolveTransposed, outputs);
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
