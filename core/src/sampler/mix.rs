//! Operations of samplers on pictures: linear combinations, and noise.

use crate::fetch::Fetch;
use crate::random::normal;
use bytemuck::{Pod, Zeroable};

/// How many results a step combines at most.
pub const MAX_RESULTS: usize = 4;

/// Coefficients of a linear combination of pictures: of the state, and of results, the newest first. A picture with
/// coefficient 0 is not read. Also the block of the kernel `mix_pictures`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct Mix {
    /// Of the state.
    pub state: f32,
    /// Of the results.
    pub results: [f32; MAX_RESULTS],
}

impl Mix {
    /// The state as it is.
    pub const STAY: Mix = Mix { state: 1.0, results: [0.0; MAX_RESULTS] };
    /// The newest result as it is.
    pub const NEWEST: Mix = Mix { state: 0.0, results: [1.0, 0.0, 0.0, 0.0] };

    /// The combination of numbers; a number with coefficient 0 is ignored, also NaN.
    #[inline]
    pub fn of(&self, state: f32, results: &[f32; MAX_RESULTS]) -> f32 {
        let [a, b, c, d] = results;
        mixed_element(self, &[state], &[*a], &[*b], &[*c], &[*d], 0)
    }

    /// The difference from another combination of the same state and results.
    pub(super) fn beyond(&self, other: &Mix) -> Mix {
        let ([a, b, c, d], [p, q, r, s]) = (self.results, other.results);
        Mix { state: self.state - other.state, results: [a - p, b - q, c - r, d - s] }
    }

    /// The difference between a corrector's and a predictor's combination of the same state: the corrector's newest
    /// result is one that the predictor does not have.
    pub fn correction_beyond(&self, predictor: &Mix) -> Mix {
        let [a, b, c, _] = predictor.results;
        self.beyond(&Mix { results: [0.0, a, b, c], ..*predictor })
    }
}

/// Kernel `mix_pictures`: an element of the combination. The sum runs from the state over the newest to the oldest
/// result; arrays with coefficient 0 are not read, and may be anything.
#[inline]
pub fn mixed_element<A: Fetch<f32> + ?Sized>(
    mix: &Mix,
    state: &A,
    newest: &A,
    second: &A,
    third: &A,
    fourth: &A,
    element: usize,
) -> f32 {
    let mut sum = 0.0;
    if mix.state != 0.0 {
        sum = mix.state * state.fetch(element);
    }
    if mix.results[0] != 0.0 {
        sum += mix.results[0] * newest.fetch(element);
    }
    if mix.results[1] != 0.0 {
        sum += mix.results[1] * second.fetch(element);
    }
    if mix.results[2] != 0.0 {
        sum += mix.results[2] * third.fetch(element);
    }
    if mix.results[3] != 0.0 {
        sum += mix.results[3] * fourth.fetch(element);
    }
    sum
}

/// A dispatch of `add_noise`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct NoiseBlock {
    /// Low and high word of the run's seed.
    pub seed: [u32; 2],
    /// Which noise of the run: 0 at its start, then one for each level at which some is added.
    pub stream: u32,
    /// Standard deviation of the noise.
    pub scale: f32,
}

/// Kernel `add_noise`: a picture's value with noise, `value + scale * normal(seed, element, stream)`. The same number
/// for the same seed on every device, up to the rounding of [`normal`].
#[inline]
pub fn noisy_element(block: &NoiseBlock, value: f32, element: u32) -> f32 {
    value + block.scale * normal(block.seed, element, block.stream)
}
