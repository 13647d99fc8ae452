//! Weights of the source views: a point of the probability simplex.
//!
//! [`Weights`] cannot hold anything but finite, non-negative numbers that sum to 1. Every input, also NaN,
//! infinity or all zeros, gives such numbers, by rules that every constructor states.

use crate::math::{exp, max, min};

/// Weights of up to `S` source views. Values at and beyond [`Weights::count`] are 0.
///
/// Invariant: every value is finite and at least 0, and the sum (in view order) is 1 to within `2 S * 2^-24`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Weights<const S: usize> {
    values: [f32; S],
    count: u32,
}

/// The outcome of leaving views out; see [`Weights::without_least`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Omission<const S: usize> {
    /// The weights that remain, renormalised; views left out have weight 0.
    pub weights: Weights<S>,
    /// Sum of the weights that were left out.
    pub omitted_weight: f32,
    /// How many views with a weight above 0 were left out.
    pub omitted_count: u32,
}

impl<const S: usize> Omission<S> {
    /// Bound on the change of any weighted sum over the views whose inputs lie in an interval of length `range`.
    ///
    /// With omitted weight `d`, the sum changes by `d * (mean of the omitted - mean of the kept)`, hence by at most
    /// `d * range`. For sums that are renormalised over the views that see a point, divide by the total weight of
    /// those views; a change never exceeds `range`.
    pub fn bound(&self, range: f32) -> f32 {
        min(self.omitted_weight, 1.0) * range
    }
}

/// An error of at least 0, or infinity.
#[inline(always)]
fn or_infinite(error: f32) -> f32 {
    if error >= 0.0 { error } else { f32::INFINITY }
}

impl<const S: usize> Weights<S> {
    /// Equal weights. `count` is limited to `[1, S]`.
    pub fn mean(count: u32) -> Weights<S> {
        const { assert!(S > 0) };
        let count = count.clamp(1, S as u32);
        let mut values = [0.0; S];
        let mut view = 0;
        while view < count as usize {
            values[view] = 1.0;
            view += 1;
        }
        // A sum of ones is exact.
        Weights::from_sum(values, count as f32, count)
    }

    /// Proportional to non-negative scores. A score that is NaN or negative counts as 0, an infinite one as the largest
    /// finite number; if none is positive, all weights are equal. `count` is limited to `[1, S]`.
    pub fn from_scores(scores: &[f32; S], count: u32) -> Weights<S> {
        const { assert!(S > 0) };
        let count = count.clamp(1, S as u32);
        // Dividing by the largest first keeps the sum finite and the largest quotient exactly 1.
        let mut largest = 0.0;
        let mut view = 0;
        while view < count as usize {
            largest = max(usable(scores[view]), largest);
            view += 1;
        }
        let mut values = [0.0; S];
        let mut sum = 0.0;
        view = 0;
        while view < count as usize {
            values[view] = if largest > 0.0 { usable(scores[view]) / largest } else { 1.0 };
            sum += values[view];
            view += 1;
        }
        Weights::from_sum(values, sum, count)
    }

    /// Inversely proportional to non-negative errors.
    ///
    /// Evaluated as `smallest / error`, which neither overflows nor divides by zero: if some errors are exactly 0,
    /// those views share the whole weight (the limit). An error that is NaN, negative or infinite counts as infinite.
    pub fn from_errors(errors: &[f32; S], count: u32) -> Weights<S> {
        const { assert!(S > 0) };
        let count = count.clamp(1, S as u32);
        let mut smallest = f32::INFINITY;
        let mut view = 0;
        while view < count as usize {
            smallest = min(or_infinite(errors[view]), smallest);
            view += 1;
        }
        // The largest score is exactly 1, so the scores need no scaling before they are summed.
        let mut values = [0.0; S];
        let mut sum = 0.0;
        view = 0;
        while view < count as usize {
            // Not less first: if all are infinite they share the weight.
            let error = or_infinite(errors[view]);
            values[view] = if error > smallest { smallest / error } else { 1.0 };
            sum += values[view];
            view += 1;
        }
        Weights::from_sum(values, sum, count)
    }

    /// Softmax of logits, the largest subtracted first. A NaN logit counts as minus infinity; several that are plus
    /// infinity share all the weight.
    pub fn from_logits(logits: &[f32; S], count: u32) -> Weights<S> {
        const { assert!(S > 0) };
        let count = count.clamp(1, S as u32);
        let mut largest = f32::NEG_INFINITY;
        let mut view = 0;
        while view < count as usize {
            largest = max(logits[view], largest);
            view += 1;
        }
        let mut scores = [0.0; S];
        view = 0;
        while view < count as usize {
            // Not less first: infinity minus infinity is NaN.
            let logit = if logits[view] > f32::NEG_INFINITY { logits[view] } else { f32::NEG_INFINITY };
            scores[view] = if logit < largest { exp(logit - largest) } else { 1.0 };
            view += 1;
        }
        Weights::from_scores(&scores, count)
    }

    /// Finite non-negative values with their sum; if the sum is 0, all weights are equal.
    fn from_sum(mut values: [f32; S], sum: f32, count: u32) -> Weights<S> {
        let count = (count as usize).min(S);
        // One reciprocal for all: a rounding more, but a division takes as long as ten products.
        let (factor, offset) = if sum > 0.0 { (1.0 / sum, 0.0) } else { (0.0, 1.0 / count as f32) };
        let mut view = 0;
        while view < count {
            values[view] = values[view] * factor + offset;
            view += 1;
        }
        let count = count as u32;
        Weights { values, count }
    }

    /// The number of views, those with weight 0 included.
    #[inline]
    pub fn count(&self) -> u32 {
        // Never larger as it is, but said here it saves every loop over the views its checks of bounds.
        self.count.min(S as u32)
    }

    /// All values in view order; 0 at and beyond [`Weights::count`].
    #[inline]
    pub fn values(&self) -> &[f32; S] {
        &self.values
    }

    /// The weight of one view; `view < S`.
    #[inline]
    pub fn get(&self, view: u32) -> f32 {
        self.values[view as usize]
    }

    /// Leaves out views of least weight whose weights together stay at or below `total`, and renormalises the rest.
    ///
    /// Views go in order of increasing weight; views of equal weight go together or stay together, so that no choice
    /// among equals is arbitrary (the mean leaves out nothing). The views of largest weight always stay. `total` is
    /// meant to lie in `[0, 1)`; at 0 or NaN nothing is left out.
    pub fn without_least(&self, total: f32) -> Omission<S> {
        let count = (self.count as usize).min(S);
        let mut kept = self.values;
        let mut omitted_weight = 0.0;
        let mut omitted_count = 0;
        loop {
            // The least weight that is kept, how many views have it, and whether any has more.
            let (mut least, mut equal_count, mut any_above) = (f32::INFINITY, 0, false);
            let mut view = 0;
            while view < count {
                let weight = kept[view];
                if weight > 0.0 {
                    any_above |= weight > least || (weight < least && equal_count > 0);
                    if weight < least {
                        least = weight;
                        equal_count = 0;
                    }
                    equal_count += (weight == least) as u32;
                }
                view += 1;
            }
            let with_these = omitted_weight + least * equal_count as f32;
            if !any_above || !(with_these <= total) {
                break;
            }
            view = 0;
            while view < count {
                if kept[view] == least {
                    kept[view] = 0.0;
                }
                view += 1;
            }
            omitted_weight = with_these;
            omitted_count += equal_count;
        }
        let weights = if omitted_count == 0 { *self } else { Weights::from_scores(&kept, self.count) };
        Omission { weights, omitted_weight, omitted_count }
    }
}

/// A score as a finite number that is not negative. NaN fails the first comparison and becomes 0.
#[inline]
fn usable(score: f32) -> f32 {
    min(max(score, 0.0), f32::MAX)
}
