//! Fusion and compositing in `f64`, with bounds on the error of `f32`.

use super::bounded::{Bounded, DIVISION, ROUNDING};
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::fuse::FuseBlock;

/// The weighted sum of an element over the views.
pub fn fuse_element(weights: &[f32], latents: &[f32], block: &FuseBlock, element: usize) -> Bounded {
    let latents = latents[element..].iter().step_by(block.stride as usize);
    let point = element / block.channel_count.max(1) as usize;
    let weights = &weights[point * block.weight_stride as usize..];
    let terms = weights[..block.view_count as usize].iter().zip(latents);
    terms.fold(Bounded::ZERO, |sum, (weight, latent)| sum + Bounded::from(*weight) * Bounded::from(*latent))
}

/// A ray's red, green, blue, opacity and depth from its samples, front to back. `None` if it depends on
/// rounding whether the ray is empty.
///
/// The sums are taken by parts: `sum (T_i - T_(i+1)) c_i` is `c_0 + sum T_i (c_i - c_(i-1))`, so that an error of a
/// transmittance contributes the change of the channel there, not twice the channel.
pub fn composite(samples: &[[f32; 4]], depths: &[f32], block: &CompositeBlock) -> [Option<Bounded>; 5] {
    let met: Vec<(&[f32; 4], f32)> = samples
        .iter()
        .zip(depths)
        .filter(|(sample, _)| sample[3] > 0.0)
        .map(|(sample, depth)| (sample, *depth))
        .collect();
    // In front of each sample, and behind the last.
    let mut optical_depth = Bounded::ZERO;
    let mut passes = vec![Bounded::ONE];
    for (sample, _) in &met {
        optical_depth = optical_depth + sample[3].into();
        passes.push((Bounded::ZERO - optical_depth).exp());
    }
    let channel = |channel: usize| {
        let seen = met.iter().map(|(sample, _)| sample[channel]).chain([block.background[channel]]);
        weighted(&passes, &seen.map(f64::from).collect::<Vec<_>>())
    };
    let opacity = Bounded::ONE - passes[met.len()];
    let depth = match Bounded::ZERO.below(opacity) {
        Some(true) => {
            let depths: Vec<f64> = met.iter().map(|(_, depth)| f64::from(*depth)).collect();
            Some(mean_depth(&passes, &depths, opacity))
        }
        Some(false) => Some(Bounded::from(block.empty_depth)),
        None => None,
    };
    [Some(channel(0)), Some(channel(1)), Some(channel(2)), Some(opacity), depth]
}

/// `sum (T_i - T_(i+1)) x_i` with `T` 0 behind the last.
fn weighted(passes: &[Bounded], values: &[f64]) -> Bounded {
    let mut sum = Bounded { value: values[0], error: 0.0 };
    for (index, pair) in values.windows(2).enumerate() {
        let change = pair[1] - pair[0];
        sum.value += passes[index + 1].value * change;
        sum.error += passes[index + 1].error * change.abs();
    }
    // Every partial sum is rounded, and every product and weight in it.
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    Bounded { error: sum.error + (values.len() + 2) as f64 * ROUNDING * largest, ..sum }
}

/// `sum (T_i - T_(i+1)) d_i / (1 - T_n)`: an error of a transmittance contributes the change of the depth there; an
/// error of the last one the distance of the last depth from the mean.
fn mean_depth(passes: &[Bounded], depths: &[f64], opacity: Bounded) -> Bounded {
    let count = depths.len();
    let mut sum = 0.0;
    let mut error = 0.0;
    for index in 0..count {
        sum += (passes[index].value - passes[index + 1].value) * depths[index];
        if index > 0 {
            error += passes[index].error * (depths[index] - depths[index - 1]).abs();
        }
    }
    let value = sum / opacity.value;
    error += passes[count].error * (value - depths[count - 1]).abs();
    // The divisor may be smaller by its error, at least by that of its own rounding.
    let brought = error / (opacity.value - opacity.error);
    Bounded { value, error: brought + ((count + 2) as f64 * ROUNDING + DIVISION) * value.abs() }
}
