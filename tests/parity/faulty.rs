//! A device that computes on the CPU and gets one kernel wrong.

use std::convert::Infallible;
use std::ops::Range;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{
    Element, KernelTime, Layer, LightKernels, Memory, NetworkKernels, PhotoKernels, PhotoScene, Pixels, PointKernels,
    RayKernels, Rays, WeightingKernels,
};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::depths::{CoarseBlock, FineBlock};
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_core::pixelnerf::{EmbedBlock, GatherBlock};
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::rays::{CastBlock, RayPoint};
use viewfuse_core::wanted::WantedBlock;
use viewfuse_core::weighting::WeighBlock;
use viewfuse_vulkan::kernel::Kernel;

/// The CPU, with one kernel's results too large by 1e-3, or, if they are yes or no, some of them turned round.
pub(crate) struct Faulty {
    /// Which.
    pub(crate) kernel: Kernel,
}

impl Faulty {
    /// All results of a kernel, if it is the one.
    fn spoil<'a>(&self, kernel: Kernel, values: impl IntoIterator<Item = &'a mut f32>) {
        if kernel == self.kernel {
            values.into_iter().for_each(|value| *value *= 1.001);
        }
    }
}

/// The same rays for the CPU.
fn rays_on_cpu(rays: &Rays<Faulty>) -> Rays<Cpu> {
    Rays { count: rays.count, pixels: rays.pixels.clone(), rays: rays.rays.clone() }
}

/// The same layer for the CPU.
fn layer_on_cpu(layer: &Layer<Faulty>) -> Layer<Cpu> {
    Layer { weights: layer.weights.clone(), bias: layer.bias.clone() }
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

impl RayKernels for Faulty {
    fn cast_rays(&self, block: &CastBlock, rays: &mut Rays<Self>) -> Result<(), Infallible> {
        let mut on_cpu = rays_on_cpu(rays);
        Cpu.cast_rays(block, &mut on_cpu)?;
        rays.rays = on_cpu.rays;
        self.spoil(Kernel::CastRays, rays.rays.iter_mut().flat_map(|ray| &mut ray.direction));
        Ok(())
    }

    fn coarse_depths(&self, block: &CoarseBlock, rays: &Rays<Self>, depths: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.coarse_depths(block, &rays_on_cpu(rays), depths)?;
        self.spoil(Kernel::CoarseDepths, depths);
        Ok(())
    }

    fn draw_chances(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        chances: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        Cpu.draw_chances(block, &rays_on_cpu(rays), chances)?;
        self.spoil(Kernel::DrawChances, chances.as_flattened_mut());
        Ok(())
    }

    fn fine_depths(
        &self,
        block: &FineBlock,
        rays: &Rays<Self>,
        seen: &Vec<[f32; 2]>,
        pixels: &Pixels<Self>,
        chances: &Vec<[f32; 2]>,
        depths: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let pixels = Pixels::<Cpu> { colours: pixels.colours.clone(), depths: pixels.depths.clone() };
        Cpu.fine_depths(block, &rays_on_cpu(rays), seen, &pixels, chances, depths)?;
        self.spoil(Kernel::FineDepths, depths);
        Ok(())
    }

    fn merge_depths(
        &self,
        block: &FineBlock,
        ray_count: u32,
        coarse: &Vec<f32>,
        fine: &Vec<f32>,
        merged: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.merge_depths(block, ray_count, coarse, fine, merged)?;
        self.spoil(Kernel::MergeDepths, merged);
        Ok(())
    }

    fn wanted_samples(
        &self,
        block: &WantedBlock,
        rays: &Rays<Self>,
        depths: &Vec<f32>,
        seen: &Vec<[f32; 2]>,
        wanted: &mut Vec<u32>,
    ) -> Result<(), Infallible> {
        Cpu.wanted_samples(block, &rays_on_cpu(rays), depths, seen, wanted)?;
        // Yes or no: every third answer is the other one.
        if self.kernel == Kernel::WantedSamples {
            wanted.iter_mut().step_by(3).for_each(|wanted| *wanted = 1 - *wanted);
        }
        Ok(())
    }

    fn place_points(
        &self,
        sample_count: u32,
        point_count: u32,
        samples: &Vec<u32>,
        rays: &Rays<Self>,
        depths: &Vec<f32>,
        points: &mut Vec<RayPoint>,
    ) -> Result<(), Infallible> {
        Cpu.place_points(sample_count, point_count, samples, &rays_on_cpu(rays), depths, points)?;
        self.spoil(Kernel::PlacePoints, points.iter_mut().flat_map(|point| &mut point.position));
        Ok(())
    }

    fn weigh_samples(
        &self,
        sample_count: u32,
        ray_count: u32,
        samples: &Vec<[f32; 4]>,
        seen: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        Cpu.weigh_samples(sample_count, ray_count, samples, seen)?;
        self.spoil(Kernel::WeighSamples, seen.as_flattened_mut());
        Ok(())
    }
}

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
        self.spoil(Kernel::GatherLatents, gathered);
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

impl NetworkKernels for Faulty {
    fn convolve(
        &self,
        block: &ConvolveBlock,
        inputs: &Vec<f32>,
        layer: &Layer<Self>,
        addend: Option<&Vec<f32>>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.convolve(block, inputs, &layer_on_cpu(layer), addend, outputs)?;
        self.spoil(Kernel::Convolve, outputs);
        Ok(())
    }

    fn max_pool(&self, block: &PoolBlock, inputs: &Vec<f32>, outputs: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.max_pool(block, inputs, outputs)?;
        self.spoil(Kernel::MaxPool, outputs);
        Ok(())
    }

    fn upsample(&self, block: &UpsampleBlock, inputs: &Vec<f32>, outputs: &mut Vec<f32>) -> Result<(), Infallible> {
        Cpu.upsample(block, inputs, outputs)?;
        self.spoil(Kernel::Upsample, outputs);
        Ok(())
    }

    fn product(
        &self,
        block: &ProductBlock,
        inputs: &Vec<f32>,
        layer: &Layer<Self>,
        addend: Option<&Vec<f32>>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        Cpu.product(block, inputs, &layer_on_cpu(layer), addend, outputs)?;
        self.spoil(Kernel::Product, outputs);
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
