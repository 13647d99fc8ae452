//! [`Kernel::CopyNumbers`] and [`Kernel::MultiplyAdd`]: numbers of all sizes, among them what is no number; chains that tend
//! to one number and chains that tend to 0, also without a round.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{numbers, random};
use viewfuse_device::DeviceError;
use viewfuse_device::{Device, Memory};
use viewfuse_kernels::limits::{CHAINS, ChainBlock, ROUND_STEPS};
use viewfuse_vulkan::kernel::Kernel;

/// See the module.
pub enum CopyNumbers {}

impl Case for CopyNumbers {
    const KERNEL: Kernel = Kernel::CopyNumbers;
    const SEED_COUNT: u64 = 2;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 1.0e-30, least: 1.0e-30 };
    const REASON: &'static str = "a copy is exact";
    const SPOILERS: &'static [Spoiler<Vec<[f32; 4]>>] =
        &[("numbers", |numbers| numbers.as_flattened_mut().iter_mut().for_each(|number| *number *= 1.01))];

    type Inputs = Vec<[f32; 4]>;
    type Loaded<D: Device> = [<D as Memory>::Buffer<[f32; 4]>; 2];

    fn inputs(seed: u64, size: u32) -> Vec<[f32; 4]> {
        let random = &mut random(60, seed, size);
        let all = numbers(4 * size as usize, || random.normal() * random.log_range(1.0e-30, 1.0e30));
        all.as_chunks::<4>().0.to_vec()
    }

    fn element_count(given: &Vec<[f32; 4]>) -> usize {
        given.len()
    }

    fn load<D: Device>(device: &D, given: &Vec<[f32; 4]>) -> Result<Self::Loaded<D>, DeviceError> {
        Ok([device.upload(given)?, device.zeros(given.len() + 1)?])
    }

    fn run<D: Device>(device: &D, given: &Vec<[f32; 4]>, [from, to]: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        device.copy_numbers(given.len() as u32, from, to)
    }

    fn read<D: Device>(device: &D, [_, to]: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        Ok(device.download(to)?.into_flattened())
    }

    fn expected(given: &Vec<[f32; 4]>) -> Vec<Option<Bounded>> {
        let behind = [Bounded::ZERO; 4];
        given.as_flattened().iter().map(|number| Bounded::from(*number)).chain(behind).map(Some).collect()
    }
}

/// A dispatch of chains.
#[derive(Clone, Debug)]
pub struct Chains {
    block: ChainBlock,
    starts: Vec<f32>,
}

/// See the module.
pub enum MultiplyAdd {}

impl Case for MultiplyAdd {
    const KERNEL: Kernel = Kernel::MultiplyAdd;
    const SEED_COUNT: u64 = 2;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 1.0e-3, least: 1.0e-3 };
    const REASON: &'static str = "running errors of products and sums, which a device may fuse, along the chains";
    const SPOILERS: &'static [Spoiler<Vec<Chains>>] = &[
        ("starts", |jobs| jobs.iter_mut().flat_map(|job| &mut job.starts).for_each(|start| *start *= 1.01)),
        ("parameters", |jobs| jobs.iter_mut().for_each(|job| job.block.factor *= 1.01)),
    ];

    type Inputs = Vec<Chains>;
    type Loaded<D: Device> = Vec<[<D as Memory>::Buffer<f32>; 2]>;

    fn inputs(seed: u64, size: u32) -> Vec<Chains> {
        let random = &mut random(61, seed, size);
        [(0.9, 0.1, 3), (0.98, 0.0, 2), (0.5, 1.0, 1), (0.7, 0.2, 0)]
            .map(|(factor, summand, round_count)| Chains {
                block: ChainBlock { factor, summand, round_count },
                starts: numbers(size as usize, || 10.0 * random.normal()),
            })
            .to_vec()
    }

    fn element_count(jobs: &Vec<Chains>) -> usize {
        jobs.iter().map(|job| job.starts.len()).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Chains>) -> Result<Self::Loaded<D>, DeviceError> {
        jobs.iter().map(|job| Ok([device.upload(&job.starts)?, device.zeros(job.starts.len() + 1)?])).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Chains>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, [starts, ends])| {
            device.multiply_add(&job.block, job.starts.len() as u32, starts, ends)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let ends: Vec<Vec<f32>> = loaded.iter().map(|[_, ends]| device.download(ends)).collect::<Result<_, _>>()?;
        Ok(ends.concat())
    }

    fn expected(jobs: &Vec<Chains>) -> Vec<Option<Bounded>> {
        let sum = |job: &Chains, start: f32| {
            let (factor, summand) = (Bounded::from(job.block.factor), Bounded::from(job.block.summand));
            let chain = |number: u32| {
                let first = Bounded::from(start) + Bounded::from(number as f32);
                (0..job.block.round_count * ROUND_STEPS).fold(first, |x, _| x * factor + summand)
            };
            (0..CHAINS).map(chain).fold(Bounded::ZERO, |sum, chain| sum + chain)
        };
        let of_job = |job: &Chains| {
            let sums: Vec<Bounded> = job.starts.iter().map(|start| sum(job, *start)).collect();
            sums.into_iter().chain([Bounded::ZERO]).map(Some)
        };
        jobs.iter().flat_map(of_job).collect()
    }
}
