//! Means of images and normalisation by them, one of which may be wrong.

use super::Faulty;
use std::convert::Infallible;
use viewfuse::device::NormaliseKernels;
use viewfuse::device::cpu::Cpu;
use viewfuse_core::network::normalise::{MeanBlock, NormaliseBlock};
use viewfuse_vulkan::kernel::Kernel;

impl NormaliseKernels for Faulty {
    fn channel_means(&self, block: &MeanBlock, inputs: &Vec<f32>, means: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.channel_means(block, inputs, means)?;
        self.spoil(Kernel::ChannelMeans, means);
        Ok(())
    }

    fn part_moments(
        &self,
        block: &NormaliseBlock,
        inputs: &Vec<f32>,
        parts: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        Cpu.part_moments(block, inputs, parts)?;
        self.spoil(Kernel::PartMoments, parts.as_flattened_mut());
        Ok(())
    }

    fn merge_moments(
        &self,
        block: &NormaliseBlock,
        parts: &Vec<[f32; 2]>,
        moments: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        Cpu.merge_moments(block, parts, moments)?;
        self.spoil(Kernel::MergeMoments, moments.as_flattened_mut());
        Ok(())
    }

    fn normalise(
        &self,
        block: &NormaliseBlock,
        inputs: &Vec<f32>,
        moments: &Vec<[f32; 2]>,
        weights: &Vec<f32>,
        bias: &Vec<f32>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.normalise(block, inputs, moments, weights, bias, outputs)?;
        self.spoil(Kernel::Normalise, outputs);
        Ok(())
    }
}
