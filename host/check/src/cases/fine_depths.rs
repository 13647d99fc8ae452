//! [`Kernel::FineDepths`] and [`Kernel::MergeDepths`]: empty rays, low optical depths, an opaque surface, a few thin
//! surfaces.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{Random, numbers, random};
use crate::ray_oracle;
use crate::sights::{load_rays, ray};
use viewfuse_core::depths::FineBlock;
use viewfuse_core::rays::TargetRay;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Pixels, Rays};
use viewfuse_vulkan::kernel::Kernel;

/// A dispatch: a first pass and random numbers.
#[derive(Clone, Debug)]
pub struct Job {
    block: FineBlock,
    rays: Vec<TargetRay>,
    /// `[ray][part]`.
    seen: Vec<[f32; 2]>,
    /// `[ray]`: opacity and depth.
    pixels: Vec<[f32; 2]>,
    /// `[ray][sample]`.
    draws: Vec<[f32; 2]>,
}

/// The same in a device's memory, and the depths.
pub struct LoadedJob<D: Device> {
    rays: Rays<D>,
    seen: D::Buffer<[f32; 2]>,
    pixels: Pixels<D>,
    draws: D::Buffer<[f32; 2]>,
    depths: D::Buffer<f32>,
}

/// Weights and transmittances of a ray's parts.
pub(super) fn seen(random: &mut Random, part_count: u32) -> Vec<[f32; 2]> {
    let kind = random.below(5);
    let wall = random.below(part_count as usize);
    let mut transmittance = 1.0_f32;
    (0..part_count as usize)
        .map(|part| {
            let stopped = match kind {
                0 => 0.0,
                1 => f64::from(u8::from(part == wall)),
                2 => random.log_range(1.0e-6, 0.3),
                3 => random.unit() * f64::from(u8::from(random.below(8) == 0)),
                _ => random.unit() * f64::from(u8::from(part >= wall)),
            };
            let weight = transmittance * stopped as f32;
            let before = transmittance;
            transmittance -= weight;
            [weight, before]
        })
        .collect()
}

fn job(random: &mut Random, size: u32, index: usize, counts: [u32; 3]) -> Job {
    let [coarse_count, importance_count, depth_count] = counts;
    let block = FineBlock {
        coarse_count,
        importance_count,
        depth_count,
        depth_deviation: 0.05,
        depth_times_opacity: index as u32 % 2,
        ..FineBlock::default()
    };
    let fine_count = block.fine_count();
    let rays: Vec<TargetRay> = (0..size.div_ceil(fine_count)).map(|_| ray(random)).collect();
    let pixel = |random: &mut Random, ray: &TargetRay| {
        // Some rays are empty, with any depth.
        let depth = random.range(f64::from(ray.near), f64::from(ray.far)) as f32;
        if random.below(6) == 0 { [0.0, -7.0] } else { [random.unit() as f32, depth] }
    };
    let draw = |random: &mut Random, sample: u32| {
        if sample >= importance_count {
            return [random.normal() as f32, 0.0];
        }
        let first = [0.0, 1.0, random.unit(), random.unit(), random.unit()][random.below(5)];
        [first as f32, random.unit() as f32]
    };
    Job {
        block,
        seen: rays.iter().flat_map(|_| seen(random, coarse_count)).collect(),
        pixels: rays.iter().map(|ray| pixel(random, ray)).collect(),
        draws: rays.iter().flat_map(|_| 0..fine_count).map(|sample| draw(random, sample)).collect(),
        rays,
    }
}

/// See the module.
pub enum FineDepths {}

impl Case for FineDepths {
    const KERNEL: Kernel = Kernel::FineDepths;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a place in a part: a division, a product, two sums; undecided where the random number \
        hits the border of a part to within the sums of weights";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("seen", |jobs| {
            jobs.iter_mut().for_each(|job| job.seen.iter_mut().step_by(2).for_each(|[weight, _]| *weight *= 1.01));
        }),
        ("rays", |jobs| jobs.iter_mut().for_each(|job| job.rays.iter_mut().for_each(|ray| ray.far *= 1.01))),
        ("colours", |jobs| jobs.iter_mut().for_each(|job| job.pixels.iter_mut().for_each(|pixel| pixel[0] *= 1.01))),
        ("pixel_depths", |jobs| {
            jobs.iter_mut().for_each(|job| job.pixels.iter_mut().for_each(|pixel| pixel[1] *= 1.01))
        }),
        ("draws", |jobs| jobs.iter_mut().for_each(|job| job.draws.iter_mut().for_each(|draw| draw[0] *= 1.01))),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.depth_deviation *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let random = &mut random(9, seed, size);
        let counts = [[64, 16, 16], [1, 2, 1], [17, 5, 0], [64, 0, 7]];
        counts.into_iter().enumerate().map(|(index, counts)| job(random, size, index, counts)).collect()
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(|job| job.draws.len()).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            let colours: Vec<[f32; 4]> = job.pixels.iter().map(|[opacity, _]| [0.3, 0.6, 0.9, *opacity]).collect();
            let depths: Vec<f32> = job.pixels.iter().map(|[_, depth]| *depth).collect();
            Ok(LoadedJob {
                rays: load_rays(device, &vec![0; job.rays.len()], &job.rays)?,
                seen: device.upload(&job.seen)?,
                pixels: Pixels { colours: device.upload(&colours)?, depths: device.upload(&depths)? },
                draws: device.upload(&job.draws)?,
                depths: device.zeros(job.draws.len())?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedJob { rays, seen, pixels, draws, depths })| {
            let Pixels { colours, depths: pixel_depths } = pixels;
            device.fine_depths(&job.block, rays.count, seen, &rays.rays, colours, pixel_depths, draws, depths)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let depths: Vec<Vec<f32>> = loaded.iter().map(|job| device.download(&job.depths)).collect::<Result<_, _>>()?;
        Ok(depths.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let mut expected = Vec::new();
        for Job { block, rays, seen, pixels, draws } in jobs {
            let fine_count = block.fine_count() as usize;
            let depth = |(index, draw): (usize, &[f32; 2])| {
                let (ray, sample) = (index / fine_count, index % fine_count);
                let seen = &seen[ray * block.coarse_count as usize..][..block.coarse_count as usize];
                let [opacity, depth] = pixels[ray];
                ray_oracle::fine_depth(seen, &rays[ray], [depth, opacity], *draw, sample as u32, block)
            };
            expected.extend(map(draws.len(), 16, |index| depth((index, &draws[index]))));
        }
        expected
    }
}

/// Depths of two passes.
#[derive(Clone, Debug)]
pub struct Passes {
    block: FineBlock,
    coarse: Vec<f32>,
    fine: Vec<f32>,
}

impl Passes {
    fn ray_count(&self) -> usize {
        self.coarse.len() / self.block.coarse_count as usize
    }
}

/// See the module.
pub enum MergeDepths {}

impl Case for MergeDepths {
    const KERNEL: Kernel = Kernel::MergeDepths;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 0.0, least: 1.0e-2 };
    const REASON: &'static str = "the same numbers in order: exact";
    const SPOILERS: &'static [Spoiler<Vec<Passes>>] = &[
        ("coarse", |jobs| jobs.iter_mut().for_each(|job| job.coarse[0] *= 1.01)),
        ("fine", |jobs| jobs.iter_mut().for_each(|job| job.fine[0] *= 1.01)),
    ];

    type Inputs = Vec<Passes>;
    type Loaded<D: Device> = Vec<(D::Buffer<f32>, D::Buffer<f32>, D::Buffer<f32>)>;

    fn inputs(seed: u64, size: u32) -> Vec<Passes> {
        let random = &mut random(10, seed, size);
        let job = |[coarse_count, importance_count, depth_count]: [u32; 3]| {
            let block = FineBlock { coarse_count, importance_count, depth_count, ..FineBlock::default() };
            let ray_count = size.div_ceil(coarse_count + block.fine_count()) as usize;
            // Half of them on a lattice, so that many are equal, within a pass and between the two.
            let mut depth = || {
                let depth = random.range(1.0, 3.0);
                if random.below(2) == 0 { (depth * 16.0).round() / 16.0 } else { depth }
            };
            Passes {
                block,
                coarse: numbers(ray_count * coarse_count as usize, &mut depth),
                fine: numbers(ray_count * block.fine_count() as usize, &mut depth),
            }
        };
        [[64, 16, 16], [1, 1, 0], [3, 0, 5], [128, 2, 0]].map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Passes>) -> usize {
        jobs.iter().map(|job| job.coarse.len() + job.fine.len()).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Passes>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Passes| {
            let merged = device.zeros(job.coarse.len() + job.fine.len())?;
            Ok((device.upload(&job.coarse)?, device.upload(&job.fine)?, merged))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Passes>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (coarse, fine, merged))| {
            device.merge_depths(&job.block, job.ray_count() as u32, coarse, fine, merged)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let merged: Vec<Vec<f32>> =
            loaded.iter().map(|(.., merged)| device.download(merged)).collect::<Result<_, _>>()?;
        Ok(merged.concat())
    }

    fn expected(jobs: &Vec<Passes>) -> Vec<Option<Bounded>> {
        let merged = |job: &Passes| {
            let coarse = job.coarse.chunks_exact(job.block.coarse_count as usize);
            let fine = job.fine.chunks_exact(job.block.fine_count() as usize);
            let rays = coarse.zip(fine).flat_map(|(coarse, fine)| ray_oracle::merge_depths(coarse, fine));
            rays.map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(merged).collect()
    }
}
