//! Means of images and normalisation by them.

use super::super::memory::Memory;
use viewfuse_core::network::normalise::{MeanBlock, NormaliseBlock};

/// Kernels of [`viewfuse_core::network::normalise`]. Buffers may be longer than a block says.
pub trait NormaliseKernels: Memory {
    /// Kernel `channel_means` for every channel of `inputs[pixel][channel]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn channel_means(
        &self,
        block: &MeanBlock,
        inputs: &Self::Buffer<f32>,
        means: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `part_moments` for every `parts[part][group]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn part_moments(
        &self,
        block: &NormaliseBlock,
        inputs: &Self::Buffer<f32>,
        parts: &mut Self::Buffer<[f32; 2]>,
    ) -> Result<(), Self::Error>;

    /// Kernel `merge_moments` for every `moments[group]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn merge_moments(
        &self,
        block: &NormaliseBlock,
        parts: &Self::Buffer<[f32; 2]>,
        moments: &mut Self::Buffer<[f32; 2]>,
    ) -> Result<(), Self::Error>;

    /// Kernel `normalise` for every number of `outputs[pixel][channel]`, with `weights[channel]` and `bias[channel]`.
    ///
    /// # Errors
    /// If the device is lost.
    #[allow(clippy::too_many_arguments)]
    fn normalise(
        &self,
        block: &NormaliseBlock,
        inputs: &Self::Buffer<f32>,
        moments: &Self::Buffer<[f32; 2]>,
        weights: &Self::Buffer<f32>,
        bias: &Self::Buffer<f32>,
        outputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;
}
