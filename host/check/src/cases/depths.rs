//! [`Kernel::CoarseDepths`] and [`Kernel::RandomDraws`]: functions of seeds, pixels and rays only.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::random;
use crate::ray_oracle;
use crate::sights::{load_rays, pixels, ray};
use viewfuse_core::depths::{CoarseBlock, FineBlock};
use viewfuse_core::rays::TargetRay;
use viewfuse_device::DeviceError;
use viewfuse_device::{Device, Rays};
use viewfuse_vulkan::kernel::Kernel;

/// Rays, and the sampling along them.
#[derive(Clone, Debug)]
pub struct Job<B> {
    block: B,
    pixels: Vec<u32>,
    rays: Vec<TargetRay>,
}

impl<B> Job<B> {
    fn spoil_pixels(&mut self) {
        self.pixels.iter_mut().for_each(|pixel| *pixel = *pixel * 101 / 100);
    }
}

/// See the module.
pub enum CoarseDepths {}

impl Case for CoarseDepths {
    const KERNEL: Kernel = Kernel::CoarseDepths;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a share of the interval: five roundings and a division, then its product and sum";
    const SPOILERS: &'static [Spoiler<Vec<Job<CoarseBlock>>>] = &[
        ("rays", |jobs| jobs.iter_mut().for_each(|job| job.rays.iter_mut().for_each(|ray| ray.far *= 1.01))),
        ("pixels", |jobs| jobs.iter_mut().for_each(Job::spoil_pixels)),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.jitter *= 1.01)),
    ];

    type Inputs = Vec<Job<CoarseBlock>>;
    type Loaded<D: Device> = Vec<(Rays<D>, D::Buffer<f32>)>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(7, seed, size);
        let job = |(sample_count, jitter): (u32, f32)| {
            let count = size.div_ceil(sample_count);
            let seed = [random.below(1 << 32) as u32, random.below(1 << 32) as u32];
            let block = CoarseBlock { seed, sample_count, jitter };
            Job { block, pixels: pixels(random, count), rays: (0..count).map(|_| ray(random)).collect() }
        };
        [(1, 1.0), (7, 0.5), (64, 1.0), (64, 0.0)].map(job).to_vec()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|job| job.rays.len() * job.block.sample_count as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job<CoarseBlock>| {
            let depths = device.zeros(job.rays.len() * job.block.sample_count as usize)?;
            Ok((load_rays(device, &job.pixels, &job.rays)?, depths))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (Rays { count, pixels, rays }, depths))| {
            device.coarse_depths(&job.block, *count, rays, pixels, depths)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let depths: Vec<Vec<f32>> =
            loaded.iter().map(|(_, depths)| device.download(depths)).collect::<Result<_, _>>()?;
        Ok(depths.concat())
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let mut expected = Vec::new();
        for Job { block, pixels, rays } in jobs {
            for (ray, pixel) in rays.iter().zip(pixels) {
                let depth = |sample| Some(ray_oracle::coarse_depth(ray, *pixel, sample, block));
                expected.extend((0..block.sample_count).map(depth));
            }
        }
        expected
    }
}

/// See the module.
pub enum RandomDraws {}

impl Case for RandomDraws {
    const KERNEL: Kernel = Kernel::RandomDraws;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "an addition and a division; for normal numbers 2 ULP of the logarithm, 4.5 ULP of the root, \
        9e-8 of the cosine, two roundings of its argument of up to a turn";
    const SPOILERS: &'static [Spoiler<Vec<Job<FineBlock>>>] =
        &[("pixels", |jobs| jobs.iter_mut().for_each(Job::spoil_pixels))];

    type Inputs = Vec<Job<FineBlock>>;
    type Loaded<D: Device> = Vec<(Rays<D>, D::Buffer<[f32; 2]>)>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(8, seed, size);
        let job = |(coarse_count, importance_count, depth_count): (u32, u32, u32)| {
            let count = size.div_ceil(importance_count + depth_count);
            let seed = [random.below(1 << 32) as u32, random.below(1 << 32) as u32];
            let block = FineBlock { seed, coarse_count, importance_count, depth_count, ..FineBlock::default() };
            Job { block, pixels: pixels(random, count), rays: vec![TargetRay::default(); count as usize] }
        };
        [(64, 16, 16), (64, 0, 3), (1, 1, 0), (17, 128, 5)].map(job).to_vec()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|job| job.rays.len() * job.block.fine_count() as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job<FineBlock>| {
            let draws = device.zeros(job.rays.len() * job.block.fine_count() as usize)?;
            Ok((load_rays(device, &job.pixels, &job.rays)?, draws))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (Rays { count, pixels, .. }, draws))| {
            device.random_draws(&job.block, *count, pixels, draws)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = Vec::new();
        for (_, draws) in loaded {
            values.extend(device.download(draws)?.into_flattened());
        }
        Ok(values)
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let draws = |job: &Job<FineBlock>| {
            let block = job.block;
            let indices =
                job.pixels.iter().flat_map(move |pixel| (0..block.fine_count()).map(move |index| (*pixel, index)));
            indices
                .flat_map(move |(pixel, index)| ray_oracle::random_draw(pixel, index, &block))
                .map(Some)
                .collect::<Vec<_>>()
        };
        jobs.iter().flat_map(draws).collect()
    }
}
