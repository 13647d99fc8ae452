//! Adaptive step size and early stop: levels chosen during the run instead of before.
//!
//! A step of `unipc` is taken twice, by its predictor and, with the call that the next step needs anyway, by its
//! corrector, which is one order better. Their difference estimates the predictor's local error without a further call,
//! as in any method of the kind (Milne 1926). Steps are measured in the logarithm of the level, where the flow changes
//! evenly: it is stiff towards small noise in the level itself.

use crate::math::{clamp, exp, ln, ln_ratio, max, min};
use crate::schedule::SIGMA_DATA;

/// The first step, for which there is no estimate: from 80 to 40.
pub const FIRST_STEP: f32 = core::f32::consts::LN_2;
/// The longest step: a factor of 4.5. Beyond that a polynomial through results is not accurate.
pub const LONGEST_STEP: f32 = 1.5;
/// Steps of this length (and up to half as long again) are taken for any estimate.
pub const SHORTEST_STEP: f32 = 0.05;

/// A picture counts as finished when its largest remaining change is below this: half of one of the 255 steps between
/// -1 and 1.
pub const HALF_A_LEVEL: f32 = 1.0 / 255.0;
/// Above this level a picture that does not change is not finished: it is the mean of many possible pictures.
pub const UNDECIDED_ABOVE: f32 = 0.2 * SIGMA_DATA;

/// Whether a step is taken, and how long the next one (or the same one once more) should be.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Verdict {
    /// Whether the step is good enough.
    pub is_accepted: bool,
    /// Length of the next step in the logarithm of the level.
    pub step: f32,
}

/// The verdict on a step of length `step` by a predictor of local order `local_order` (one more than how many results
/// it combined), with the estimated `error` and its `tolerance`.
///
/// The next step is the one that would just have reached nine tenths of the tolerance, limited to 0.3 to 2 times this
/// one and to [`LONGEST_STEP`]. A step is rejected where the error exceeds five times the tolerance: a rejected step
/// costs a call, a bad one only accuracy. An error of NaN is rejected, unless the step has the least length.
pub fn verdict(error: f32, tolerance: f32, step: f32, local_order: u32) -> Verdict {
    const REFUSED_FROM: f32 = 5.0;
    let ratio = tolerance / max(error, f32::MIN_POSITIVE);
    let factor = 0.9 * exp(clamp(ln(ratio) / local_order as f32, -5.0, 5.0));
    let factor = if error <= f32::MAX { clamp(factor, 0.3, 2.0) } else { 0.3 };
    Verdict {
        // The last step may be a little longer than requested, and a length measured between two levels is rounded.
        is_accepted: error <= REFUSED_FROM * tolerance || step <= 1.5 * SHORTEST_STEP,
        step: clamp(step * factor, SHORTEST_STEP, LONGEST_STEP),
    }
}

/// The level that a step of this length reaches from level `sigma`; the smallest one, if little more than that is left:
/// a sixth of a longest step is not worth a call, nor is a third of a short one.
pub fn reached(sigma: f32, step: f32, smallest: f32) -> f32 {
    let left = ln_ratio(sigma, smallest);
    if left <= step + 0.3 * min(step, 0.8) { smallest } else { sigma * exp(-step) }
}

/// Estimate of a picture's remaining change: between two calls, at levels `before` and `sigma` below it, it changed by
/// `change`. Towards small noise it approaches the final picture in proportion to the level. Infinite above
/// [`UNDECIDED_ABOVE`], and where the level did not fall.
pub fn change_to_come(change: f32, before: f32, sigma: f32) -> f32 {
    if sigma > UNDECIDED_ABOVE || !(sigma < before) { f32::INFINITY } else { change * (sigma / (before - sigma)) }
}
