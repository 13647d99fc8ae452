//! A device that computes on the CPU and gets one kernel wrong.

mod matrices;
mod network;
mod normalise;
mod points;
mod rays;
mod sampler;
mod volumes;

use std::convert::Infallible;
use std::ops::Range;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Element, KernelTime, LightKernels, Memory, PhotoKernels, PhotoScene, Pixels, WeightingKernels};
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::weighting::WeighBlock;
use viewfuse_vulkan::kernel::Kernel;

/// The CPU, with one kernel's results too large by 1e-3.
pub(crate) struct Faulty {
    /// Which.
    pub(crate) kernel: Kernel,
}

impl Faulty {
    fn spoil<'a>(&self, kernel: Kernel, values: impl IntoIterator<Item = &'a mut f32>) {
        if kernel == self.kernel {
            values.into_iter().for_each(|value| *value *= 1.001);
        }
    }
}

/// The same scene for the CPU.
fn on_cpu(scene: &PhotoScene<Faulty>) -> PhotoScene<Cpu> {
    PhotoScene {
        object_buffer: scene.object_buffer.clone(),
        object: scene.object,
        cameras: scene.cameras.clone(),
        views: scene.views.clone(),
        footprints: scene.footprints.clone(),
        texels: scene.texels.clone(),
    }
}

/// The same pixels for the CPU.
fn on_cpu_pixels(pixels: &Pixels<Faulty>) -> Pixels<Cpu> {
    Pixels { colours: pixels.colours.clone(), depths: pixels.depths.clone() }
}

/// Runs something on the CPU's kind of pixels.
fn with_pixels(pixels: &mut Pixels<Faulty>, run: impl FnOnce(&mut Pixels<Cpu>) -> Result<(), Infallible>) {
    let (colours, depths) = (std::mem::take(&mut pixels.colours), std::mem::take(&mut pixels.depths));
    let mut on_cpu = Pixels::<Cpu> { colours, depths };
    let Ok(()) = run(&mut on_cpu);
    (pixels.colours, pixels.depths) = (on_cpu.colours, on_cpu.depths);
}

impl Memory for Faulty {
    type Buffer<T: Element> = Vec<T>;
    type Error = Infallible;

    fn name(&self) -> String {
        format!("faulty {}", self.kernel.name())
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Vec<T>, Infallible> {
        Cpu.upload(values)
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Vec<T>, Infallible> {
        Cpu.zeros(count)
    }

    fn most_elements<T: Element>(&self) -> usize {
        Cpu.most_elements::<T>()
    }

    fn busy_elements(&self) -> usize {
        Cpu.busy_elements()
    }

    fn finish(&self) -> Result<(), Infallible> {
        Cpu.finish()
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        Cpu.kernel_times()
    }

    fn download<T: Element>(&self, buffer: &Vec<T>) -> Result<Vec<T>, Infallible> {
        Cpu.download(buffer)
    }
}

impl WeightingKernels for Faulty {
    fn weigh(
        &self,
        block: &WeighBlock,
        sources: &Vec<PoseBlock>,
        targets: &Vec<PoseBlock>,
        weights: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.weigh(block, sources, targets, weights)?;
        self.spoil(Kernel::Weigh, weights);
        Ok(())
    }

    fn embed_pose(
        &self,
        embedding: &Vec<f32>,
        poses: &Vec<PoseBlock>,
        embedded: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.embed_pose(embedding, poses, embedded)?;
        self.spoil(Kernel::EmbedPose, embedded);
        Ok(())
    }

    fn attend(
        &self,
        source_count: u32,
        queries: &Vec<f32>,
        keys: &Vec<f32>,
        weights: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.attend(source_count, queries, keys, weights)?;
        self.spoil(Kernel::Attend, weights);
        Ok(())
    }
}

impl LightKernels for Faulty {
    fn fuse_views(
        &self,
        block: &FuseBlock,
        element_count: u32,
        weights: &Vec<f32>,
        latents: &Vec<f32>,
        fused: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.fuse_views(block, element_count, weights, latents, fused)?;
        self.spoil(Kernel::FuseViews, fused);
        Ok(())
    }

    fn composite(
        &self,
        block: &CompositeBlock,
        samples: &Vec<[f32; 4]>,
        sample_depths: &Vec<f32>,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), Infallible> {
        with_pixels(pixels, |pixels| Cpu.composite(block, samples, sample_depths, pixels));
        self.spoil(Kernel::Composite, pixels.colours.as_flattened_mut());
        Ok(())
    }
}

impl PhotoKernels for Faulty {
    fn hull_entry(&self, scene: &PhotoScene<Self>, view: u32, entries: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.hull_entry(&on_cpu(scene), view, entries)?;
        self.spoil(Kernel::HullEntry, entries);
        Ok(())
    }

    fn match_cost(
        &self,
        scene: &PhotoScene<Self>,
        sweep: &SweepBlock,
        entries: &Vec<f32>,
        pair_weights: &Vec<f32>,
        costs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.match_cost(&on_cpu(scene), sweep, entries, pair_weights, costs)?;
        self.spoil(Kernel::MatchCost, costs);
        Ok(())
    }

    fn sum_row(&self, sweep: &SweepBlock, costs: &Vec<f32>, row_sums: &mut Vec<[f32; 2]>) -> Result<(), Infallible> {
        Cpu.sum_row(sweep, costs, row_sums)?;
        self.spoil(Kernel::SumRow, row_sums.as_flattened_mut());
        Ok(())
    }

    fn mean_column(
        &self,
        sweep: &SweepBlock,
        costs: &Vec<f32>,
        row_sums: &Vec<[f32; 2]>,
        means: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.mean_column(sweep, costs, row_sums, means)?;
        self.spoil(Kernel::MeanColumn, means);
        Ok(())
    }

    fn pick_depth(
        &self,
        scene: &PhotoScene<Self>,
        sweep: &SweepBlock,
        means: &Vec<f32>,
        entries: &Vec<f32>,
        guess: &Vec<f32>,
        rows: Range<u32>,
        picked: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.pick_depth(&on_cpu(scene), sweep, means, entries, guess, rows, picked)?;
        self.spoil(Kernel::PickDepth, picked);
        Ok(())
    }

    fn march(
        &self,
        scene: &PhotoScene<Self>,
        depths: &Vec<f32>,
        weights: &Vec<f32>,
        target: &MarchBlock,
        first_row: u32,
        row_count: u32,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), Infallible> {
        with_pixels(pixels, |pixels| Cpu.march(&on_cpu(scene), depths, weights, target, first_row, row_count, pixels));
        self.spoil(Kernel::March, pixels.colours.as_flattened_mut());
        Ok(())
    }
}
