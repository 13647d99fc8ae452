//! Group norm of images, all channels of a pixel together.

use super::scratch::with_scratch;
use crate::parallel::{for_each_row, for_each_rows};
use pulp::{Arch, Simd, WithSimd};
use viewfuse_kernels::network::group_norm::{GroupNormBlock, PART, group_norm_statistics, silu};

pub(super) fn group_norm_partials(block: &GroupNormBlock, inputs: &[f32], partials: &mut [[f32; 2]]) {
    let groups = block.group_count as usize;
    // A part of an image is enough work for a core.
    for_each_row(&mut partials[..block.part_count() as usize * groups], groups, 1, |part, statistics| {
        with_scratch(2 * block.channels as usize, |sums| {
            Arch::new().dispatch(GroupNormPartials { block, inputs, part, sums, statistics });
        });
    });
}

pub(super) fn group_norm(
    block: &GroupNormBlock,
    inputs: &[f32],
    partials: &[[f32; 2]],
    weights: &[f32],
    bias: &[f32],
    outputs: &mut [f32],
) {
    let (channels, pixel_count) = (block.channels as usize, block.pixel_count as usize);
    let groups = 0..block.group_count as usize;
    let statistics: Vec<[f32; 2]> = groups.map(|group| group_norm_statistics(partials, block, group)).collect();
    let of_channel = |channel: usize| statistics[channel / block.group_channels() as usize];
    let mean: Vec<f32> = (0..channels).map(|channel| of_channel(channel)[0]).collect();
    let factor: Vec<f32> = (0..channels).map(|channel| of_channel(channel)[1] * weights[channel]).collect();
    let outputs = &mut outputs[..pixel_count * channels];
    for_each_rows(outputs, channels, 4096, &|first_pixel, outputs| {
        Arch::new().dispatch(Normalised { block, inputs, first_pixel, mean: &mean, factor: &factor, bias, outputs });
    });
}

/// Some pixels, as [`viewfuse_kernels::network::group_norm::group_norm_element`] defines them. A struct and not a
/// closure, as all that must run with the machine's widest instructions: a closure becomes a function of its own,
/// without them.
struct Normalised<'a> {
    block: &'a GroupNormBlock,
    inputs: &'a [f32],
    first_pixel: usize,
    /// `[channel]`, as all of these.
    mean: &'a [f32],
    factor: &'a [f32],
    bias: &'a [f32],
    outputs: &'a mut [f32],
}

impl WithSimd for Normalised<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Normalised { block, inputs, first_pixel, mean, factor, bias, outputs } = self;
        let channels = block.channels as usize;
        let (mean, factor, bias) = (&mean[..channels], &factor[..channels], &bias[..channels]);
        for (pixel, outputs) in (first_pixel..).zip(outputs.chunks_exact_mut(channels)) {
            let first = block.in_first as usize + pixel * block.in_pitch as usize;
            let inputs = &inputs[first..first + channels];
            if block.silu_outputs != 0 {
                for channel in 0..channels {
                    outputs[channel] = silu((inputs[channel] - mean[channel]) * factor[channel] + bias[channel]);
                }
            } else {
                for channel in 0..channels {
                    outputs[channel] = (inputs[channel] - mean[channel]) * factor[channel] + bias[channel];
                }
            }
        }
    }
}

/// [`viewfuse_kernels::network::group_norm::group_norm_partials`] of all groups of a part: channel by channel first,
/// the channels of a group then summed.
struct GroupNormPartials<'a> {
    block: &'a GroupNormBlock,
    inputs: &'a [f32],
    part: usize,
    /// Scratch, two numbers a channel.
    sums: &'a mut [f32],
    /// `[group]`.
    statistics: &'a mut [[f32; 2]],
}

impl WithSimd for GroupNormPartials<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let GroupNormPartials { block, inputs, part, sums, statistics } = self;
        let (channels, group_channels) = (block.channels as usize, block.group_channels() as usize);
        let first = part * PART as usize;
        let pixels = first..block.pixel_count.min((first + PART as usize) as u32) as usize;
        let count = (pixels.len() * group_channels) as f32;
        let (sums, means) = sums.split_at_mut(channels);
        sums.fill(0.0);
        // First the group's first value, then its mean.
        for (means, inputs) in means.chunks_mut(group_channels).zip(row_of(block, inputs, first).chunks(group_channels))
        {
            means.fill(inputs[0]);
        }
        for pixel in pixels.clone() {
            for ((sum, mean), input) in sums.iter_mut().zip(&*means).zip(row_of(block, inputs, pixel)) {
                *sum += input - mean;
            }
        }
        for ((sums, means), statistics) in
            sums.chunks(group_channels).zip(means.chunks_mut(group_channels)).zip(&mut *statistics)
        {
            *statistics = [means[0] + sums.iter().sum::<f32>() / count, 0.0];
            means.fill(statistics[0]);
        }
        sums.fill(0.0);
        for pixel in pixels {
            for ((sum, mean), input) in sums.iter_mut().zip(&*means).zip(row_of(block, inputs, pixel)) {
                *sum += (input - mean) * (input - mean);
            }
        }
        for (sums, statistics) in sums.chunks(group_channels).zip(statistics) {
            statistics[1] = sums.iter().sum();
        }
    }
}

/// The channels of a pixel.
#[inline(always)]
fn row_of<'a>(block: &GroupNormBlock, inputs: &'a [f32], pixel: usize) -> &'a [f32] {
    &inputs[block.in_first as usize + pixel * block.in_pitch as usize..][..block.channels as usize]
}
