//! Where along which rays to look, and what was seen there.

use super::Vulkan;
use crate::kernels::light::Pixels;
use crate::kernels::rays::{RayKernels, Rays};
use bytemuck::bytes_of;
use viewfuse_core::depths::{CoarseBlock, FineBlock};
use viewfuse_core::rays::{CastBlock, RayPoint};
use viewfuse_core::wanted::WantedBlock;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, VulkanError};

impl RayKernels for Vulkan {
    fn cast_rays(&self, block: &CastBlock, rays: &mut Rays<Self>) -> Result<(), VulkanError> {
        let arrays = [rays.pixels.bind(), rays.rays.bind()];
        self.gpu.dispatch(Kernel::CastRays, bytes_of(block), 0..rays.count, &arrays)
    }

    fn coarse_depths(
        &self,
        block: &CoarseBlock,
        rays: &Rays<Self>,
        depths: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [rays.rays.bind(), rays.pixels.bind(), depths.bind()];
        self.gpu.dispatch(Kernel::CoarseDepths, bytes_of(block), 0..rays.count * block.sample_count, &arrays)
    }

    fn draw_chances(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        chances: &mut Buffer<[f32; 2]>,
    ) -> Result<(), VulkanError> {
        let arrays = [rays.pixels.bind(), chances.bind()];
        self.gpu.dispatch(Kernel::DrawChances, bytes_of(block), 0..rays.count * block.fine_count(), &arrays)
    }

    fn fine_depths(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        seen: &Buffer<[f32; 2]>,
        pixels: &Pixels<Self>,
        chances: &Buffer<[f32; 2]>,
        depths: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let Pixels { colours, depths: pixel_depths } = pixels;
        let arrays =
            [seen.bind(), rays.rays.bind(), colours.bind(), pixel_depths.bind(), chances.bind(), depths.bind()];
        self.gpu.dispatch(Kernel::FineDepths, bytes_of(block), 0..rays.count * block.fine_count(), &arrays)
    }

    fn merge_depths(
        &self,
        block: &FineBlock,
        ray_count: u32,
        coarse: &Buffer<f32>,
        fine: &Buffer<f32>,
        merged: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let elements = ray_count * (block.coarse_count + block.fine_count());
        let arrays = [coarse.bind(), fine.bind(), merged.bind()];
        self.gpu.dispatch(Kernel::MergeDepths, bytes_of(block), 0..elements, &arrays)
    }

    fn wanted_samples(
        &self,
        block: &WantedBlock,
        rays: &Rays<Self>,
        depths: &Buffer<f32>,
        seen: &Buffer<[f32; 2]>,
        wanted: &mut Buffer<u32>,
    ) -> Result<(), VulkanError> {
        let arrays = [seen.bind(), rays.rays.bind(), rays.pixels.bind(), depths.bind(), wanted.bind()];
        self.gpu.dispatch(Kernel::WantedSamples, bytes_of(block), 0..rays.count * block.sample_count, &arrays)
    }

    fn place_points(
        &self,
        sample_count: u32,
        point_count: u32,
        samples: &Buffer<u32>,
        rays: &Rays<Self>,
        depths: &Buffer<f32>,
        points: &mut Buffer<RayPoint>,
    ) -> Result<(), VulkanError> {
        let arrays = [samples.bind(), rays.rays.bind(), depths.bind(), points.bind()];
        self.gpu.dispatch(Kernel::PlacePoints, bytes_of(&sample_count), 0..point_count, &arrays)
    }

    fn weigh_samples(
        &self,
        sample_count: u32,
        ray_count: u32,
        samples: &Buffer<[f32; 4]>,
        seen: &mut Buffer<[f32; 2]>,
    ) -> Result<(), VulkanError> {
        let arrays = [samples.bind(), seen.bind()];
        self.gpu.dispatch(Kernel::WeighSamples, bytes_of(&sample_count), 0..ray_count, &arrays)
    }
}
