//! [`Kernel::Composite`]: rays from 1 to 128 samples with low, medium and high optical depths; some samples are empty.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::compositing_oracle::composite;
use crate::poses::{Random, numbers, random};
use viewfuse_core::composite::CompositeBlock;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Pixels};
use viewfuse_vulkan::kernel::Kernel;

/// A dispatch.
#[derive(Clone, Debug)]
pub struct Job {
    block: CompositeBlock,
    samples: Vec<[f32; 4]>,
    sample_depths: Vec<f32>,
}

/// A dispatch in a device's memory.
pub struct LoadedJob<D: Device> {
    samples: D::Buffer<[f32; 4]>,
    sample_depths: D::Buffer<f32>,
    pixels: Pixels<D>,
}

/// Samples on a ray, and the least and greatest optical depth of one.
const KINDS: [(u32, f64, f64); 5] =
    [(1, 0.1, 2.0), (2, 1.0e-3, 1.0), (17, 1.0, 1.0e3), (64, 1.0e-3, 0.3), (128, 1.0e-5, 1.0e-2)];

fn job(random: &mut Random, size: u32, (sample_count, low, high): (u32, f64, f64)) -> Job {
    let count = (size * sample_count) as usize;
    let sample = |random: &mut Random| {
        // A tenth is empty space, some of it with what rounding leaves below 0.
        let optical_depth = match random.below(20) {
            0 => 0.0,
            1 => -random.unit(),
            _ => random.log_range(low, high),
        };
        [random.unit(), random.unit(), random.unit(), optical_depth].map(|value| value as f32)
    };
    let first = numbers(size as usize, || random.range(1.0, 2.0));
    let depth = |index: usize| {
        first[index / sample_count as usize] + (index as u32 % sample_count) as f32 / sample_count as f32
    };
    Job {
        block: CompositeBlock { background: [1.0, 0.5, 0.25], empty_depth: 7.0, sample_count },
        sample_depths: (0..count).map(depth).collect(),
        samples: (0..count).map(|_| sample(random)).collect(),
    }
}

/// See the module.
pub enum Composite {}

impl Case for Composite {
    const KERNEL: Kernel = Kernel::Composite;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "roundings of the optical depth times the transmittance, 2 ULP of the exponential, each as \
        far as what is seen changes there; depths as 1 / opacity";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("samples", |jobs| jobs.iter_mut().for_each(|job| job.samples[0] = job.samples[0].map(|value| value * 1.01))),
        ("sample_depths", |jobs| jobs.iter_mut().for_each(|job| job.sample_depths[0] *= 1.01)),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.background[1] *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let random = &mut random(4, seed, size);
        KINDS.map(|kind| job(random, size, kind)).to_vec()
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(|job| job.samples.len() / job.block.sample_count as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            let ray_count = job.samples.len() / job.block.sample_count as usize;
            Ok(LoadedJob {
                samples: device.upload(&job.samples)?,
                sample_depths: device.upload(&job.sample_depths)?,
                pixels: Pixels { colours: device.zeros(ray_count)?, depths: device.zeros(ray_count)? },
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedJob { samples, sample_depths, pixels })| {
            let ray_count = job.samples.len() as u32 / job.block.sample_count;
            let Pixels { colours, depths } = pixels;
            device.composite(&job.block, ray_count, samples, sample_depths, colours, depths)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut values = Vec::new();
        for LoadedJob { pixels, .. } in loaded {
            values.extend(device.download(&pixels.colours)?.into_flattened());
            values.extend(device.download(&pixels.depths)?);
        }
        Ok(values)
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let mut expected = Vec::new();
        for Job { block, samples, sample_depths } in jobs {
            let count = block.sample_count as usize;
            let pixels = map(samples.len() / count, 16, |ray| {
                let own = ray * count..(ray + 1) * count;
                composite(&samples[own.clone()], &sample_depths[own], block)
            });
            expected.extend(pixels.iter().flat_map(|[red, green, blue, opacity, _]| [*red, *green, *blue, *opacity]));
            expected.extend(pixels.iter().map(|pixel| pixel[4]));
        }
        expected
    }
}
