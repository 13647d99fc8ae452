//! [`Kernel::ChannelMeans`], [`Kernel::GroupNormPartials`] and [`Kernel::GroupNorm`]:
//! groups of one channel and of many, images from one pixel on that fill partials or do not, values far from 0,
//! constant groups, images that are some of the channels of wider ones. Outputs are one longer than requested.

use super::*;
use crate::group_norm_oracle;

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

impl Case for ChannelMeans {
    // A floor of variances and a length are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-4, least: 1.0e-2 };
    const REASON: &'static str =
        "n units (2^-24) of the sum of magnitudes of n pixels, in whatever order, and a division";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("inputs", |case| increase(&mut case.inputs))];

    fn inputs(seed: u64, size: u32) -> Vec<ChannelMeans> {
        let random = &mut random(23, seed, size);
        let dispatch = |[pixel_count, channels]: [u32; 2]| ChannelMeans {
            block: MeanBlock { pixel_count, channels },
            inputs: numbers((pixel_count * channels) as usize, || 1.0 + random.normal()),
            means: Output::Zeros(channels as usize + 1),
        };
        [[1, size], [65, size], [size, 3], [256, 7]].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let mean = |channel| group_norm_oracle::channel_mean(&self.inputs, &self.block, channel);
        decided((0..self.element_count()).map(mean), 1)
    }
}

impl Case for GroupNormPartials {
    // As many as give every shape floors, offsets and distances of all kinds.
    const SEED_COUNT: u64 = 8;
    // A floor of variances and a length are there for another kernel.
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 2.0, least: 1.0e-2 };
    const REASON: &'static str = "n units (2^-24) of the sum of n differences from one of the values, a rounding of \
        the mean; n + 3 units of the sum of squares, which is up to 10^4";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("inputs", |case| increase(&mut case.inputs))];

    fn inputs(seed: u64, size: u32) -> Vec<GroupNormPartials> {
        let random = &mut random(24, seed, size);
        let blocks = blocks(random, size).into_iter();
        let dispatch = |(block, distance): (GroupNormBlock, f64)| GroupNormPartials {
            block,
            inputs: image(random, &block, distance),
            partials: Output::Zeros((block.part_count() * block.group_count) as usize + 1),
        };
        blocks.map(dispatch).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let GroupNormPartials { block, inputs, .. } = self;
        let groups = block.group_count as usize;
        let partials = |index| group_norm_oracle::group_norm_partials(inputs, block, index / groups, index % groups);
        decided((0..self.element_count()).flat_map(partials), 2)
    }
}

impl Case for GroupNorm {
    // As many as give every shape floors, offsets and distances of all kinds.
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 5.0e-2, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis of merging one part after the other: a rounding of the mean \
        each, which is up to 10^3 deviations, and what that makes of the squares between the partials; the reciprocal \
        of a square root; a difference from the mean, two products and a sum; of SiLU an exponential, a sum and a \
        division";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("inputs", |case| increase(&mut case.inputs)),
        ("partials", |case| case.partials.iter_mut().for_each(|statistics| statistics[1] *= 1.05)),
        ("weights", |case| increase(&mut case.weights)),
        ("bias", |case| increase(&mut case.bias)),
        ("parameters", |case| case.block.variance_floor = 1.05 * (case.block.variance_floor + 1.0e-2)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<GroupNorm> {
        let random = &mut random(26, seed, size);
        let blocks = blocks(random, size);
        let dispatch = |(block, distance): (GroupNormBlock, f64)| {
            let inputs = image(random, &block, distance);
            // About what the inputs' are; some outputs become large.
            let spreads: Vec<f64> = (0..block.group_count).map(|_| random.log_range(0.01, 100.0)).collect();
            let mut partials = Vec::new();
            for part in 0..block.part_count() {
                for (group, spread) in (0..block.group_count).zip(&spreads) {
                    let first = block.in_first + group * block.group_channels();
                    let mean = f64::from(inputs[first as usize]) + random.normal() / 8.0;
                    let count = f64::from(block.pixels_of(part) * block.group_channels());
                    partials.push([mean as f32, (spread * count * random.range(0.5, 1.5)) as f32]);
                }
            }
            let [weights, bias] = [0, 1].map(|_| numbers(block.channels as usize, || random.normal()));
            let outputs = Output::Zeros(block.output_count() as usize + 1);
            GroupNorm { block, inputs, partials, weights, bias, outputs }
        };
        blocks.into_iter().map(dispatch).collect()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let GroupNorm { block, inputs, partials, weights, bias, .. } = self;
        let channels = block.channels as usize;
        let groups = 0..block.group_count as usize;
        let statistics: Vec<[Bounded; 2]> =
            groups.map(|group| group_norm_oracle::group_norm_statistics(partials, block, group)).collect();
        let output = |index: usize| {
            let at = [index / channels, index % channels];
            group_norm_oracle::normalised(inputs, &statistics, [weights, bias], block, at)
        };
        decided(map(block.output_count() as usize, 16, output), 1)
    }
}
