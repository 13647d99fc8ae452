//! [`Kernel::ChannelMeans`], [`Kernel::PartMoments`], [`Kernel::MergeMoments`] and [`Kernel::Normalise`]: groups of one channel
//! and of many, images from one pixel on that fill parts or do not, values far from 0, constant groups, images that are some
//! of the channels of wider ones.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::normalise_oracle;
use crate::poses::{Random, numbers, random};
use rayon::prelude::*;
use viewfuse_core::network::normalise::{MeanBlock, NormaliseBlock};
use viewfuse_device::DeviceError;
use viewfuse_device::{Device, Memory};
use viewfuse_vulkan::kernel::Kernel;

type Buffer<D, T> = <D as Memory>::Buffer<T>;

/// Groups, channels of each, how many times its deviation a group is from 0, numbers between the pixels' channels.
const GROUPS: [[u32; 4]; 6] =
    [[1, 1, 0, 0], [32, 4, 1, 0], [3, 5, 100, 2], [8, 1, 1000, 0], [1, 33, 0, 3], [2, 16, 10, 1]];

fn blocks(random: &mut Random, size: u32) -> Vec<(NormaliseBlock, f64)> {
    let mut block = |(index, [group_count, group_channels, distance, gap]): (usize, [u32; 4])| {
        let channels = group_count * group_channels;
        let block = NormaliseBlock {
            // Also more than one part, and as many as fill them.
            pixel_count: [1 + size.div_ceil(channels), 64 + size / 8, 128][(index + size as usize) % 3],
            channels,
            in_pitch: channels + gap,
            in_first: gap,
            group_count,
            variance_floor: [1.0e-5, 0.0, 1.0e-3][random.below(3)],
            silu_outputs: random.below(2) as u32,
        };
        (block, f64::from(distance))
    };
    GROUPS.into_iter().enumerate().map(&mut block).collect()
}

/// An image whose groups are so many deviations of 1 from 0; now and then a group is constant.
fn image(random: &mut Random, block: &NormaliseBlock, distance: f64) -> Vec<f32> {
    let groups: Vec<[f64; 2]> = (0..block.group_count)
        .map(|_| [distance * random.range(-1.0, 1.0), if random.below(8) == 0 { 0.0 } else { random.range(0.5, 2.0) }])
        .collect();
    let value = |index: usize| {
        // What lies between the pixels counts for nothing.
        let channel = (index as u32).checked_sub(block.in_first).map(|index| index % block.in_pitch);
        match channel.filter(|channel| *channel < block.channels) {
            Some(channel) => {
                let [mean, deviation] = groups[(channel / block.group_channels()) as usize];
                (mean + deviation * random.normal()) as f32
            }
            None => f32::MAX,
        }
    };
    (0..(block.in_first + block.pixel_count * block.in_pitch) as usize).map(value).collect()
}

fn moments_expected(moments: impl Iterator<Item = [Bounded; 2]>) -> Vec<Option<Bounded>> {
    // One more than is asked for.
    moments.chain([[Bounded::ZERO; 2]]).flatten().map(Some).collect()
}

/// See the module.
pub enum ChannelMeans {}

impl Case for ChannelMeans {
    const KERNEL: Kernel = Kernel::ChannelMeans;
    const SEED_COUNT: u64 = 4;
    // A floor of variances and a length are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-4, least: 1.0e-2 };
    const REASON: &'static str =
        "n units (2^-24) of the sum of magnitudes of n pixels, in whatever order, and a division";
    const SPOILERS: &'static [Spoiler<Vec<(MeanBlock, Vec<f32>)>>] =
        &[("inputs", |jobs| jobs.iter_mut().flat_map(|(_, inputs)| inputs).for_each(|input| *input *= 1.01))];

    type Inputs = Vec<(MeanBlock, Vec<f32>)>;
    type Loaded<D: Device> = Vec<[Buffer<D, f32>; 2]>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(23, seed, size);
        let job = |[pixel_count, channels]: [u32; 2]| {
            let inputs = numbers((pixel_count * channels) as usize, || 1.0 + random.normal());
            (MeanBlock { pixel_count, channels }, inputs)
        };
        [[1, size], [65, size], [size, 3], [256, 7]].map(job).to_vec()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|(block, _)| block.channels as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |(block, inputs): &(MeanBlock, Vec<f32>)| {
            Ok([device.upload(inputs)?, device.zeros(block.channels as usize + 1)?])
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|((block, _), [inputs, means])| device.channel_means(block, inputs, means))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let means: Vec<Vec<f32>> = loaded.iter().map(|[_, means]| device.download(means)).collect::<Result<_, _>>()?;
        Ok(means.concat())
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let means = |(block, inputs): &(MeanBlock, Vec<f32>)| {
            let mean = |channel| normalise_oracle::channel_mean(inputs, block, channel);
            (0..block.channels as usize).map(mean).chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(means).collect()
    }
}

/// See the module.
pub enum PartMoments {}

impl Case for PartMoments {
    const KERNEL: Kernel = Kernel::PartMoments;
    // As many as give every shape floors, offsets and distances of all kinds.
    const SEED_COUNT: u64 = 8;
    // A floor of variances and a length are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0, least: 1.0e-2 };
    const REASON: &'static str = "n units (2^-24) of the sum of n differences from one of the values, a rounding of the \
        mean; n + 3 units of the sum of squares, which is up to 10^4";
    const SPOILERS: &'static [Spoiler<Vec<(NormaliseBlock, Vec<f32>)>>] =
        &[("inputs", |jobs| jobs.iter_mut().flat_map(|(_, inputs)| inputs).for_each(|input| *input *= 1.01))];

    type Inputs = Vec<(NormaliseBlock, Vec<f32>)>;
    type Loaded<D: Device> = Vec<(Buffer<D, f32>, Buffer<D, [f32; 2]>)>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(24, seed, size);
        let blocks = blocks(random, size).into_iter();
        blocks.map(|(block, distance)| (block, image(random, &block, distance))).collect()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|(block, _)| (block.part_count() * block.group_count) as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |(block, inputs): &(NormaliseBlock, Vec<f32>)| {
            let parts = device.zeros((block.part_count() * block.group_count) as usize + 1)?;
            Ok((device.upload(inputs)?, parts))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|((block, _), (inputs, parts))| device.part_moments(block, inputs, parts))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let parts: Vec<_> = loaded.iter().map(|(_, parts)| device.download(parts)).collect::<Result<_, _>>()?;
        Ok(parts.concat().into_flattened())
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let parts = |(block, inputs): &(NormaliseBlock, Vec<f32>)| {
            let [parts, groups] = [block.part_count(), block.group_count].map(|count| count as usize);
            let places = (0..parts * groups).map(|index| (index / groups, index % groups));
            moments_expected(places.map(|(part, group)| normalise_oracle::part_moments(inputs, block, part, group)))
        };
        jobs.iter().flat_map(parts).collect()
    }
}

/// See the module.
pub enum MergeMoments {}

impl Case for MergeMoments {
    const KERNEL: Kernel = Kernel::MergeMoments;
    // As many as give every shape floors, offsets and distances of all kinds.
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 5.0e-2, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis of one part after the other: a rounding of the mean each, which is \
        up to 10^3 deviations, and what that makes of the squares between the parts; the reciprocal of a square root";
    const SPOILERS: &'static [Spoiler<Self::Inputs>] = &[
        ("parts", |jobs| jobs.iter_mut().flat_map(|(_, parts)| parts).for_each(|moments| moments[1] *= 1.01)),
        ("parameters", |jobs| {
            jobs.iter_mut().for_each(|(block, _)| block.variance_floor = 1.01 * (block.variance_floor + 1.0e-3))
        }),
    ];

    type Inputs = Vec<(NormaliseBlock, Vec<[f32; 2]>)>;
    type Loaded<D: Device> = Vec<[Buffer<D, [f32; 2]>; 2]>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(25, seed, size);
        let job = |[group_count, group_channels, part_count, distance]: [u32; 4]| {
            let channels = group_count * group_channels;
            let block = NormaliseBlock {
                // The last part is shorter, or not.
                pixel_count: 64 * part_count - random.below(2) as u32 * random.below(64) as u32,
                channels,
                in_pitch: channels,
                in_first: 0,
                group_count,
                variance_floor: [1.0e-5, 0.0, 1.0e-3][random.below(3)],
                silu_outputs: 0,
            };
            let groups: Vec<[f64; 2]> = (0..group_count)
                .map(|_| {
                    let is_constant = random.below(8) == 0;
                    [f64::from(distance) * random.range(-1.0, 1.0), if is_constant { 0.0 } else { 1.0 }]
                })
                .collect();
            let mut parts = Vec::new();
            for _ in 0..part_count {
                for [mean, deviation] in &groups {
                    let count = f64::from(64 * group_channels);
                    let own = mean + deviation * random.normal() / 8.0;
                    parts.push([own as f32, (deviation * count * random.range(0.5, 1.5)) as f32]);
                }
            }
            (block, parts)
        };
        [[size, 1, 1, 1], [size.div_ceil(4), 4, 5, 10], [32, 16, 16, 1], [3, 8, 64, 1000], [1, 1, 33, 100]]
            .map(job)
            .to_vec()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|(block, _)| block.group_count as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |(block, parts): &(NormaliseBlock, Vec<[f32; 2]>)| {
            Ok([device.upload(parts)?, device.zeros(block.group_count as usize + 1)?])
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let mut jobs = jobs.iter().zip(loaded);
        jobs.try_for_each(|((block, _), [parts, moments])| device.merge_moments(block, parts, moments))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let moments: Vec<_> = loaded.iter().map(|[_, moments]| device.download(moments)).collect::<Result<_, _>>()?;
        Ok(moments.concat().into_flattened())
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let moments = |(block, parts): &(NormaliseBlock, Vec<[f32; 2]>)| {
            let groups = 0..block.group_count as usize;
            moments_expected(groups.map(|group| normalise_oracle::merged_moments(parts, block, group)))
        };
        jobs.iter().flat_map(moments).collect()
    }
}

/// An image and what it is normalised with.
#[derive(Clone, Debug)]
pub struct Job {
    block: NormaliseBlock,
    inputs: Vec<f32>,
    moments: Vec<[f32; 2]>,
    weights: Vec<f32>,
    bias: Vec<f32>,
}

impl Job {
    fn len(&self) -> usize {
        (self.block.pixel_count * self.block.channels) as usize
    }
}

/// The same in a device's memory, and the outputs.
pub struct LoadedJob<D: Device> {
    inputs: D::Buffer<f32>,
    moments: D::Buffer<[f32; 2]>,
    weights: D::Buffer<f32>,
    bias: D::Buffer<f32>,
    outputs: D::Buffer<f32>,
}

/// See the module.
pub enum Normalise {}

impl Case for Normalise {
    const KERNEL: Kernel = Kernel::Normalise;
    // As many as give every shape floors, offsets and distances of all kinds.
    const SEED_COUNT: u64 = 8;
    // A floor of variances and a length are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "a difference from the mean, up to 10^3 deviations, two products and a sum; of SiLU an \
        exponential, a sum and a division";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("inputs", |jobs| jobs.iter_mut().flat_map(|job| &mut job.inputs).for_each(|input| *input *= 1.01)),
        ("moments", |jobs| jobs.iter_mut().flat_map(|job| &mut job.moments).for_each(|own| own[1] *= 1.01)),
        ("weights", |jobs| jobs.iter_mut().flat_map(|job| &mut job.weights).for_each(|weight| *weight *= 1.01)),
        ("bias", |jobs| jobs.iter_mut().flat_map(|job| &mut job.bias).for_each(|bias| *bias *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let random = &mut random(26, seed, size);
        let blocks = blocks(random, size);
        let job = |(block, distance): (NormaliseBlock, f64)| {
            let inputs = image(random, &block, distance);
            // About what normalises it; some outputs become large.
            let moments = (0..block.group_count).map(|group| {
                let first = block.in_first + group * block.group_channels();
                [inputs[first as usize] + random.normal() as f32, random.log_range(0.1, 10.0) as f32]
            });
            let moments = moments.collect();
            let [weights, bias] = [0, 1].map(|_| numbers(block.channels as usize, || random.normal()));
            Job { block, inputs, moments, weights, bias }
        };
        blocks.into_iter().map(job).collect()
    }

    fn element_count(jobs: &Vec<Job>) -> usize {
        jobs.iter().map(Job::len).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Vec<Job>) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |job: &Job| {
            Ok(LoadedJob {
                inputs: device.upload(&job.inputs)?,
                moments: device.upload(&job.moments)?,
                weights: device.upload(&job.weights)?,
                bias: device.upload(&job.bias)?,
                outputs: device.zeros(job.len() + 1)?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedJob { inputs, moments, weights, bias, outputs })| {
            device.normalise(&job.block, inputs, moments, weights, bias, outputs)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let outputs: Vec<Vec<f32>> =
            loaded.iter().map(|job| device.download(&job.outputs)).collect::<Result<_, _>>()?;
        Ok(outputs.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let outputs = |job: &Job| {
            let Job { block, inputs, moments, weights, bias } = job;
            let channels = block.channels as usize;
            let output = |index: usize| {
                let at = [index / channels, index % channels];
                normalise_oracle::normalised(inputs, moments, [weights, bias], block, at)
            };
            let outputs = (0..job.len()).into_par_iter().map(output);
            outputs.chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(outputs).collect()
    }
}
