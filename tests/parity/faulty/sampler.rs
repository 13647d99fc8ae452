//! Linear combinations and noise, one of which may be wrong.

use super::Faulty;
use std::convert::Infallible;
use viewfuse::device::SamplerKernels;
use viewfuse::device::cpu::Cpu;
use viewfuse_core::sampler::{MOST_RESULTS, Mix, NoiseBlock};
use viewfuse_vulkan::kernel::Kernel;

impl SamplerKernels for Faulty {
    fn mix_pictures(
        &self,
        mix: &Mix,
        state: &Vec<f32>,
        results: [&Vec<f32>; MOST_RESULTS],
        mixed: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.mix_pictures(mix, state, results, mixed)?;
        self.spoil(Kernel::MixPictures, mixed);
        Ok(())
    }

    fn add_noise(&self, block: &NoiseBlock, picture: &Vec<f32>, noisy: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.add_noise(block, picture, noisy)?;
        self.spoil(Kernel::AddNoise, noisy);
        Ok(())
    }
}
