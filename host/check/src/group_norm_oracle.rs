//! Channel means and group norm of images in `f64`, with bounds on the error of `f32`.

use super::bounded::{Bounded, DIVISION, ROUNDING, roundings};
use viewfuse_kernels::network::group_norm::{GroupNormBlock, MeanBlock, PART};

/// Mean of a channel, summed in any order.
pub fn channel_mean(inputs: &[f32], block: &MeanBlock, channel: usize) -> Bounded {
    let values = inputs[channel..].iter().step_by(block.channels as usize).take(block.pixel_count as usize);
    Bounded::sum(values.map(|value| f64::from(*value))) / Bounded::from(block.pixel_count)
}

/// The values of a group in a part of the image, pixel by pixel.
fn values(inputs: &[f32], block: &GroupNormBlock, part: usize, group: usize) -> Vec<f64> {
    let channels = (block.channels / block.group_count) as usize;
    let pixels = (0..block.pixel_count as usize).skip(part * PART as usize).take(PART as usize);
    let first = block.in_first as usize + group * channels;
    let pixel = |pixel: usize| &inputs[first + pixel * block.in_pitch as usize..][..channels];
    pixels.flat_map(pixel).map(|value| f64::from(*value)).collect()
}

/// Mean of a group in a part of the image, and sum of the squared deviations.
///
/// The mean is the first value and a mean of differences from it, in any order: its error is that of a sum of those
/// differences, not of the values, and a rounding of itself. With `e` for it the deviations' sum is larger by `n e^2`
/// (what is linear in `e` cancels); each square is rounded three times, and as often as there are summands.
pub fn group_norm_partials(inputs: &[f32], block: &GroupNormBlock, part: usize, group: usize) -> [Bounded; 2] {
    let values = values(inputs, block, part, group);
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let from_first = values.iter().map(|value| (value - values[0]).abs()).sum::<f64>() / count;
    let error = from_first * (roundings(values.len() + 1) + DIVISION) + ROUNDING * (mean - values[0]).abs();
    // A constant group's first value is its mean exactly.
    let error = if from_first == 0.0 { 0.0 } else { error + ROUNDING * mean.abs() };
    let deviations: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let farther = count * error * error;
    let flushed = if from_first == 0.0 { 0.0 } else { count * f64::from(f32::MIN_POSITIVE) };
    let deviations_error = farther + (deviations + farther) * roundings(values.len() + 3) + flushed;
    [Bounded { value: mean, error }, Bounded { value: deviations, error: deviations_error }]
}

/// Mean of a group from those of its partials, and the factor of deviations from it.
///
/// The values are those of the whole group; the errors are those of merging part by part.
pub fn group_norm_statistics(partials: &[[f32; 2]], block: &GroupNormBlock, group: usize) -> [Bounded; 2] {
    let channels = f64::from(block.channels / block.group_count);
    let part_count = (block.pixel_count as usize).div_ceil(PART as usize);
    let sizes = (0..part_count).map(|part| (block.pixel_count as usize - part * PART as usize).min(PART as usize));
    let sizes: Vec<f64> = sizes.map(|pixels| pixels as f64 * channels).collect();
    let parts: Vec<[f32; 2]> = partials.iter().skip(group).step_by(block.group_count as usize).copied().collect();
    let all: f64 = sizes.iter().sum();
    let exactly = |moment: f32| f64::from(moment);
    let mean = sizes.iter().zip(&parts).map(|(size, part)| size * exactly(part[0])).sum::<f64>() / all;
    let inside_and_between =
        |(size, part): (&f64, &[f32; 2])| exactly(part[1]) + size * (exactly(part[0]) - mean).powi(2);
    let variance = sizes.iter().zip(&parts).map(inside_and_between).sum::<f64>() / all;
    let (mut running_mean, mut deviations, mut count) =
        (Bounded::from(parts[0][0]), Bounded::from(parts[0][1]), sizes[0]);
    for (size, [own_mean, own_deviations]) in sizes.iter().zip(&parts).skip(1) {
        let share = Bounded { value: size / (count + size), error: DIVISION * size / (count + size) };
        let difference = Bounded::from(*own_mean) - running_mean;
        running_mean = running_mean + difference * share;
        let between = difference * difference * (Bounded { value: count, error: 0.0 } * share);
        deviations = deviations + (Bounded::from(*own_deviations) + between);
        count += size;
    }
    let running = deviations / Bounded { value: all, error: 0.0 };
    // Parts that are all the same constant leave nothing to round.
    let is_constant = parts.iter().all(|statistics| *statistics == [parts[0][0], 0.0]);
    let [mean_error, variance_error] = if is_constant { [0.0; 2] } else { [running_mean.error, running.error] };
    let spread = Bounded { value: variance, error: variance_error } + block.variance_floor.into();
    let factor = if spread.value > 0.0 { Bounded::ONE / spread.square_root() } else { Bounded::ZERO };
    [Bounded { value: mean, error: mean_error }, factor]
}

/// Channel `channel` of pixel `pixel`, normalised.
pub fn normalised(
    inputs: &[f32],
    statistics: &[[Bounded; 2]],
    [weights, bias]: [&[f32]; 2],
    block: &GroupNormBlock,
    [pixel, channel]: [usize; 2],
) -> Bounded {
    let input = inputs[block.in_first as usize + pixel * block.in_pitch as usize + channel];
    let [mean, factor] = statistics[channel * block.group_count as usize / block.channels as usize];
    let factor = factor * weights[channel].into();
    let value = (Bounded::from(input) - mean) * factor + bias[channel].into();
    if block.silu_outputs == 0 { value } else { silu(value) }
}

/// `x / (1 + e^-x)`. It is nowhere steeper than 1.1.
fn silu(x: Bounded) -> Bounded {
    let exact = Bounded { error: 0.0, ..x };
    let value = exact / (Bounded::ONE + (-exact).exp());
    // Far below 0 it ends at -1.4e-36.
    Bounded { error: value.error + 1.1 * x.error + 2.0e-36, ..value }
}
