//! From volumes to a feature image, and the denoiser's inputs.

use super::super::memory::Memory;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::genvs::{DenoiserInputBlock, FeatureBlock, VolumeBlock};
use viewfuse_core::rays::RayPoint;

/// Kernels of [`viewfuse_core::genvs`] and [`viewfuse_core::half`]. Buffers may be longer than a block says.
pub trait VolumeKernels: Memory {
    /// Kernel `gather_volume` for every feature of every point: writes a view's part of
    /// `gathered[view][point][feature]`, from the view's `volume[row][column][depth][feature]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn gather_volume(
        &self,
        block: &VolumeBlock,
        views: &Self::Buffer<CameraBlock>,
        points: &Self::Buffer<RayPoint>,
        volume: &Self::Buffer<f32>,
        gathered: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `pack_halves` for every word: writes `number_count` numbers in 16 bits each, two in a word, the lower half
    /// first.
    ///
    /// # Errors
    /// If the device is lost.
    fn pack_halves(
        &self,
        number_count: u32,
        numbers: &Self::Buffer<f32>,
        words: &mut Self::Buffer<u32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `gather_halves`: as [`VolumeKernels::gather_volume`], from the words of a volume.
    ///
    /// # Errors
    /// If the device is lost.
    fn gather_halves(
        &self,
        block: &VolumeBlock,
        views: &Self::Buffer<CameraBlock>,
        points: &Self::Buffer<RayPoint>,
        volume: &Self::Buffer<u32>,
        gathered: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `weigh_features` for `ray_count` rays: `weights[ray][sample]` from `raw[ray][sample][1 + feature]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn weigh_features(
        &self,
        block: &FeatureBlock,
        ray_count: u32,
        raw: &Self::Buffer<f32>,
        points: &Self::Buffer<RayPoint>,
        weights: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `sum_features` for every number of `summed[ray][feature]`.
    ///
    /// # Errors
    /// If the device is lost.
    #[allow(clippy::too_many_arguments)]
    fn sum_features(
        &self,
        block: &FeatureBlock,
        ray_count: u32,
        weights: &Self::Buffer<f32>,
        fused: &Self::Buffer<f32>,
        raw: &Self::Buffer<f32>,
        summed: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `denoiser_input` for every number of `inputs[pixel][channel]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn denoiser_input(
        &self,
        block: &DenoiserInputBlock,
        pixel_count: u32,
        noisy: &Self::Buffer<f32>,
        condition: &Self::Buffer<f32>,
        inputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;
}
