//! Group norm: the channels of an image in groups, each brought to mean 0 and variance 1, then scaled and shifted
//! channel by channel; and the mean of every channel.
//!
//! Statistics are computed in two steps, so that a device has enough parallel work: first of parts of the image, each
//! in two passes (the mean, then the deviations from it), then the parts' merged (Chan, Golub, LeVeque 1979) by each
//! run of outputs for itself, which is less work than to wait for another kernel. Means are
//! sums of differences from one of the values, and no difference of large sums is taken: of a group whose values are
//! 1e4 times its deviation only the mean's own rounding is lost, and a constant group has deviations of exactly 0.

use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::{exp, has_finite_bits, has_nan_bits, max, sqrt};

/// Pixels whose statistics are taken together.
pub const PART: u32 = 64;

/// Outputs whose statistics are merged together.
pub const RUN: u32 = 4096;

/// A dispatch of [`group_norm_partials`] or of outputs ([`group_norm_statistics`], [`group_norm_element`]), as plain
/// data. The yes-or-no field is 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GroupNormBlock {
    /// Pixels of the image, at least 1.
    pub pixel_count: u32,
    /// Channels of the image, a multiple of the groups.
    pub channels: u32,
    /// Numbers from an input pixel to the next: its channels may be some of a wider image's.
    pub in_pitch: u32,
    /// Where the first pixel's first channel lies.
    pub in_first: u32,
    /// Groups of neighbouring channels, at least 1.
    pub group_count: u32,
    /// Added to variances (epsilon).
    pub variance_floor: f32,
    /// Whether outputs go through `x / (1 + e^-x)` (SiLU).
    pub silu_outputs: u32,
}

impl GroupNormBlock {
    /// Parts of the image.
    #[inline]
    pub fn part_count(&self) -> u32 {
        self.pixel_count.div_ceil(PART)
    }

    /// Runs of outputs.
    #[inline]
    pub fn run_count(&self) -> u32 {
        self.output_count().div_ceil(RUN)
    }

    /// Outputs: channels of all pixels.
    #[inline]
    pub fn output_count(&self) -> u32 {
        self.pixel_count * self.channels
    }

    /// The group of an output.
    #[inline]
    pub fn group_of(&self, element: u32) -> u32 {
        element % self.channels / self.group_channels()
    }

    /// Channels of a group.
    #[inline]
    pub fn group_channels(&self) -> u32 {
        self.channels / self.group_count
    }

    /// Pixels of a part.
    #[inline]
    pub fn pixels_of(&self, part: u32) -> u32 {
        PART.min(self.pixel_count - part * PART)
    }

    /// What a part weighs when it is merged with those before it: its share of all their numbers, and that times the
    /// numbers before it. The same for all groups.
    #[inline]
    pub fn share_of(&self, part: u32) -> [f32; 2] {
        let before = (part * PART * self.group_channels()) as f32;
        let count = (self.pixels_of(part) * self.group_channels()) as f32;
        let share = count / (before + count);
        [share, before * share]
    }

    /// The first input of element `element` of `[part][group]`.
    #[inline]
    pub fn first_of(&self, element: u32) -> u32 {
        let (part, group) = (element / self.group_count, element % self.group_count);
        self.in_first + part * PART * self.in_pitch + group * self.group_channels()
    }
}

/// Mean, and sum of the squared deviations from it, of a group in a part of the image: number `element` of
/// `[part][group]`. Sums run pixel by pixel; the mean's is of differences from the group's first value in the part.
#[inline]
pub fn group_norm_partials(inputs: &(impl Fetch<f32> + ?Sized), block: &GroupNormBlock, element: usize) -> [f32; 2] {
    let (pixels, channels) = (block.pixels_of(element as u32 / block.group_count), block.group_channels());
    let first = block.first_of(element as u32);
    // Nearer to the mean than 0 is, wherever the group lies.
    let mut mean = inputs.fetch(first as usize);
    let mut deviations = 0.0;
    let mut pass = 0;
    while pass < 2 {
        let mut sum = 0.0;
        let mut pixel = 0;
        while pixel < pixels {
            let mut channel = 0;
            while channel < channels {
                let value = inputs.fetch((first + pixel * block.in_pitch + channel) as usize) - mean;
                sum += if pass == 0 { value } else { value * value };
                channel += 1;
            }
            pixel += 1;
        }
        if pass == 0 {
            mean += sum / (pixels * channels) as f32;
        } else {
            deviations = sum;
        }
        pass += 1;
    }
    [mean, deviations]
}

/// Mean of a group, and what its deviations are multiplied by: `1 / sqrt(variance + variance_floor)`, from the
/// statistics `partials[part][group]`, merged in their order. A group that is constant everywhere (and no floor) gives
/// 0 for the factor; one whose squares overflow, or that holds NaN or infinity, gives NaN, so that the fault is
/// reported and not hidden.
#[inline]
pub fn group_norm_statistics(
    partials: &(impl Fetch<[f32; 2]> + ?Sized),
    block: &GroupNormBlock,
    group: usize,
) -> [f32; 2] {
    let mut merged = MergedParts::before(partials.fetch(group));
    let mut part = 0;
    while part < block.part_count() {
        merged.add(block.share_of(part), partials.fetch(part as usize * block.group_count as usize + group));
        part += 1;
    }
    merged.statistics(block)
}

/// The statistics of a group's parts so far.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MergedParts {
    mean: f32,
    deviations: f32,
}

impl MergedParts {
    /// Before the first part, which is given: it changes nothing of the mean then, however a device divides.
    #[inline(always)]
    pub(crate) fn before([mean, _]: [f32; 2]) -> MergedParts {
        MergedParts { mean, deviations: 0.0 }
    }

    /// Adds the next part, its [share](GroupNormBlock::share_of), mean and squared deviations.
    #[inline(always)]
    pub(crate) fn add(&mut self, [share, weight]: [f32; 2], [mean, deviations]: [f32; 2]) {
        let difference = mean - self.mean;
        self.mean += difference * share;
        self.deviations += deviations + difference * difference * weight;
    }

    /// Mean and factor, as [`group_norm_statistics`].
    #[inline(always)]
    pub(crate) fn statistics(self, block: &GroupNormBlock) -> [f32; 2] {
        let count = (block.pixel_count * block.group_channels()) as f32;
        let spread = self.deviations / count + block.variance_floor;
        if !has_finite_bits(spread) {
            return [self.mean, f32::NAN];
        }
        [self.mean, if spread > 0.0 { 1.0 / sqrt(spread) } else { 0.0 }]
    }
}

/// Output number `element` of `[pixel][channel]`: the input less its group's mean, times its group's factor, times
/// `weights[channel]`, plus `bias[channel]`.
#[inline]
pub fn group_norm_element(
    inputs: &(impl Fetch<f32> + ?Sized),
    [mean, factor]: [f32; 2],
    weights: &(impl Fetch<f32> + ?Sized),
    bias: &(impl Fetch<f32> + ?Sized),
    block: &GroupNormBlock,
    element: usize,
) -> f32 {
    let (pixel, channel) = (element as u32 / block.channels, element as u32 % block.channels);
    let input = inputs.fetch((block.in_first + pixel * block.in_pitch + channel) as usize);
    let value = (input - mean) * (factor * weights.fetch(channel as usize)) + bias.fetch(channel as usize);
    if block.silu_outputs != 0 { silu(value) } else { value }
}

/// `x / (1 + e^-x)`: NaN for NaN. Below -87, where the result is no normal number, it is that of -87, -1.4e-36.
#[inline]
pub fn silu(x: f32) -> f32 {
    // Told by its bits: of NaN and a number a device's larger one is the number.
    if has_nan_bits(x) {
        return x;
    }
    // Beyond it the exponential ends, and divisors are too large for a device to divide by.
    let x = max(-87.0, x);
    x / (1.0 + exp(-x))
}

/// A dispatch of [`channel_mean`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct MeanBlock {
    /// Pixels of the image, at least 1.
    pub pixel_count: u32,
    /// Channels of the image.
    pub channels: u32,
}

/// Mean of channel `channel` of `inputs[pixel][channel]`, summed pixel by pixel.
#[inline]
pub fn channel_mean(inputs: &(impl Fetch<f32> + ?Sized), block: &MeanBlock, channel: usize) -> f32 {
    let mut sum = 0.0;
    let mut pixel = 0;
    while pixel < block.pixel_count as usize {
        sum += inputs.fetch(pixel * block.channels as usize + channel);
        pixel += 1;
    }
    sum / block.pixel_count as f32
}
