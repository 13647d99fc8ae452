//! [`Kernel::MixPictures`] and [`Kernel::AddNoise`]: every number of results; arrays with coefficient 0, which are not
//! read, have another length and hold NaN; noise of several streams on pictures of all sizes and on zeros.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{numbers, random};
use crate::ray_oracle;
use viewfuse_core::sampler::{MAX_RESULTS, Mix, NoiseBlock};
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_vulkan::kernel::Kernel;

/// A dispatch of `mix_pictures`.
#[derive(Clone, Debug)]
pub struct MixJob {
    mix: Mix,
    element_count: usize,
    state: Vec<f32>,
    results: [Vec<f32>; MAX_RESULTS],
}

/// See the module.
pub enum MixPictures {}

/// State, results, and the combination.
type LoadedMix<B> = (B, [B; MAX_RESULTS], B);

impl Case for MixPictures {
    const KERNEL: Kernel = Kernel::MixPictures;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a product and an addition an array, two roundings each";
    const SPOILERS: &'static [Spoiler<Vec<MixJob>>] = &[
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.mix.state *= 1.01)),
        ("state", |jobs| jobs.iter_mut().for_each(|job| spoil(&mut job.state))),
        ("newest", |jobs| jobs.iter_mut().for_each(|job| spoil(&mut job.results[0]))),
        ("second", |jobs| jobs.iter_mut().for_each(|job| spoil(&mut job.results[1]))),
        ("third", |jobs| jobs.iter_mut().for_each(|job| spoil(&mut job.results[2]))),
        ("fourth", |jobs| jobs.iter_mut().for_each(|job| spoil(&mut job.results[3]))),
    ];

    type Inputs = Vec<MixJob>;
    type Loaded<D: Device> = Vec<LoadedMix<D::Buffer<f32>>>;

    fn inputs(seed: u64, size: u32) -> Vec<MixJob> {
        let random = &mut random(29, seed, size);
        let count = size as usize;
        // Which of the arrays count: state first.
        let patterns =
            [[1, 1, 1, 1, 1], [1, 1, 1, 1, 0], [1, 1, 0, 0, 0], [0, 1, 1, 1, 1], [0, 0, 0, 0, 1], [1, 0, 1, 0, 1]];
        let job = |counts: [u32; 5]| {
            let [state, results @ ..] = counts.map(|counts| match counts {
                0 => (0.0, vec![f32::NAN; 1]),
                _ => (random.normal() as f32, numbers(count, || random.normal())),
            });
            let (state, values) = state;
            let mix = Mix { state, results: results.each_ref().map(|(coefficient, _)| *coefficient) };
            MixJob { mix, element_count: count, state: values, results: results.map(|(_, values)| values) }
        };
        patterns.into_iter().map(job).collect()
    }

    fn element_count(jobs: &Vec<MixJob>) -> usize {
        jobs.iter().map(|job| job.element_count).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<MixJob>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &MixJob| {
            let [a, b, c, d] = job.results.each_ref().map(|values| device.upload(values));
            Ok((device.upload(&job.state)?, [a?, b?, c?, d?], device.zeros(job.element_count)?))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<MixJob>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (state, results, mixed))| {
            let [newest, second, third, fourth] = results.each_ref();
            device.mix_pictures(&job.mix, job.element_count as u32, state, newest, second, third, fourth, mixed)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mixed: Vec<Vec<f32>> =
            loaded.iter().map(|(_, _, mixed)| device.download(mixed)).collect::<Result<_, _>>()?;
        Ok(mixed.concat())
    }

    fn expected(jobs: &Vec<MixJob>) -> Vec<Option<Bounded>> {
        let element = |job: &MixJob, element: usize| {
            let results = job.mix.results.iter().zip(&job.results);
            let terms = std::iter::once((&job.mix.state, &job.state)).chain(results);
            let terms = terms.filter(|(coefficient, _)| **coefficient != 0.0);
            let product =
                |(coefficient, values): (&f32, &Vec<f32>)| Bounded::from(*coefficient) * values[element].into();
            Some(terms.map(product).fold(Bounded::ZERO, |sum, term| sum + term))
        };
        jobs.iter().flat_map(|job| (0..job.element_count).map(move |index| element(job, index))).collect()
    }
}

/// Changes all values by 1 %: each has a coefficient in some job.
fn spoil(values: &mut [f32]) {
    values.iter_mut().for_each(|value| *value *= 1.01);
}

/// A dispatch of `add_noise`.
#[derive(Clone, Debug)]
pub struct NoiseJob {
    block: NoiseBlock,
    picture: Vec<f32>,
}

/// See the module.
pub enum AddNoise {}

impl Case for AddNoise {
    const KERNEL: Kernel = Kernel::AddNoise;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 1.0e-5, least: 1.0e-2 };
    const REASON: &'static str = "a product and an addition; for normal numbers 2 ULP of the logarithm, 4.5 ULP of the root, \
        9e-8 of the cosine, two roundings of its argument of up to a turn";
    const SPOILERS: &'static [Spoiler<Vec<NoiseJob>>] = &[
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.scale *= 1.01)),
        ("picture", |jobs| jobs.iter_mut().for_each(|job| spoil(&mut job.picture))),
    ];

    type Inputs = Vec<NoiseJob>;
    type Loaded<D: Device> = Vec<(D::Buffer<f32>, D::Buffer<f32>)>;

    fn inputs(seed: u64, size: u32) -> Vec<NoiseJob> {
        let random = &mut random(30, seed, size);
        let mut job = |(scale, stream, is_empty): (f32, u32, bool)| {
            let seed = [random.below(1 << 32) as u32, random.below(1 << 32) as u32];
            let picture = if is_empty { vec![0.0; size as usize] } else { numbers(size as usize, || random.normal()) };
            NoiseJob { block: NoiseBlock { seed, stream, scale }, picture }
        };
        [(1.0, 0, true), (0.5, 1, false), (0.002, 24, false), (3.0, u32::MAX, false)].map(&mut job).to_vec()
    }

    fn element_count(jobs: &Vec<NoiseJob>) -> usize {
        jobs.iter().map(|job| job.picture.len()).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<NoiseJob>) -> Result<Self::Loaded<D>, DeviceError> {
        jobs.iter().map(|job| Ok((device.upload(&job.picture)?, device.zeros(job.picture.len())?))).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<NoiseJob>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, (picture, noisy))| {
            device.add_noise(&job.block, job.picture.len() as u32, picture, noisy)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let noisy: Vec<Vec<f32>> = loaded.iter().map(|(_, noisy)| device.download(noisy)).collect::<Result<_, _>>()?;
        Ok(noisy.concat())
    }

    fn expected(jobs: &Vec<NoiseJob>) -> Vec<Option<Bounded>> {
        let noisy = |NoiseJob { block, picture }: &NoiseJob| {
            let normal = |element: u32| ray_oracle::normal(block.seed, element, block.stream);
            let noisy = |(element, value): (u32, &f32)| {
                Some(Bounded::from(*value) + Bounded::from(block.scale) * normal(element))
            };
            (0..).zip(picture).map(noisy).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(noisy).collect()
    }
}
