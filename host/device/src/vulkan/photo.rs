//! The field that needs no weights file.

use super::Vulkan;
use crate::kernels::light::Pixels;
use crate::kernels::photo::{PhotoKernels, PhotoScene};
use bytemuck::bytes_of;
use std::ops::Range;
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, VulkanError};

impl PhotoKernels for Vulkan {
    fn hull_entry(&self, scene: &PhotoScene<Self>, view: u32, entries: &mut Buffer<f32>) -> Result<(), VulkanError> {
        let camera = &scene.cameras[view as usize];
        let arrays = [scene.object_buffer.bind(), scene.views.bind(), scene.texels.bind(), entries.bind()];
        self.gpu.dispatch(Kernel::HullEntry, bytes_of(&view), 0..camera.width * camera.height, &arrays)
    }

    fn match_cost(
        &self,
        scene: &PhotoScene<Self>,
        sweep: &SweepBlock,
        entries: &Buffer<f32>,
        pair_weights: &Buffer<f32>,
        costs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let PhotoScene { object_buffer, views, texels, .. } = scene;
        let arrays =
            [object_buffer.bind(), views.bind(), texels.bind(), entries.bind(), pair_weights.bind(), costs.bind()];
        self.gpu.dispatch(Kernel::MatchCost, bytes_of(sweep), 0..sweep.row_count * sweep.width, &arrays)
    }

    fn sum_row(
        &self,
        sweep: &SweepBlock,
        costs: &Buffer<f32>,
        row_sums: &mut Buffer<[f32; 2]>,
    ) -> Result<(), VulkanError> {
        let arrays = [costs.bind(), row_sums.bind()];
        self.gpu.dispatch(Kernel::SumRow, bytes_of(sweep), 0..planes_of(sweep), &arrays)
    }

    fn mean_column(
        &self,
        sweep: &SweepBlock,
        costs: &Buffer<f32>,
        row_sums: &Buffer<[f32; 2]>,
        means: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [costs.bind(), row_sums.bind(), means.bind()];
        self.gpu.dispatch(Kernel::MeanColumn, bytes_of(sweep), 0..planes_of(sweep), &arrays)
    }

    fn pick_depth(
        &self,
        scene: &PhotoScene<Self>,
        sweep: &SweepBlock,
        means: &Buffer<f32>,
        entries: &Buffer<f32>,
        guess: &Buffer<f32>,
        rows: Range<u32>,
        picked: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let PhotoScene { object_buffer, views, .. } = scene;
        let arrays = [object_buffer.bind(), views.bind(), means.bind(), entries.bind(), guess.bind(), picked.bind()];
        let pixels = rows.start * sweep.width..rows.end * sweep.width;
        self.gpu.dispatch(Kernel::PickDepth, bytes_of(sweep), pixels, &arrays)
    }

    fn march(
        &self,
        scene: &PhotoScene<Self>,
        depths: &Buffer<f32>,
        weights: &Buffer<f32>,
        target: &MarchBlock,
        first_row: u32,
        row_count: u32,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), VulkanError> {
        let PhotoScene { object_buffer, views, footprints, texels, .. } = scene;
        let arrays = [
            object_buffer.bind(),
            views.bind(),
            footprints.bind(),
            texels.bind(),
            depths.bind(),
            weights.bind(),
            pixels.colours.bind(),
            pixels.depths.bind(),
        ];
        let width = target.target.width;
        let rays = first_row * width..(first_row + row_count) * width;
        self.gpu.dispatch(Kernel::March, bytes_of(target), rays, &arrays)
    }
}

/// Planes of all pixels of a band.
fn planes_of(sweep: &SweepBlock) -> u32 {
    sweep.row_count * sweep.width * sweep.plane_count
}
