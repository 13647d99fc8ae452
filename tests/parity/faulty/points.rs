//! What goes into PixelNeRF's network and what comes out, one of which may be wrong.

use super::Faulty;
use std::convert::Infallible;
use viewfuse::device::PointKernels;
use viewfuse::device::cpu::Cpu;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pixelnerf::{EmbedBlock, GatherBlock};
use viewfuse_core::rays::RayPoint;
use viewfuse_vulkan::kernel::Kernel;

impl PointKernels for Faulty {
    fn embed_points(
        &self,
        block: &EmbedBlock,
        view_count: u32,
        views: &Vec<CameraBlock>,
        points: &Vec<RayPoint>,
        embedded: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.embed_points(block, view_count, views, points, embedded)?;
        self.spoil(Kernel::EmbedPoints, embedded);
        Ok(())
    }

    fn visible_weights(
        &self,
        view_count: u32,
        point_count: u32,
        views: &Vec<CameraBlock>,
        weights: &Vec<f32>,
        points: &Vec<RayPoint>,
        visible: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.visible_weights(view_count, point_count, views, weights, points, visible)?;
        self.spoil(Kernel::VisibleWeights, visible);
        Ok(())
    }

    fn gather_latents(
        &self,
        block: &GatherBlock,
        views: &Vec<CameraBlock>,
        points: &Vec<RayPoint>,
        grid: &Vec<f32>,
        addend: Option<&Vec<f32>>,
        gathered: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.gather_latents(block, views, points, grid, addend, gathered)?;
        let count = (block.point_count * block.channel_count) as usize;
        self.spoil(Kernel::GatherLatents, &mut gathered[block.first()..][..count]);
        Ok(())
    }

    fn radiance(
        &self,
        point_count: u32,
        raw: &Vec<f32>,
        points: &Vec<RayPoint>,
        samples: &mut Vec<[f32; 4]>,
    ) -> Result<(), Infallible> {
        Cpu.radiance(point_count, raw, points, samples)?;
        self.spoil(Kernel::Radiance, samples.as_flattened_mut());
        Ok(())
    }
}
