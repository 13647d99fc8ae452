//! [`Kernel::WeighSamples`] and [`Kernel::SampleMask`]: empty rays, and rays with low, medium and high optical depths;
//! masks by the weights of the ray itself and of the rays around it.

use super::fine_depths::seen;
use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{Random, random};
use crate::ray_oracle;
use crate::sights::{load_rays, ray};
use viewfuse_core::rays::TargetRay;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Rays};
use viewfuse_kernels::sample_mask::{RaysBlock, SampleMaskBlock};
use viewfuse_vulkan::kernel::Kernel;

/// Rays of equally many samples.
#[derive(Clone, Debug)]
pub struct Samples {
    sample_count: u32,
    ray_count: u32,
    samples: Vec<[f32; 4]>,
}

/// Samples on a ray, and the least and greatest optical depth of one.
const KINDS: [(u32, f64, f64); 5] =
    [(1, 0.1, 2.0), (2, 1.0e-3, 1.0), (17, 1.0, 1.0e3), (64, 1.0e-3, 0.3), (128, 1.0e-5, 1.0e-2)];

/// Rays in front of the results.
const FIRST_RAY: usize = 2;

fn block(job: &Samples) -> RaysBlock {
    RaysBlock { sample_count: job.sample_count, first_ray: FIRST_RAY as u32 }
}

/// See the module.
pub enum WeighSamples {}

impl Case for WeighSamples {
    const KERNEL: Kernel = Kernel::WeighSamples;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "roundings of the optical depth times the transmittance, 2 ULP of the exponential, on both \
        sides of a sample";
    const SPOILERS: &'static [Spoiler<Vec<Samples>>] = &[("samples", |jobs| {
        jobs.iter_mut().for_each(|job| job.samples.iter_mut().for_each(|sample| sample[3] *= 1.01))
    })];

    type Inputs = Vec<Samples>;
    type Loaded<D: Device> = Vec<(D::Buffer<[f32; 4]>, D::Buffer<[f32; 2]>)>;

    fn inputs(seed: u64, size: u32) -> Vec<Samples> {
        let random = &mut random(11, seed, size);
        let job = |(sample_count, low, high): (u32, f64, f64)| {
            let optical_depth = |random: &mut Random| match random.below(20) {
                0 => 0.0,
                1 => -random.unit(),
                _ => random.log_range(low, high),
            };
            // Some rays meet nothing at all.
            let ray = |random: &mut Random| {
                let is_empty = random.below(8) == 0;
                let sample = |random: &mut Random| if is_empty { 0.0 } else { optical_depth(random) };
                (0..sample_count).map(|_| [0.1, 0.2, 0.3, sample(random) as f32]).collect::<Vec<_>>()
            };
            let ray_count = size.div_ceil(4);
            Samples { sample_count, ray_count, samples: (0..ray_count).flat_map(|_| ray(random)).collect() }
        };
        KINDS.map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Samples>) -> usize {
        jobs.iter().map(|job| job.ray_count as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Samples>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Samples| {
            Ok((device.upload(&job.samples)?, device.zeros(job.samples.len() + FIRST_RAY * job.sample_count as usize)?))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Samples>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter()
            .zip(loaded)
            .try_for_each(|(job, (samples, seen))| device.weigh_samples(&block(job), job.ray_count, samples, seen))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = Vec::new();
        for (_, seen) in loaded {
            values.extend(device.download(seen)?.into_flattened());
        }
        Ok(values)
    }

    fn expected(jobs: &Vec<Samples>) -> Vec<Option<Bounded>> {
        let rays = |job: &Samples| {
            let rays = job.samples.chunks_exact(job.sample_count as usize).flat_map(ray_oracle::weigh_samples);
            let before = vec![Bounded::ZERO; 2 * FIRST_RAY * job.sample_count as usize];
            before.into_iter().chain(rays.flatten()).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(rays).collect()
    }
}

/// Rays with samples, and the weights of a first pass.
#[derive(Clone, Debug)]
pub struct Looks {
    block: SampleMaskBlock,
    pixels: Vec<u32>,
    rays: Vec<TargetRay>,
    depths: Vec<f32>,
    seen: Vec<[f32; 2]>,
}

/// The same in a device's memory, and the mask.
pub struct LoadedLooks<D: Device> {
    rays: Rays<D>,
    depths: D::Buffer<f32>,
    seen: D::Buffer<[f32; 2]>,
    mask: D::Buffer<u32>,
}

fn looks(random: &mut Random, size: u32, (step, sample_count, part_count): (u32, u32, u32)) -> Looks {
    let ray_count = size.div_ceil(sample_count);
    let (width, height) = (9 + random.below(20) as u32, 9 + random.below(20) as u32);
    let nodes = |side: u32| if step == 0 { 0 } else { side.div_ceil(step) };
    let block = SampleMaskBlock {
        sample_count,
        part_count,
        least_share: random.log_range(1.0e-3, 0.5) as f32,
        termination: [-1.0, 0.0, random.log_range(1.0e-3, 0.5)][random.below(3)] as f32,
        least_opacity: [0.0, random.range(0.0, 0.5)][random.below(2)] as f32,
        step,
        seen_columns: nodes(width),
        seen_rows: nodes(height),
        width,
    };
    let rays: Vec<TargetRay> =
        (0..ray_count).map(|_| ray(random)).map(|ray| TargetRay { far: ray.far + 0.1, ..ray }).collect();
    let seen_count = if step == 0 { ray_count } else { block.seen_columns * block.seen_rows };
    let depth = |random: &mut Random, ray: &TargetRay| match random.below(20) {
        0 => ray.near,
        1 => ray.far,
        _ => random.range(f64::from(ray.near), f64::from(ray.far)) as f32,
    };
    Looks {
        block,
        pixels: rays.iter().map(|_| random.below((width * height) as usize) as u32).collect(),
        depths: rays.iter().flat_map(|ray| vec![*ray; sample_count as usize]).map(|ray| depth(random, &ray)).collect(),
        seen: (0..seen_count).flat_map(|_| seen(random, part_count)).collect(),
        rays,
    }
}

/// See the module.
pub enum SampleMask {}

impl Case for SampleMask {
    const KERNEL: Kernel = Kernel::SampleMask;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 0.0, least: 0.5 };
    const REASON: &'static str = "yes or no, undecided where a sample lies on the border of a part or a share on its \
        threshold to within rounding";
    const SPOILERS: &'static [Spoiler<Vec<Looks>>] = &[
        ("seen", |jobs| jobs.iter_mut().for_each(|job| job.seen.iter_mut().for_each(|[weight, _]| *weight *= 1.01))),
        ("rays", |jobs| jobs.iter_mut().for_each(|job| job.rays.iter_mut().for_each(|ray| ray.far *= 1.01))),
        ("pixels", |jobs| {
            jobs.iter_mut().for_each(|job| job.pixels.iter_mut().for_each(|pixel| *pixel = *pixel * 99 / 100))
        }),
        ("depths", |jobs| jobs.iter_mut().for_each(|job| job.depths.iter_mut().for_each(|depth| *depth *= 1.01))),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.least_share *= 1.01)),
    ];

    type Inputs = Vec<Looks>;
    type Loaded<D: Device> = Vec<LoadedLooks<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Looks> {
        let random = &mut random(12, seed, size);
        let kinds =
            [(0, 96, 64), (0, 1, 1), (2, 32, 64), (3, 5, 17), (4, 64, 2), (0, 96, 64), (2, 32, 64), (4, 96, 64)];
        kinds.map(|kind| looks(random, 4 * size, kind)).to_vec()
    }

    fn element_count(jobs: &Vec<Looks>) -> usize {
        jobs.iter().map(|job| job.depths.len()).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Looks>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Looks| {
            Ok(LoadedLooks {
                rays: load_rays(device, &job.pixels, &job.rays)?,
                depths: device.upload(&job.depths)?,
                seen: device.upload(&job.seen)?,
                mask: device.zeros(job.depths.len())?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Looks>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedLooks { rays, depths, seen, mask })| {
            device.sample_mask(&job.block, rays.count, seen, &rays.rays, &rays.pixels, depths, mask)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = Vec::new();
        for LoadedLooks { mask, .. } in loaded {
            values.extend(device.download(mask)?.into_iter().map(|mask| mask as f32));
        }
        Ok(values)
    }

    fn expected(jobs: &Vec<Looks>) -> Vec<Option<Bounded>> {
        let mut expected = Vec::new();
        for Looks { block, pixels, rays, depths, seen } in jobs {
            let mask = |(index, depth): (usize, &f32)| {
                let ray = index / block.sample_count as usize;
                let mask = ray_oracle::is_sampled(seen, &rays[ray], *depth, ray as u32, pixels[ray], block);
                mask.map(|mask| Bounded::from(u32::from(mask)))
            };
            expected.extend(map(depths.len(), 64, |index| mask((index, &depths[index]))));
        }
        expected
    }
}
