//! [`Kernel::WeighFeatures`], [`Kernel::SumFeatures`] and [`Kernel::DenoiserInput`]: rays from 1 to 128 samples with
//! low, medium and high optical depths, inclusive and exclusive weights; their features; pictures with conditions.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{Random, numbers, random};
use crate::volume_oracle;
use viewfuse_core::rays::RayPoint;
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Memory};
use viewfuse_kernels::genvs::{DenoiserInputBlock, FeatureBlock};
use viewfuse_vulkan::kernel::Kernel;

type Buffer<D, T> = <D as Memory>::Buffer<T>;

/// Samples on a ray, features, length of the last sample, and the least and greatest optical depth of the others.
const KINDS: [(u32, u32, f32, f64, f64); 5] = [
    (1, 3, 0.5, 0.1, 2.0),
    (2, 1, 1.0e10, 1.0e-3, 1.0),
    (17, 16, 1.0e10, 1.0, 1.0e3),
    (64, 2, 0.01, 1.0e-3, 0.3),
    (128, 5, 1.0e10, 1.0e-5, 1.0e-2),
];

fn block(
    random: &mut Random,
    (sample_count, feature_count, last_length, ..): (u32, u32, f32, f64, f64),
) -> FeatureBlock {
    FeatureBlock {
        first_ray: 0,
        sample_count,
        feature_count,
        length_scale: random.range(0.3, 1.0) as f32,
        last_length,
        inclusive: random.below(2) as u32,
    }
}

/// A network's outputs at points on rays.
#[derive(Clone, Debug)]
pub struct Weighed {
    block: FeatureBlock,
    raw: Vec<f32>,
    points: Vec<RayPoint>,
}

impl Weighed {
    fn ray_count(&self) -> u32 {
        self.points.len() as u32 / self.block.sample_count
    }
}

/// See the module.
pub enum WeighFeatures {}

impl Case for WeighFeatures {
    const KERNEL: Kernel = Kernel::WeighFeatures;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "roundings of the optical depth times the transmittance, 2 ULP of two exponentials, a \
        difference";
    const SPOILERS: &'static [Spoiler<Vec<Weighed>>] = &[
        ("raw", |jobs| jobs.iter_mut().flat_map(|job| &mut job.raw).for_each(|raw| *raw *= 1.01)),
        ("points", |jobs| jobs.iter_mut().flat_map(|job| &mut job.points).for_each(|point| point.length *= 1.01)),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.length_scale *= 1.01)),
    ];

    type Inputs = Vec<Weighed>;
    type Loaded<D: Device> = Vec<(Buffer<D, f32>, Buffer<D, RayPoint>, Buffer<D, f32>)>;

    fn inputs(seed: u64, size: u32) -> Vec<Weighed> {
        let random = &mut random(34, seed, size);
        let job = |kind: (u32, u32, f32, f64, f64)| {
            let block = block(random, kind);
            let (.., low, high) = kind;
            let (mut raw, mut points) = (Vec::new(), Vec::new());
            for _ in 0..size * block.sample_count {
                let length = random.log_range(1.0e-3, 0.1);
                // A tenth is empty, most of it with a density below 0.
                let density = match random.below(20) {
                    0 => 0.0,
                    1 => -random.unit(),
                    _ => random.log_range(low, high) / length,
                };
                raw.push(density as f32);
                raw.extend(numbers(block.feature_count as usize, || random.normal()));
                points.push(RayPoint { length: length as f32, ..RayPoint::default() });
            }
            Weighed { block, raw, points }
        };
        KINDS.map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Weighed>) -> usize {
        jobs.iter().map(|job| job.ray_count() as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Weighed>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Weighed| {
            Ok((device.upload(&job.raw)?, device.upload(&job.points)?, device.zeros(job.points.len() + 1)?))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Weighed>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (raw, points, weights))| {
            device.weigh_features(&job.block, job.ray_count(), raw, points, weights)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let weights: Vec<Vec<f32>> =
            loaded.iter().map(|(.., weights)| device.download(weights)).collect::<Result<_, _>>()?;
        Ok(weights.concat())
    }

    fn expected(jobs: &Vec<Weighed>) -> Vec<Option<Bounded>> {
        let weights = |Weighed { block, raw, points }: &Weighed| {
            let samples = block.sample_count as usize;
            let row_len = samples * (block.feature_count as usize + 1);
            let weights = map(points.len() / samples, 1, |ray| {
                let (raw, points) = (&raw[ray * row_len..][..row_len], &points[ray * samples..][..samples]);
                volume_oracle::weigh_features(raw, points, block)
            });
            weights.into_iter().flatten().chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(weights).collect()
    }
}

/// Features of samples.
#[derive(Clone, Debug)]
pub struct Summed {
    block: FeatureBlock,
    weights: Vec<f32>,
    fused: Vec<f32>,
    raw: Vec<f32>,
}

impl Summed {
    fn ray_count(&self) -> u32 {
        self.weights.len() as u32 / self.block.sample_count
    }

    fn len(&self) -> usize {
        (self.ray_count() * self.block.feature_count) as usize
    }

    /// Offset of the sums.
    fn first(&self) -> usize {
        (self.block.first_ray * self.block.feature_count) as usize
    }
}

/// See the module.
pub enum SumFeatures {}

impl Case for SumFeatures {
    const KERNEL: Kernel = Kernel::SumFeatures;
    const SEED_COUNT: u64 = 8;
    // A floor of variances and a length are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0e-5, least: 1.0e-2 };
    const REASON: &'static str =
        "n + 2 units (2^-24) of the sum of magnitudes of n summands, each a product with a sum of two";
    const SPOILERS: &'static [Spoiler<Vec<Summed>>] = &[
        ("weights", |jobs| jobs.iter_mut().flat_map(|job| &mut job.weights).for_each(|weight| *weight *= 1.01)),
        ("fused", |jobs| jobs.iter_mut().flat_map(|job| &mut job.fused).for_each(|value| *value *= 1.01)),
        ("raw", |jobs| jobs.iter_mut().flat_map(|job| &mut job.raw).for_each(|value| *value *= 1.01)),
    ];

    type Inputs = Vec<Summed>;
    type Loaded<D: Device> = Vec<[Buffer<D, f32>; 4]>;

    fn inputs(seed: u64, size: u32) -> Vec<Summed> {
        let random = &mut random(31, seed, size);
        let job = |kind| {
            let block = FeatureBlock { first_ray: 3, ..block(random, kind) };
            let [samples, features] = [block.sample_count, block.feature_count].map(|count| count as usize);
            let count = (size.div_ceil(block.feature_count)) as usize * samples;
            // They sum to less than 1.
            let weights = numbers(count, || random.unit() / samples as f64);
            let fused = numbers(count * features, || random.normal());
            let raw = numbers(count * (features + 1), || random.normal());
            Summed { block, weights, fused, raw }
        };
        KINDS.map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Summed>) -> usize {
        jobs.iter().map(Summed::len).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Summed>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Summed| {
            let [weights, fused, raw] = [&job.weights, &job.fused, &job.raw].map(|values| device.upload(values));
            Ok([weights?, fused?, raw?, device.zeros(job.first() + job.len() + 1)?])
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Summed>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, [weights, fused, raw, summed])| {
            device.sum_features(&job.block, job.ray_count(), weights, fused, raw, summed)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let summed: Vec<Vec<f32>> =
            loaded.iter().map(|[.., summed]| device.download(summed)).collect::<Result<_, _>>()?;
        Ok(summed.concat())
    }

    fn expected(jobs: &Vec<Summed>) -> Vec<Option<Bounded>> {
        let summed = |job: &Summed| {
            let Summed { block, weights, fused, raw } = job;
            let [samples, features] = [block.sample_count, block.feature_count].map(|count| count as usize);
            let own = |index: usize| {
                let (ray, feature) = (index / features, index % features);
                // The ray's rows of so many numbers a sample.
                let part = |row: usize| ray * samples * row..(ray + 1) * samples * row;
                let (weights, fused) = (&weights[part(1)], &fused[part(features)]);
                volume_oracle::summed_feature(weights, fused, &raw[part(features + 1)], block, feature)
            };
            let before = vec![Bounded::ZERO; job.first()];
            let summed = map(job.len(), 16, own);
            before.into_iter().chain(summed).chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(summed).collect()
    }
}

/// A picture and its condition.
#[derive(Clone, Debug)]
pub struct Pictures {
    block: DenoiserInputBlock,
    pixel_count: u32,
    noisy: Vec<f32>,
    condition: Vec<f32>,
}

impl Pictures {
    fn len(&self) -> usize {
        (self.pixel_count * (self.block.picture_channels + self.block.condition_channels)) as usize
    }
}

/// See the module.
pub enum DenoiserInput {}

impl Case for DenoiserInput {
    const KERNEL: Kernel = Kernel::DenoiserInput;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 1.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "one product";
    const SPOILERS: &'static [Spoiler<Vec<Pictures>>] = &[
        ("noisy", |jobs| jobs.iter_mut().flat_map(|job| &mut job.noisy).for_each(|value| *value *= 1.01)),
        ("condition", |jobs| jobs.iter_mut().flat_map(|job| &mut job.condition).for_each(|value| *value *= 1.01)),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.scale *= 1.01)),
    ];

    type Inputs = Vec<Pictures>;
    type Loaded<D: Device> = Vec<[Buffer<D, f32>; 3]>;

    fn inputs(seed: u64, size: u32) -> Vec<Pictures> {
        let random = &mut random(32, seed, size);
        let job = |[picture_channels, condition_channels]: [u32; 2]| {
            let pixel_count = size.div_ceil(picture_channels + condition_channels);
            let scale = random.log_range(1.0e-2, 2.0) as f32;
            // As noisy as pictures are at first.
            let noisy = numbers((pixel_count * picture_channels) as usize, || 80.0 * random.normal());
            let condition = numbers((pixel_count * condition_channels) as usize, || random.normal());
            let block = DenoiserInputBlock { picture_channels, condition_channels, scale };
            Pictures { block, pixel_count, noisy, condition }
        };
        [[3, 16], [1, 1], [4, 1], [3, 33]].map(job).to_vec()
    }

    fn element_count(jobs: &Vec<Pictures>) -> usize {
        jobs.iter().map(Pictures::len).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Pictures>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Pictures| {
            Ok([device.upload(&job.noisy)?, device.upload(&job.condition)?, device.zeros(job.len() + 1)?])
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Pictures>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, [noisy, condition, inputs])| {
            device.denoiser_input(&job.block, job.pixel_count, noisy, condition, inputs)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let inputs: Vec<Vec<f32>> =
            loaded.iter().map(|[.., inputs]| device.download(inputs)).collect::<Result<_, _>>()?;
        Ok(inputs.concat())
    }

    fn expected(jobs: &Vec<Pictures>) -> Vec<Option<Bounded>> {
        let inputs = |job: &Pictures| {
            let input = |element| volume_oracle::denoiser_input(&job.noisy, &job.condition, &job.block, element);
            (0..job.len()).map(input).chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(inputs).collect()
    }
}
