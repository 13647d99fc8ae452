//! Layers of networks that are not products of matrices.

use crate::network::attend::{softmax_scale, softmax_value};
use crate::network::depthwise::{DepthwiseBlock, depthwise_element};
use crate::network::group_norm::{self, GroupNormBlock, MeanBlock, RUN};
use crate::network::resample::{PoolBlock, UpsampleBlock, pooled_element, upsampled_element};
use crate::store::Store;

/// A channel of an output pixel.
#[inline]
pub fn convolve_depthwise(
    block: &DepthwiseBlock,
    inputs: &[f32],
    weights: &[f32],
    outputs: &mut (impl Store<f32> + ?Sized),
    channel: u32,
) {
    outputs.store(channel as usize, depthwise_element(inputs, weights, block, channel as usize));
}

/// A channel of an output pixel.
#[inline]
pub fn max_pool(block: &PoolBlock, inputs: &[f32], outputs: &mut (impl Store<f32> + ?Sized), channel: u32) {
    outputs.store(channel as usize, pooled_element(inputs, block, channel as usize));
}

/// An input channel of an output pixel.
#[inline]
pub fn upsample(block: &UpsampleBlock, inputs: &[f32], outputs: &mut (impl Store<f32> + ?Sized), channel: u32) {
    outputs.store(block.place(channel as usize), upsampled_element(inputs, block, channel as usize));
}

/// The mean of a channel.
#[inline]
pub fn channel_means(block: &MeanBlock, inputs: &[f32], means: &mut (impl Store<f32> + ?Sized), channel: u32) {
    means.store(channel as usize, group_norm::channel_mean(inputs, block, channel as usize));
}

/// Mean and squared deviations of a group of channels in a part of the image.
#[inline]
pub fn group_norm_partials(
    block: &GroupNormBlock,
    inputs: &[f32],
    partials: &mut (impl Store<[f32; 2]> + ?Sized),
    group: u32,
) {
    partials.store(group as usize, group_norm::group_norm_partials(inputs, block, group as usize));
}

/// A run of outputs.
#[inline]
pub fn group_norm(
    block: &GroupNormBlock,
    inputs: &[f32],
    partials: &[[f32; 2]],
    weights: &[f32],
    bias: &[f32],
    outputs: &mut (impl Store<f32> + ?Sized),
    run: u32,
) {
    let (mut element, all) = (run * RUN, block.output_count());
    let end = if all - element < RUN { all } else { element + RUN };
    let (mut group, mut statistics) = (u32::MAX, [0.0; 2]);
    while element < end {
        if group != block.group_of(element) {
            group = block.group_of(element);
            statistics = group_norm::group_norm_statistics(partials, block, group as usize);
        }
        let value = group_norm::group_norm_element(inputs, statistics, weights, bias, block, element as usize);
        outputs.store(element as usize, value);
        element += 1;
    }
}

/// The weights of a row's scores.
#[inline]
pub fn softmax_rows(column_count: &u32, scores: &[f32], weights: &mut (impl Store<f32> + ?Sized), row: u32) {
    let first = (row * column_count) as usize;
    let scale = softmax_scale(scores, first, *column_count);
    let mut at = first;
    while at < first + *column_count as usize {
        weights.store(at, softmax_value(scores[at], scale));
        at += 1;
    }
}
