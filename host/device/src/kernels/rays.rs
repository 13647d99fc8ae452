//! Where along which rays to look, and what was seen there.

use super::super::memory::Memory;
use super::light::Pixels;
use viewfuse_core::depths::{CoarseBlock, FineBlock};
use viewfuse_core::rays::{CastBlock, RayPoint, TargetRay};
use viewfuse_core::wanted::WantedBlock;

/// Rays of a target in a device's memory.
pub struct Rays<D: Memory + ?Sized> {
    /// How many there are; buffers may be longer.
    pub count: u32,
    /// `[ray]`: their pixels, flat and row-major.
    pub pixels: D::Buffer<u32>,
    /// `[ray]`.
    pub rays: D::Buffer<TargetRay>,
}

/// Kernels of [`viewfuse_core::rays`], [`viewfuse_core::depths`] and [`viewfuse_core::wanted`].
pub trait RayKernels: Memory {
    /// Kernel `cast_rays` for every ray: writes the rays of the pixels.
    ///
    /// # Errors
    /// If the device is lost.
    fn cast_rays(&self, block: &CastBlock, rays: &mut Rays<Self>) -> Result<(), Self::Error>;

    /// Kernel `coarse_depths` for every ray and sample: `depths[ray][sample]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn coarse_depths(
        &self,
        block: &CoarseBlock,
        rays: &Rays<Self>,
        depths: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `draw_chances` for every ray and fine sample: `chances[ray][sample]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn draw_chances(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        chances: &mut Self::Buffer<[f32; 2]>,
    ) -> Result<(), Self::Error>;

    /// Kernel `fine_depths` for every ray and fine sample: `depths[ray][sample]`, from what the first pass saw:
    /// `seen[ray][part]` and the pixels of these rays.
    ///
    /// # Errors
    /// If the device is lost.
    fn fine_depths(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        seen: &Self::Buffer<[f32; 2]>,
        pixels: &Pixels<Self>,
        chances: &Self::Buffer<[f32; 2]>,
        depths: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `merge_depths` for every ray and sample: `merged[ray][sample]` increase, from `coarse[ray][sample]` and
    /// `fine[ray][sample]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn merge_depths(
        &self,
        block: &FineBlock,
        ray_count: u32,
        coarse: &Self::Buffer<f32>,
        fine: &Self::Buffer<f32>,
        merged: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `wanted_samples` for every ray and sample: `wanted[ray][sample]` is 1 or 0, by `seen[seen ray][part]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn wanted_samples(
        &self,
        block: &WantedBlock,
        rays: &Rays<Self>,
        depths: &Self::Buffer<f32>,
        seen: &Self::Buffer<[f32; 2]>,
        wanted: &mut Self::Buffer<u32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `place_points` for the samples in a list of `point_count`: `points[point]`, from `depths[ray][sample]`.
    ///
    /// # Errors
    /// If the device is lost.
    #[allow(clippy::too_many_arguments)]
    fn place_points(
        &self,
        sample_count: u32,
        point_count: u32,
        samples: &Self::Buffer<u32>,
        rays: &Rays<Self>,
        depths: &Self::Buffer<f32>,
        points: &mut Self::Buffer<RayPoint>,
    ) -> Result<(), Self::Error>;

    /// Kernel `weigh_samples` for every ray: `seen[ray][sample]` is weight and transmittance in front, from
    /// `samples[ray][sample]` (red, green, blue, optical depth).
    ///
    /// # Errors
    /// If the device is lost.
    fn weigh_samples(
        &self,
        sample_count: u32,
        ray_count: u32,
        samples: &Self::Buffer<[f32; 4]>,
        seen: &mut Self::Buffer<[f32; 2]>,
    ) -> Result<(), Self::Error>;
}
