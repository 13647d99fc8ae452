//! From noise to a picture with few calls of the denoiser: samplers as linear combinations.
//!
//! The picture solves `dx/ds = (x - D(x; s)) / s` in the noise level `s` (Karras et al. 2022, equation 1 with their
//! choices). Whatever the sampler, a step from one level to the next is a linear combination of the state `x` and of at
//! most four results of the denoiser, the newest first: a [`Mix`], whose coefficients depend on the levels alone. So a
//! sampler is a few functions from levels to coefficients, and pictures are combined by one kernel ([`mixed_element`]).
//!
//! ```text
//! euler       order 1   D + n / s (x - D), the same as DDIM
//! heun        order 2   algorithm 1 of Karras et al.: Euler, then a second call at the level reached
//! dpm++2m     order 2   Lu et al., "DPM-Solver++" (2022), algorithm 2
//! dpm++3m     order 3   the same with three results
//! unipc       order 4   Zhao et al., "UniPC" (2023): the same as a predictor, and a corrector that takes the call at the
//!                       level reached, which the next step needs anyway, as a fourth result
//! ipndm       order 2   Zhang and Chen (2022), as on EDM's levels in Zhou et al. (2024): Adams and Bashforth's four
//!                       coefficients for even steps, although the steps are not (on even ones it has order 4)
//! ipndm-v     order 4   the same with the coefficients of the steps that are taken
//! ```
//!
//! Multistep samplers begin with lower orders until they have enough results. What they put a polynomial through is the
//! denoised picture over the logarithm of the level, for `ipndm` and `ipndm-v` the direction `(x - D) / s` over the level
//! itself. Nothing that cancels is subtracted: the coefficients are good to a few units of `f32`, so the state may be
//! `f32` too.
//!
//! ```text
//! exponential     dpm++2m, dpm++3m, unipc          results are denoised pictures
//! directions      ipndm, ipndm-v                   results are directions
//! interpolation   integrals of interpolating polynomials
//! churn           noise added on the way
//! control         how far to step, and when to stop
//! ```

pub mod churn;
pub mod control;
mod directions;
mod exponential;
mod interpolation;

use crate::pages::Fetch;
use crate::random::normal;
use crate::schedule::HeunStep;
use bytemuck::{Pod, Zeroable};

/// How many results a step combines at most.
pub const MOST_RESULTS: usize = 4;

/// Coefficients of a linear combination of pictures: of the state, and of results, the newest first. What has
/// coefficient 0 is not read. Also the block of the kernel `mix_pictures`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Mix {
    /// Of the state.
    pub state: f32,
    /// Of the results.
    pub results: [f32; MOST_RESULTS],
}

impl Mix {
    /// The state as it is.
    pub const STAY: Mix = Mix { state: 1.0, results: [0.0; MOST_RESULTS] };
    /// The newest result as it is.
    pub const NEWEST: Mix = Mix { state: 0.0, results: [1.0, 0.0, 0.0, 0.0] };

    /// The combination of numbers; what has coefficient 0 counts nothing, whatever it is.
    #[inline]
    pub fn of(&self, state: f32, results: &[f32; MOST_RESULTS]) -> f32 {
        let [a, b, c, d] = results;
        mixed_element(self, &[state], &[*a], &[*b], &[*c], &[*d], 0)
    }

    /// The difference between what a corrector and a predictor make of the same state: the corrector's newest result is
    /// one that the predictor does not have.
    pub fn correction_beyond(&self, predictor: &Mix) -> Mix {
        let ([new, a, b, c], [p, q, r, _]) = (self.results, predictor.results);
        Mix { state: self.state - predictor.state, results: [new, a - p, b - q, c - r] }
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

/// Kernel `add_noise`: a picture's value with noise, `value + scale * normal(seed, element, stream)`. The same number for
/// the same seed on every device, up to the rounding of [`normal`].
#[inline]
pub fn noisy_element(block: &NoiseBlock, value: f32, element: u32) -> f32 {
    value + block.scale * normal(block.seed, element, block.stream)
}

/// A sampler; see the module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sampler {
    /// `euler`: order 1.
    Euler,
    /// `heun`: order 2, two calls a step.
    Heun,
    /// `dpm++2m`: DPM-Solver++ with two results.
    DpmPlus2,
    /// `dpm++3m`: DPM-Solver++ with three results.
    DpmPlus3,
    /// `unipc`: three results, corrected by a fourth.
    UniPc,
    /// `ipndm`: four directions, coefficients of even steps.
    #[default]
    Ipndm,
    /// `ipndm-v`: four directions, coefficients of the steps that are taken.
    IpndmUneven,
}

impl Sampler {
    /// All of them.
    pub const ALL: [Sampler; 7] = [
        Sampler::Euler,
        Sampler::Heun,
        Sampler::DpmPlus2,
        Sampler::DpmPlus3,
        Sampler::UniPc,
        Sampler::Ipndm,
        Sampler::IpndmUneven,
    ];

    /// What a person calls it.
    pub const fn name(self) -> &'static str {
        match self {
            Sampler::Euler => "euler",
            Sampler::Heun => "heun",
            Sampler::DpmPlus2 => "dpm++2m",
            Sampler::DpmPlus3 => "dpm++3m",
            Sampler::UniPc => "unipc",
            Sampler::Ipndm => "ipndm",
            Sampler::IpndmUneven => "ipndm-v",
        }
    }

    /// The power of the step with which its error shrinks on the published levels.
    pub const fn order(self) -> u32 {
        match self {
            Sampler::Euler => 1,
            Sampler::Heun | Sampler::DpmPlus2 | Sampler::Ipndm => 2,
            Sampler::DpmPlus3 => 3,
            Sampler::UniPc | Sampler::IpndmUneven => 4,
        }
    }

    /// How many results a step combines, once there are so many.
    pub const fn result_count(self) -> u32 {
        match self {
            Sampler::Euler | Sampler::Heun => 1,
            Sampler::DpmPlus2 => 2,
            Sampler::DpmPlus3 | Sampler::UniPc => 3,
            Sampler::Ipndm | Sampler::IpndmUneven => 4,
        }
    }

    /// Whether it forgets the results before the newest: only then may noise be added on the way.
    pub const fn is_single_step(self) -> bool {
        self.result_count() == 1
    }

    /// Whether a step is corrected once the denoiser was called at the level reached, by [`Sampler::correction`].
    pub const fn is_corrected(self) -> bool {
        matches!(self, Sampler::Heun | Sampler::UniPc)
    }

    /// How many calls of the denoiser a run over so many levels above 0 makes: one a level; for `heun` another one a
    /// step, of which the last, to 0, needs none.
    pub const fn call_count(self, level_count: u32) -> u32 {
        match self {
            Sampler::Heun => (2 * level_count).saturating_sub(1),
            _ => level_count,
        }
    }

    /// The most levels that a run with at most so many calls can have.
    pub const fn level_count(self, call_count: u32) -> u32 {
        match self {
            Sampler::Heun => call_count.div_ceil(2),
            _ => call_count,
        }
    }

    /// What is kept of a call at level `sigma`, from the state and the denoised picture (as the newest result); `None`
    /// where that is the denoised picture itself.
    pub fn kept(self, sigma: f32) -> Option<Mix> {
        match self {
            Sampler::Ipndm | Sampler::IpndmUneven => Some(directions::direction(sigma)),
            _ => None,
        }
    }

    /// The step from the newest level of a history to `next`, from the state there and what was kept of the calls.
    /// To level 0 that is the denoised picture, to a level that is not lower (or from no level at all) the state.
    pub fn step(self, history: &History, next: f32) -> Mix {
        if history.count == 0 || !(next < history.levels[0]) {
            return Mix::STAY;
        }
        let known = if self.result_count() < history.count { self.result_count() } else { history.count };
        match self {
            Sampler::Euler | Sampler::Heun => {
                let remaining = HeunStep::between(history.levels[0], next).remaining;
                Mix { state: remaining, results: [1.0 - remaining, 0.0, 0.0, 0.0] }
            }
            Sampler::DpmPlus2 => exponential::second_order(&history.levels, known, next),
            Sampler::DpmPlus3 | Sampler::UniPc => exponential::predictor(&history.levels, known, next),
            Sampler::Ipndm => directions::even_steps(&history.levels, known, next),
            Sampler::IpndmUneven => directions::uneven_steps(&history.levels, known, next),
        }
    }

    /// The correction of a step that reached level `reached`, from what was kept of the calls at the levels of the history
    /// and, as the newest result, of the one at the level reached: for `unipc` of the state in which the step began, for
    /// `heun` of the state that it reached. Where nothing is corrected, the state.
    pub fn correction(self, history: &History, reached: f32) -> Mix {
        if history.count == 0 || !(reached < history.levels[0] && reached > 0.0) {
            return Mix::STAY;
        }
        match self {
            Sampler::Heun => {
                let correction = HeunStep::between(history.levels[0], reached).correction;
                Mix { state: 1.0, results: [correction, -correction, 0.0, 0.0] }
            }
            Sampler::UniPc => exponential::corrector(&history.levels, history.count.min(3), reached),
            _ => Mix::STAY,
        }
    }
}

/// The levels at which results are known, the newest first; they fall from call to call.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct History {
    levels: [f32; MOST_RESULTS],
    count: u32,
}

impl History {
    /// Nothing is known.
    pub const NONE: History = History { levels: [0.0; MOST_RESULTS], count: 0 };

    /// A result at level `sigma` becomes known. If that is not below the newest level, everything before is forgotten:
    /// polynomials need distinct levels.
    pub fn push(&mut self, sigma: f32) {
        if !(sigma < self.levels[0]) {
            self.count = 0;
        }
        let [a, b, c, _] = self.levels;
        self.levels = [sigma, a, b, c];
        self.count = (self.count + 1).min(MOST_RESULTS as u32);
    }

    /// How many results are known.
    pub fn count(&self) -> u32 {
        self.count
    }
}
