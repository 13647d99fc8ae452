//! [`Kernel::ChannelMeans`], [`Kernel::GroupNormPartials`], [`Kernel::GroupNormStatistics`] and [`Kernel::GroupNorm`]:
//! groups of one channel and of many, images from one pixel on that fill partials or do not, values far from 0,
//! constant groups, images that are some of the channels of wider ones.

use crate::agreement::Limits;
use crate::bounded::Bounded;
use crate::case::{Case, Spoiler};
use crate::group_norm_oracle;
use crate::poses::{Random, numbers, random};
use viewfuse_device::DeviceError;
use viewfuse_device::parallel::map;
use viewfuse_device::{Device, Memory};
use viewfuse_kernels::network::group_norm::{GroupNormBlock, MeanBlock};
use viewfuse_vulkan::kernel::Kernel;

type Buffer<D, T> = <D as Memory>::Buffer<T>;

/// Groups, channels of each, how many times its deviation a group is from 0, numbers between the pixels' channels.
const GROUPS: [[u32; 4]; 6] =
    [[1, 1, 0, 0], [32, 4, 1, 0], [3, 5, 100, 2], [8, 1, 1000, 0], [1, 33, 0, 3], [2, 16, 10, 1]];

fn blocks(random: &mut Random, size: u32) -> Vec<(GroupNormBlock, f64)> {
    let mut block = |(index, [group_count, group_channels, distance, gap]): (usize, [u32; 4])| {
        let channels = group_count * group_channels;
        let block = GroupNormBlock {
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
fn image(random: &mut Random, block: &GroupNormBlock, distance: f64) -> Vec<f32> {
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

fn statistics_expected(statistics: impl Iterator<Item = [Bounded; 2]>) -> Vec<Option<Bounded>> {
    // One more than requested.
    statistics.chain([[Bounded::ZERO; 2]]).flatten().map(Some).collect()
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
            let mean = |channel| group_norm_oracle::channel_mean(inputs, block, channel);
            (0..block.channels as usize).map(mean).chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(means).collect()
    }
}

/// See the module.
pub enum GroupNormPartials {}

impl Case for GroupNormPartials {
    const KERNEL: Kernel = Kernel::GroupNormPartials;
    // As many as give every shape floors, offsets and distances of all kinds.
    const SEED_COUNT: u64 = 8;
    // A floor of variances and a length are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0, least: 1.0e-2 };
    const REASON: &'static str = "n units (2^-24) of the sum of n differences from one of the values, a rounding of the \
        mean; n + 3 units of the sum of squares, which is up to 10^4";
    const SPOILERS: &'static [Spoiler<Vec<(GroupNormBlock, Vec<f32>)>>] =
        &[("inputs", |jobs| jobs.iter_mut().flat_map(|(_, inputs)| inputs).for_each(|input| *input *= 1.01))];

    type Inputs = Vec<(GroupNormBlock, Vec<f32>)>;
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
        let load = |(block, inputs): &(GroupNormBlock, Vec<f32>)| {
            let partials = device.zeros((block.part_count() * block.group_count) as usize + 1)?;
            Ok((device.upload(inputs)?, partials))
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter()
            .zip(loaded)
            .try_for_each(|((block, _), (inputs, partials))| device.group_norm_partials(block, inputs, partials))
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let partials: Vec<_> =
            loaded.iter().map(|(_, partials)| device.download(partials)).collect::<Result<_, _>>()?;
        Ok(partials.concat().into_flattened())
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let partials = |(block, inputs): &(GroupNormBlock, Vec<f32>)| {
            let [partials, groups] = [block.part_count(), block.group_count].map(|count| count as usize);
            let places = (0..partials * groups).map(|index| (index / groups, index % groups));
            statistics_expected(
                places.map(|(part, group)| group_norm_oracle::group_norm_partials(inputs, block, part, group)),
            )
        };
        jobs.iter().flat_map(partials).collect()
    }
}

/// See the module.
pub enum GroupNormStatistics {}

impl Case for GroupNormStatistics {
    const KERNEL: Kernel = Kernel::GroupNormStatistics;
    // As many as give every shape floors, offsets and distances of all kinds.
    const SEED_COUNT: u64 = 8;
    const HAS_REAL_PARAMETERS: bool = true;
    const LIMITS: Limits = Limits { tolerance: 5.0e-2, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis of one part after the other: a rounding of the mean each, which is \
        up to 10^3 deviations, and what that makes of the squares between the partials; the reciprocal of a square root";
    const SPOILERS: &'static [Spoiler<Self::Inputs>] = &[
        ("partials", |jobs| {
            jobs.iter_mut().flat_map(|(_, partials)| partials).for_each(|statistics| statistics[1] *= 1.01)
        }),
        ("parameters", |jobs| {
            jobs.iter_mut().for_each(|(block, _)| block.variance_floor = 1.01 * (block.variance_floor + 1.0e-3))
        }),
    ];

    type Inputs = Vec<(GroupNormBlock, Vec<[f32; 2]>)>;
    type Loaded<D: Device> = Vec<[Buffer<D, [f32; 2]>; 2]>;

    fn inputs(seed: u64, size: u32) -> Self::Inputs {
        let random = &mut random(25, seed, size);
        let job = |[group_count, group_channels, part_count, distance]: [u32; 4]| {
            let channels = group_count * group_channels;
            let block = GroupNormBlock {
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
            let mut partials = Vec::new();
            for _ in 0..part_count {
                for [mean, deviation] in &groups {
                    let count = f64::from(64 * group_channels);
                    let own = mean + deviation * random.normal() / 8.0;
                    partials.push([own as f32, (deviation * count * random.range(0.5, 1.5)) as f32]);
                }
            }
            (block, partials)
        };
        [[size, 1, 1, 1], [size.div_ceil(4), 4, 5, 10], [32, 16, 16, 1], [3, 8, 64, 1000], [1, 1, 33, 100]]
            .map(job)
            .to_vec()
    }

    fn element_count(jobs: &Self::Inputs) -> usize {
        jobs.iter().map(|(block, _)| block.group_count as usize).sum()
    }

    fn load<D: Device>(device: &D, jobs: &Self::Inputs) -> Result<Self::Loaded<D>, DeviceError> {
        let load = |(block, partials): &(GroupNormBlock, Vec<[f32; 2]>)| {
            Ok([device.upload(partials)?, device.zeros(block.group_count as usize + 1)?])
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Self::Inputs, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        let mut jobs = jobs.iter().zip(loaded);
        jobs.try_for_each(|((block, _), [partials, statistics])| {
            device.group_norm_statistics(block, partials, statistics)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let statistics: Vec<_> =
            loaded.iter().map(|[_, statistics]| device.download(statistics)).collect::<Result<_, _>>()?;
        Ok(statistics.concat().into_flattened())
    }

    fn expected(jobs: &Self::Inputs) -> Vec<Option<Bounded>> {
        let statistics = |(block, partials): &(GroupNormBlock, Vec<[f32; 2]>)| {
            let groups = 0..block.group_count as usize;
            statistics_expected(groups.map(|group| group_norm_oracle::group_norm_statistics(partials, block, group)))
        };
        jobs.iter().flat_map(statistics).collect()
    }
}

/// An image with its statistics, weights and bias.
#[derive(Clone, Debug)]
pub struct Job {
    block: GroupNormBlock,
    inputs: Vec<f32>,
    statistics: Vec<[f32; 2]>,
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
    statistics: D::Buffer<[f32; 2]>,
    weights: D::Buffer<f32>,
    bias: D::Buffer<f32>,
    outputs: D::Buffer<f32>,
}

/// See the module.
pub enum GroupNorm {}

impl Case for GroupNorm {
    const KERNEL: Kernel = Kernel::GroupNorm;
    // As many as give every shape floors, offsets and distances of all kinds.
    const SEED_COUNT: u64 = 8;
    // A floor of variances and a length are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-4, least: 1.0e-2 };
    const REASON: &'static str = "a difference from the mean, up to 10^3 deviations, two products and a sum; of SiLU an \
        exponential, a sum and a division";
    const SPOILERS: &'static [Spoiler<Vec<Job>>] = &[
        ("inputs", |jobs| jobs.iter_mut().flat_map(|job| &mut job.inputs).for_each(|input| *input *= 1.01)),
        ("statistics", |jobs| jobs.iter_mut().flat_map(|job| &mut job.statistics).for_each(|own| own[1] *= 1.01)),
        ("weights", |jobs| jobs.iter_mut().flat_map(|job| &mut job.weights).for_each(|weight| *weight *= 1.01)),
        ("bias", |jobs| jobs.iter_mut().flat_map(|job| &mut job.bias).for_each(|bias| *bias *= 1.01)),
    ];

    type Inputs = Vec<Job>;
    type Loaded<D: Device> = Vec<LoadedJob<D>>;

    fn inputs(seed: u64, size: u32) -> Vec<Job> {
        let random = &mut random(26, seed, size);
        let blocks = blocks(random, size);
        let job = |(block, distance): (GroupNormBlock, f64)| {
            let inputs = image(random, &block, distance);
            // About what normalises it; some outputs become large.
            let statistics = (0..block.group_count).map(|group| {
                let first = block.in_first + group * block.group_channels();
                [inputs[first as usize] + random.normal() as f32, random.log_range(0.1, 10.0) as f32]
            });
            let statistics = statistics.collect();
            let [weights, bias] = [0, 1].map(|_| numbers(block.channels as usize, || random.normal()));
            Job { block, inputs, statistics, weights, bias }
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
                statistics: device.upload(&job.statistics)?,
                weights: device.upload(&job.weights)?,
                bias: device.upload(&job.bias)?,
                outputs: device.zeros(job.len() + 1)?,
            })
        };
        jobs.iter().map(load).collect()
    }

    fn run<D: Device>(device: &D, jobs: &Vec<Job>, loaded: &mut Self::Loaded<D>) -> Result<(), DeviceError> {
        jobs.iter().zip(loaded).try_for_each(|(job, LoadedJob { inputs, statistics, weights, bias, outputs })| {
            device.group_norm(&job.block, inputs, statistics, weights, bias, outputs)
        })
    }

    fn read<D: Device>(device: &D, loaded: &Self::Loaded<D>) -> Result<Vec<f32>, DeviceError> {
        let outputs: Vec<Vec<f32>> =
            loaded.iter().map(|job| device.download(&job.outputs)).collect::<Result<_, _>>()?;
        Ok(outputs.concat())
    }

    fn expected(jobs: &Vec<Job>) -> Vec<Option<Bounded>> {
        let outputs = |job: &Job| {
            let Job { block, inputs, statistics, weights, bias } = job;
            let channels = block.channels as usize;
            let output = |index: usize| {
                let at = [index / channels, index % channels];
                group_norm_oracle::normalised(inputs, statistics, [weights, bias], block, at)
            };
            let outputs = map(job.len(), 16, output);
            outputs.into_iter().chain([Bounded::ZERO]).map(Some).collect::<Vec<_>>()
        };
        jobs.iter().flat_map(outputs).collect()
    }
}
