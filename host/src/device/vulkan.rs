//! Vulkan devices: every kernel a dispatch; the work is in `viewfuse-vulkan`.

use super::{Device, Element, KernelTime, PhotoScene, Pixels};
use bytemuck::bytes_of;
use std::ops::Range;
use std::sync::Arc;
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::weighting::WeighBlock;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Adapter, Buffer, Gpu, GpuOptions, Instance, Tally, VulkanError};

/// A Vulkan device. Calls return when their work is on its way; only a download waits for it.
pub struct Vulkan {
    gpu: Gpu,
}

/// Elements that keep a graphics processor busy.
const BUSY_ELEMENTS: usize = 1 << 16;

impl Vulkan {
    /// Opens a device.
    ///
    /// # Errors
    /// [`VulkanError`].
    pub fn open(instance: &Arc<Instance>, adapter: &Adapter, options: &GpuOptions) -> Result<Vulkan, VulkanError> {
        Ok(Vulkan { gpu: Gpu::open(instance, adapter, options)? })
    }

    /// What a kernel did, up to the last download.
    pub fn tally(&self, kernel: Kernel) -> Tally {
        self.gpu.tally(kernel)
    }
}

fn count_of(len: usize) -> u32 {
    u32::try_from(len).unwrap_or(u32::MAX)
}

impl Device for Vulkan {
    type Buffer<T: Element> = Buffer<T>;
    type Error = VulkanError;

    fn name(&self) -> String {
        format!("vulkan ({})", self.gpu.name())
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Buffer<T>, VulkanError> {
        self.gpu.upload(values)
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Buffer<T>, VulkanError> {
        self.gpu.zeros(count)
    }

    fn most_elements<T: Element>(&self) -> usize {
        self.gpu.most_elements(size_of::<T>())
    }

    fn busy_elements(&self) -> usize {
        BUSY_ELEMENTS
    }

    fn finish(&self) -> Result<(), VulkanError> {
        self.gpu.wait()
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        let ran = Kernel::ALL.into_iter().map(|kernel| (kernel.name(), self.gpu.tally(kernel)));
        ran.filter(|(_, tally)| tally.dispatches > 0)
            .map(|(kernel, Tally { dispatches, elements, time })| KernelTime { kernel, dispatches, elements, time })
            .collect()
    }

    fn download<T: Element>(&self, buffer: &Buffer<T>) -> Result<Vec<T>, VulkanError> {
        self.gpu.download(buffer)
    }

    fn weigh(
        &self,
        block: &WeighBlock,
        sources: &Buffer<PoseBlock>,
        targets: &Buffer<PoseBlock>,
        weights: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [sources.bind(), targets.bind(), weights.bind()];
        self.gpu.dispatch(Kernel::Weigh, bytes_of(block), 0..count_of(targets.len()), &arrays)
    }

    fn embed_pose(
        &self,
        embedding: &Buffer<f32>,
        poses: &Buffer<PoseBlock>,
        embedded: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [embedding.bind(), poses.bind(), embedded.bind()];
        self.gpu.dispatch(Kernel::EmbedPose, &[], 0..count_of(poses.len()), &arrays)
    }

    fn attend(
        &self,
        source_count: u32,
        queries: &Buffer<f32>,
        keys: &Buffer<f32>,
        weights: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let targets = count_of(weights.len() / viewfuse_core::weighting::MOST_WEIGHED);
        let arrays = [queries.bind(), keys.bind(), weights.bind()];
        self.gpu.dispatch(Kernel::Attend, bytes_of(&source_count), 0..targets, &arrays)
    }

    fn fuse_views(
        &self,
        block: &FuseBlock,
        weights: &Buffer<f32>,
        latents: &Buffer<f32>,
        fused: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [weights.bind(), latents.bind(), fused.bind()];
        self.gpu.dispatch(Kernel::FuseViews, bytes_of(block), 0..count_of(fused.len()), &arrays)
    }

    fn composite(
        &self,
        block: &CompositeBlock,
        samples: &Buffer<[f32; 4]>,
        sample_depths: &Buffer<f32>,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), VulkanError> {
        let arrays = [samples.bind(), sample_depths.bind(), pixels.colours.bind(), pixels.depths.bind()];
        self.gpu.dispatch(Kernel::Composite, bytes_of(block), 0..count_of(pixels.depths.len()), &arrays)
    }

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
