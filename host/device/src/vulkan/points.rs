//! What goes into PixelNeRF's network for points, and what comes out.

use super::Vulkan;
use crate::kernels::points::PointKernels;
use bytemuck::bytes_of;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pixelnerf::{EmbedBlock, GatherBlock};
use viewfuse_core::rays::RayPoint;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, VulkanError};

impl PointKernels for Vulkan {
    fn embed_points(
        &self,
        block: &EmbedBlock,
        view_count: u32,
        views: &Buffer<CameraBlock>,
        points: &Buffer<RayPoint>,
        embedded: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let elements = view_count * block.point_count * block.row_len();
        let arrays = [views.bind(), points.bind(), embedded.bind()];
        self.gpu.dispatch(Kernel::EmbedPoints, bytes_of(block), 0..elements, &arrays)
    }

    fn visible_weights(
        &self,
        view_count: u32,
        point_count: u32,
        views: &Buffer<CameraBlock>,
        weights: &Buffer<f32>,
        points: &Buffer<RayPoint>,
        visible: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [views.bind(), weights.bind(), points.bind(), visible.bind()];
        self.gpu.dispatch(Kernel::VisibleWeights, bytes_of(&view_count), 0..point_count * view_count, &arrays)
    }

    fn gather_latents(
        &self,
        block: &GatherBlock,
        views: &Buffer<CameraBlock>,
        points: &Buffer<RayPoint>,
        grid: &Buffer<f32>,
        addend: Option<&Buffer<f32>>,
        gathered: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let block = GatherBlock { has_addend: u32::from(addend.is_some()), ..*block };
        // Something must be bound.
        let addend = addend.unwrap_or(grid);
        let arrays = [views.bind(), points.bind(), grid.bind(), addend.bind(), gathered.bind()];
        self.gpu.dispatch(Kernel::GatherLatents, bytes_of(&block), 0..block.point_count * block.channel_count, &arrays)
    }

    fn radiance(
        &self,
        point_count: u32,
        raw: &Buffer<f32>,
        points: &Buffer<RayPoint>,
        samples: &mut Buffer<[f32; 4]>,
    ) -> Result<(), VulkanError> {
        let arrays = [raw.bind(), points.bind(), samples.bind()];
        self.gpu.dispatch(Kernel::Radiance, &[], 0..point_count, &arrays)
    }
}
