//! [`Kernel::PackF16`] and [`Kernel::GatherVolumeF16`]: numbers from far below to far above the range of half
//! precision, odd and even counts of them; volumes as in [`super::volumes`], of odd and even numbers of features. An
//! independent implementation packs and reads half precision here.

use super::volumes::{self, Job, jobs};
use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{numbers, random};
use half::f16;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::rays::RayPoint;
use viewfuse_device::Device;
use viewfuse_device::DeviceError;
use viewfuse_kernels::genvs::VolumeBlock;
use viewfuse_vulkan::kernel::Kernel;

/// The nearest number in half precision, none larger than the largest.
pub(super) fn nearest(number: f32) -> f16 {
    f16::from_f32(number.clamp(-f16::MAX.to_f32(), f16::MAX.to_f32()))
}

/// Two in a word, the lower half first.
pub(super) fn packed(numbers: &[f32]) -> Vec<u32> {
    let bits = |number: Option<&f32>| number.map_or(0, |number| u32::from(nearest(*number).to_bits()));
    numbers.chunks(2).map(|pair| bits(pair.first()) | bits(pair.get(1)) << 16).collect()
}

/// Buffers of numbers, a dispatch each.
pub enum PackF16 {}

/// The same in a device's memory, and words with one behind them.
pub struct LoadedNumbers<D: Device> {
    numbers: D::Buffer<f32>,
    words: D::Buffer<u32>,
}

impl Case for PackF16 {
    const KERNEL: Kernel = Kernel::PackF16;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 0.0, least: 1.0e-4 };
    const REASON: &'static str = "the nearest number in half precision, of two the even one: exact";
    const SPOILERS: &'static [Spoiler<Vec<Vec<f32>>>] =
        &[("numbers", |jobs| jobs.iter_mut().flatten().for_each(|number| *number *= 1.01))];

    type Inputs = Vec<Vec<f32>>;
    type Loaded<D: Device> = Vec<LoadedNumbers<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Vec<f32>> {
        let random = &mut random(41, seed, size);
        let mut buffer = |count: u32| {
            numbers(count as usize, || {
                let power = random.range(-30.0, 18.0).exp2();
                match random.below(4) {
                    // Between two numbers in half precision, as near to one as to the other.
                    0 => f64::from(f16::from_f64(power).to_f32()) * (1.0 + 0.5_f64.powi(11)),
                    _ => random.normal() * power,
                }
            })
        };
        [2 * size, 2 * size - 1].map(&mut buffer).to_vec()
    }

    fn element_count(jobs: &Vec<Vec<f32>>) -> usize {
        jobs.iter().map(|numbers| numbers.len().div_ceil(2)).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Vec<f32>>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |numbers: &Vec<f32>| {
            // A number behind those that count must not be taken along.
            let longer = [&numbers[..], &[77.0]].concat();
            Ok(LoadedNumbers { numbers: device.upload(&longer)?, words: device.zeros(numbers.len().div_ceil(2) + 1)? })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Vec<f32>>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        for (job, LoadedNumbers { numbers, words }) in jobs.iter().zip(loaded) {
            device.pack_f16(&(job.len() as u32), numbers, words)?;
        }
        Ok(())
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let mut halves = Vec::new();
        for LoadedNumbers { words, .. } in loaded {
            let words = device.download(words)?;
            let bits = words.iter().flat_map(|word| [*word as u16, (*word >> 16) as u16]);
            halves.extend(bits.map(|bits| f16::from_bits(bits).to_f32()));
        }
        Ok(halves)
    }

    fn expected(jobs: &Vec<Vec<f32>>) -> Vec<Option<Bounded>> {
        let mut expected = Vec::new();
        for numbers in jobs {
            expected.extend(numbers.iter().map(|number| Some(Bounded::from(nearest(*number).to_f32()))));
            let behind = 2 + numbers.len() % 2;
            expected.extend(vec![Some(Bounded::ZERO); behind]);
        }
        expected
    }
}

/// See the module. The nodes are exact in half precision, before one is changed by 1 %.
pub enum GatherVolumeF16 {}

/// Jobs in a device's memory, and what is gathered.
pub struct LoadedJob<D: Device> {
    views: D::Buffer<CameraBlock>,
    points: D::Buffer<RayPoint>,
    volumes: Vec<D::Buffer<u32>>,
    gathered: D::Buffer<f32>,
}

impl Case for GatherVolumeF16 {
    const KERNEL: Kernel = Kernel::GatherVolumeF16;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = volumes::LIMITS;
    const REASON: &'static str = "as gather_volume: numbers in half precision are read exactly";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = volumes::SPOILERS;

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let mut jobs = jobs(&mut random(42, seed, size), size);
        let nodes = jobs.iter_mut().flat_map(|job| &mut job.volumes).flatten();
        nodes.for_each(|node| *node = nearest(*node).to_f32());
        jobs
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(Job::len).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            Ok(LoadedJob {
                views: device.upload(&job.views)?,
                points: device.upload(&job.points)?,
                volumes: job.volumes.iter().map(|nodes| device.upload(&packed(nodes))).collect::<Result<_, _>>()?,
                gathered: device.zeros(job.len() + 1)?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        for (job, LoadedJob { views, points, volumes, gathered }) in jobs.iter().zip(loaded) {
            for (volume, view) in volumes.iter().zip(0..) {
                device.gather_volume_f16(&VolumeBlock { view, ..job.block }, views, points, volume, gathered)?;
            }
        }
        Ok(())
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let gathered: Vec<Vec<f32>> =
            loaded.iter().map(|job| device.download(&job.gathered)).collect::<Result<_, _>>()?;
        Ok(gathered.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        volumes::expected(jobs)
    }
}
