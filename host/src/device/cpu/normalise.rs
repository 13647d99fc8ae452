//! Means of images and normalisation by them, all channels of a pixel together.

use super::Cpu;
use crate::device::kernels::normalise::NormaliseKernels;
use pulp::Arch;
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::network::normalise::{MeanBlock, NormaliseBlock, PART, channel_mean, merged_moments, silu};

impl NormaliseKernels for Cpu {
    fn channel_means(&self, block: &MeanBlock, inputs: &Vec<f32>, means: &mut Vec<f32>) -> Result<(), Infallible> {
        for (channel, mean) in means[..block.channels as usize].iter_mut().enumerate() {
            *mean = channel_mean(&inputs[..], block, channel);
        }
        Ok(())
    }

    fn part_moments(
        &self,
        block: &NormaliseBlock,
        inputs: &Vec<f32>,
        parts: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        let groups = block.group_count as usize;
        let parts = &mut parts[..block.part_count() as usize * groups];
        parts.par_chunks_mut(groups).enumerate().for_each_init(Vec::new, |sums, (part, moments)| {
            Arch::new().dispatch(
                #[inline(always)]
                || moments_of(block, inputs, part, sums, moments),
            );
        });
        Ok(())
    }

    fn merge_moments(
        &self,
        block: &NormaliseBlock,
        parts: &Vec<[f32; 2]>,
        moments: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        for (group, moments) in moments[..block.group_count as usize].iter_mut().enumerate() {
            *moments = merged_moments(&parts[..], block, group);
        }
        Ok(())
    }

    fn normalise(
        &self,
        block: &NormaliseBlock,
        inputs: &Vec<f32>,
        moments: &Vec<[f32; 2]>,
        weights: &Vec<f32>,
        bias: &Vec<f32>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let (channels, pixel_count) = (block.channels as usize, block.pixel_count as usize);
        let of_channel = |channel: usize| moments[channel / block.group_channels() as usize];
        let mean: Vec<f32> = (0..channels).map(|channel| of_channel(channel)[0]).collect();
        let factor: Vec<f32> = (0..channels).map(|channel| of_channel(channel)[1] * weights[channel]).collect();
        let pixels = (4096 / channels).max(1);
        let outputs = outputs[..pixel_count * channels].par_chunks_mut(pixels * channels).enumerate();
        outputs.for_each(|(chunk, outputs)| {
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    for (pixel, outputs) in (chunk * pixels..).zip(outputs.chunks_exact_mut(channels)) {
                        let first = block.in_first as usize + pixel * block.in_pitch as usize;
                        let inputs = &inputs[first..first + channels];
                        for channel in 0..channels {
                            outputs[channel] = (inputs[channel] - mean[channel]) * factor[channel] + bias[channel];
                        }
                    }
                    if block.silu_outputs != 0 {
                        outputs.iter_mut().for_each(|output| *output = silu(*output));
                    }
                },
            );
        });
        Ok(())
    }
}

/// [`viewfuse_core::network::normalise::part_moments`] of all groups of a part: channel by channel first, the channels of
/// a group then summed.
#[inline(always)]
fn moments_of(block: &NormaliseBlock, inputs: &[f32], part: usize, sums: &mut Vec<f32>, moments: &mut [[f32; 2]]) {
    let (channels, own) = (block.channels as usize, block.group_channels() as usize);
    let first = part * PART as usize;
    let pixels = first..block.pixel_count.min((first + PART as usize) as u32) as usize;
    let count = (pixels.len() * own) as f32;
    let row = |pixel: usize| &inputs[block.in_first as usize + pixel * block.in_pitch as usize..][..channels];
    sums.clear();
    sums.resize(2 * channels, 0.0);
    let (sums, means) = sums.split_at_mut(channels);
    // First the group's first value, then its mean.
    for (means, inputs) in means.chunks_mut(own).zip(row(first).chunks(own)) {
        means.fill(inputs[0]);
    }
    for pixel in pixels.clone() {
        for ((sum, mean), input) in sums.iter_mut().zip(&*means).zip(row(pixel)) {
            *sum += input - mean;
        }
    }
    for ((sums, means), moments) in sums.chunks(own).zip(means.chunks_mut(own)).zip(&mut *moments) {
        *moments = [means[0] + sums.iter().sum::<f32>() / count, 0.0];
        means.fill(moments[0]);
    }
    sums.fill(0.0);
    for pixel in pixels {
        for ((sum, mean), input) in sums.iter_mut().zip(&*means).zip(row(pixel)) {
            *sum += (input - mean) * (input - mean);
        }
    }
    for (sums, moments) in sums.chunks(own).zip(moments) {
        moments[1] = sums.iter().sum();
    }
}
