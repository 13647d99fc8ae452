//! [`Kernel::CountMarked`], [`Kernel::SumCounts`], [`Kernel::ListMarked`] and [`Kernel::FindNonFinite`]: masks of all
//! densities over whole runs and parts of one, and numbers with infinity and NaN in any place. Whole numbers: exact.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::poses::{Random, random};
use viewfuse_device::{Device, DeviceError};
use viewfuse_kernels::compact::RUN;
use viewfuse_kernels::finite::FINITE_RUN;
use viewfuse_vulkan::kernel::Kernel;

/// Whole numbers.
const EXACT: Limits = Limits { tolerance: 0.0, least: 0.5 };
const REASON: &str = "whole numbers: exact";

type Buffer<D, T> = <D as viewfuse_device::Memory>::Buffer<T>;

/// Masks of nothing, of everything, and of some; the last element is not the end of a run.
fn masks(random: &mut Random, size: u32) -> Vec<Vec<u32>> {
    let mut mask = |share: f64, count: u32| -> Vec<u32> {
        (0..count).map(|_| if random.unit() < share { 1 + random.below(200) as u32 } else { 0 }).collect()
    };
    [(0.0, size), (1.0, size * RUN), (0.5, size * RUN / 2 + 3), (0.02, size * RUN - 1)]
        .map(|(share, count)| mask(share, count))
        .to_vec()
}

/// Clears every second mark, as 1 % of a mark is a mark.
fn unmark(mask: &mut [u32]) {
    mask.iter_mut().filter(|mark| **mark > 0).step_by(2).for_each(|mark| *mark = 0);
}

fn run_count(mask: &[u32]) -> u32 {
    (mask.len() as u32).div_ceil(RUN)
}

/// `[run]`.
fn counts(mask: &[u32]) -> Vec<u32> {
    mask.chunks(RUN as usize).map(|run| run.iter().filter(|mark| **mark != 0).count() as u32).collect()
}

/// `[run]`, and the sum of all.
fn offsets(counts: &[u32]) -> Vec<u32> {
    let mut offsets = vec![0];
    counts.iter().for_each(|count| offsets.push(offsets[offsets.len() - 1] + count));
    offsets
}

/// The results, and zeros behind them.
fn exact(values: impl IntoIterator<Item = u32>, len: usize) -> Vec<Option<Bounded>> {
    let values = values.into_iter().chain(std::iter::repeat(0));
    values.take(len).map(|value| Some(Bounded::from(value))).collect()
}

fn downloaded<'a, D: Device>(
    device: &D,
    buffers: impl IntoIterator<Item = &'a Buffer<D, u32>>,
) -> Result<Vec<f32>, DeviceError>
where
    Buffer<D, u32>: 'a,
{
    let mut values = Vec::new();
    for buffer in buffers {
        values.extend(device.download(buffer)?.into_iter().map(|value| value as f32));
    }
    Ok(values)
}

/// See the module.
pub enum CountMarked {}

impl Case for CountMarked {
    const KERNEL: Kernel = Kernel::CountMarked;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const SPOILERS: &'static [Spoiler<Vec<Vec<u32>>>] =
        &[("mask", |masks| masks.iter_mut().for_each(|mask| unmark(mask)))];

    type Inputs = Vec<Vec<u32>>;
    type Loaded<D: Device> = Vec<[Buffer<D, u32>; 2]>;

    fn inputs(seed: u64, size: u32) -> Vec<Vec<u32>> {
        masks(&mut random(61, seed, size), size.min(120))
    }

    fn element_count(masks: &Vec<Vec<u32>>) -> usize {
        masks.iter().map(|mask| run_count(mask) as usize).sum()
    }

    fn load<D: Device>(device: &D, masks: &Vec<Vec<u32>>) -> Result<Self::Loaded<D>, DeviceError> {
        // A mark behind the elements does not count.
        let load = |mask: &Vec<u32>| {
            Ok([device.upload(&[&mask[..], &[1]].concat())?, device.zeros(run_count(mask) as usize + 1)?])
        };
        masks.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, masks: &Vec<Vec<u32>>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        masks
            .iter()
            .zip(loaded)
            .try_for_each(|(job, [mask, counts])| device.count_marked(&(job.len() as u32), mask, counts))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        downloaded(device, loaded.iter().map(|[_, counts]| counts))
    }

    fn expected(masks: &Vec<Vec<u32>>) -> Vec<Option<Bounded>> {
        masks.iter().flat_map(|mask| exact(counts(mask), run_count(mask) as usize + 1)).collect()
    }
}

/// See the module.
pub enum SumCounts {}

impl Case for SumCounts {
    const KERNEL: Kernel = Kernel::SumCounts;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const SPOILERS: &'static [Spoiler<Vec<Vec<u32>>>] =
        &[("counts", |jobs| jobs.iter_mut().flatten().for_each(|count| *count = *count * 101 / 100))];

    type Inputs = Vec<Vec<u32>>;
    type Loaded<D: Device> = Vec<[Buffer<D, u32>; 3]>;

    fn inputs(seed: u64, size: u32) -> Vec<Vec<u32>> {
        let random = &mut random(62, seed, size);
        // Sums stay below 2^24, as far as f32 counts.
        [size, 2 * size + 1].map(|runs| (0..runs).map(|_| random.below(RUN as usize + 1) as u32).collect()).to_vec()
    }

    fn element_count(jobs: &Vec<Vec<u32>>) -> usize {
        jobs.len()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Vec<u32>>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |counts: &Vec<u32>| {
            Ok([device.upload(&[&counts[..], &[7]].concat())?, device.zeros(counts.len() + 2)?, device.zeros(2)?])
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Vec<u32>>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, [counts, offsets, total])| {
            device.sum_counts(&(job.len() as u32), counts, offsets, total)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        downloaded(device, loaded.iter().flat_map(|[_, offsets, total]| [offsets, total]))
    }

    fn expected(jobs: &Vec<Vec<u32>>) -> Vec<Option<Bounded>> {
        let job = |counts: &Vec<u32>| {
            let offsets = offsets(counts);
            let total = offsets.last().copied();
            [exact(offsets, counts.len() + 2), exact(total, 2)].concat()
        };
        jobs.iter().flat_map(job).collect()
    }
}

/// A mask, and the offsets of the list's parts.
#[derive(Clone, Debug)]
pub struct Listing {
    mask: Vec<u32>,
    offsets: Vec<u32>,
}

/// See the module.
pub enum ListMarked {}

impl Case for ListMarked {
    const KERNEL: Kernel = Kernel::ListMarked;
    const SEED_COUNT: u64 = 4;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const SPOILERS: &'static [Spoiler<Vec<Listing>>] = &[
        ("mask", |jobs| jobs.iter_mut().for_each(|job| unmark(&mut job.mask))),
        ("offsets", |jobs| {
            jobs.iter_mut().for_each(|job| job.offsets.iter_mut().for_each(|offset| *offset = *offset * 99 / 100))
        }),
    ];

    type Inputs = Vec<Listing>;
    type Loaded<D: Device> = Vec<[Buffer<D, u32>; 3]>;

    fn inputs(seed: u64, size: u32) -> Vec<Listing> {
        let masks = masks(&mut random(63, seed, size), size.min(120));
        masks.into_iter().map(|mask| Listing { offsets: offsets(&counts(&mask)), mask }).collect()
    }

    fn element_count(jobs: &Vec<Listing>) -> usize {
        jobs.iter().map(|job| run_count(&job.mask) as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Listing>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Listing| {
            Ok([
                device.upload(&[&job.mask[..], &[1]].concat())?,
                device.upload(&job.offsets)?,
                device.zeros(job.mask.len() + 1)?,
            ])
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Listing>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, [mask, offsets, list])| {
            device.list_marked(&(job.mask.len() as u32), mask, offsets, list)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        downloaded(device, loaded.iter().map(|[_, _, list]| list))
    }

    fn expected(jobs: &Vec<Listing>) -> Vec<Option<Bounded>> {
        let job = |job: &Listing| {
            let marked = job.mask.iter().zip(0..).filter(|(mark, _)| **mark != 0).map(|(_, element)| element);
            exact(marked, job.mask.len() + 1)
        };
        jobs.iter().flat_map(job).collect()
    }
}

/// See the module.
pub enum FindNonFinite {}

impl Case for FindNonFinite {
    const KERNEL: Kernel = Kernel::FindNonFinite;
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const SPOILERS: &'static [Spoiler<Vec<Vec<f32>>>] =
        // The largest numbers become infinite.
        &[("values", |jobs| jobs.iter_mut().flatten().for_each(|value| *value *= 1.01))];

    type Inputs = Vec<Vec<f32>>;
    type Loaded<D: Device> = Vec<(Buffer<D, f32>, Buffer<D, u32>)>;

    fn inputs(seed: u64, size: u32) -> Vec<Vec<f32>> {
        let random = &mut random(64, seed, size);
        let mut values = |count: u32, share: f64| -> Vec<f32> {
            let mut value = |_| match random.unit() < share {
                true => [f32::NAN, -f32::NAN, f32::INFINITY, f32::NEG_INFINITY][random.below(4)],
                false => [f32::MAX, f32::MIN, 0.0, -0.0, 1.0e-45, random.normal() as f32][random.below(6)],
            };
            (0..count).map(&mut value).collect()
        };
        let count = size.min(120) * FINITE_RUN;
        [(count, 0.0), (count - 1, 1.0e-3), (count / 2 + 1, 0.1), (size, 1.0)]
            .map(|(count, share)| values(count, share))
            .to_vec()
    }

    fn element_count(jobs: &Vec<Vec<f32>>) -> usize {
        jobs.iter().map(|values| values.len().div_ceil(FINITE_RUN as usize)).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Vec<f32>>) -> Result<Self::Loaded<D>, DeviceError> {
        // A number behind those that count must not be taken along.
        let load = |values: &Vec<f32>| {
            let run_count = values.len().div_ceil(FINITE_RUN as usize);
            Ok((device.upload(&[&values[..], &[f32::NAN]].concat())?, device.zeros(run_count + 1)?))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Vec<f32>>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter()
            .zip(loaded)
            .try_for_each(|(job, (values, firsts))| device.find_non_finite(&(job.len() as u32), values, firsts))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        downloaded(device, loaded.iter().map(|(_, firsts)| firsts))
    }

    fn expected(jobs: &Vec<Vec<f32>>) -> Vec<Option<Bounded>> {
        let job = |values: &Vec<f32>| {
            let firsts = values.chunks(FINITE_RUN as usize).zip(0..).map(|(run, number)| {
                let first = run.iter().position(|value| value.is_nan() || value.is_infinite());
                // As f32 rounds it.
                first.map_or(u32::MAX as f32 as f64, |first| (number * FINITE_RUN + first as u32).into())
            });
            let firsts = firsts.map(|value| Some(Bounded { value, error: 0.0 }));
            firsts.chain([Some(Bounded::ZERO)]).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(job).collect()
    }
}
