//! The views become one, samples become a pixel.

use super::super::memory::Memory;
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::fuse::FuseBlock;

/// A target picture in a device's memory.
pub struct Pixels<D: Memory + ?Sized> {
    /// `[row][column]`: red, green, blue, opacity.
    pub colours: D::Buffer<[f32; 4]>,
    /// `[row][column]`: depth along the principal axis; 0 where nothing is met.
    pub depths: D::Buffer<f32>,
}

/// Kernels of `viewfuse_core`, see there.
pub trait LightKernels: Memory {
    /// Kernel `fuse_views` for `element_count` elements: `fused[element]` from the weights of the element's point and
    /// `latents[view][element]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn fuse_views(
        &self,
        block: &FuseBlock,
        element_count: u32,
        weights: &Self::Buffer<f32>,
        latents: &Self::Buffer<f32>,
        fused: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `composite` for every ray, from `samples[ray][sample]` (red, green, blue, optical depth) and
    /// `sample_depths[ray][sample]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn composite(
        &self,
        block: &CompositeBlock,
        samples: &Self::Buffer<[f32; 4]>,
        sample_depths: &Self::Buffer<f32>,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), Self::Error>;
}
