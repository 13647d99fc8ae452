//! From noise to a picture.

use super::super::memory::Memory;
use viewfuse_core::sampler::{MOST_RESULTS, Mix, NoiseBlock};

/// Kernels of `viewfuse_core::sampler`, see there.
pub trait SamplerKernels: Memory {
    /// Kernel `mix_pictures` for every element of `mixed`: the combination of `state[element]` and
    /// `results[result][element]`, the newest result first. What has coefficient 0 is not read and may be any buffer.
    ///
    /// # Errors
    /// If the device is lost.
    fn mix_pictures(
        &self,
        mix: &Mix,
        state: &Self::Buffer<f32>,
        results: [&Self::Buffer<f32>; MOST_RESULTS],
        mixed: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `add_noise` for every element of `noisy`: `picture[element]` with noise.
    ///
    /// # Errors
    /// If the device is lost.
    fn add_noise(
        &self,
        block: &NoiseBlock,
        picture: &Self::Buffer<f32>,
        noisy: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;
}
