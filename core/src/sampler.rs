//! Samplers of the diffusion denoiser with few calls, as linear combinations.
//!
//! The picture solves `dx/ds = (x - D(x; s)) / s` in the noise level `s` (Karras et al. 2022, equation 1 with their
//! choices). Whatever the sampler, a step from one level to the next is a linear combination of the state `x` and of at
//! most four results of the denoiser, the newest first: a [`Mix`], whose coefficients depend on the levels alone. So a
//! sampler is a few functions from levels to coefficients, and pictures are combined by one kernel ([`mixed_element`]).
//!
//! ```text
//! heun        order 2   algorithm 1 of Karras et al.: Euler's step, then a second call at the level reached
//! unipc       order 4   Zhao et al., "UniPC" (2023): three results as a predictor, and a corrector that uses the call at
//!                       the level reached, which the next step needs anyway, as a fourth result
//! ipndm       order 2   Zhang and Chen (2022), as on EDM's levels in Zhou et al. (2024): Adams and Bashforth's four
//!                       coefficients for even steps, although the steps are not (on even ones it has order 4)
//! ```
//!
//! `heun` is the published run. Of the samplers that were tried, `ipndm` has the least error up to 25 calls and `unipc`
//! with more (`host/results/speed.md` has the table).
//!
//! Multistep samplers begin with lower orders until they have enough results. What they put a polynomial through is the
//! denoised picture over the logarithm of the level, for `ipndm` the direction `(x - D) / s` over the level
//! itself. No subtraction cancels: the coefficients are accurate to a few units of `f32`, so the state may be
//! `f32` too.
//!
//! A sampler is one row of the list below and the functions that the row names:
//!
//! ```text
//! mix             the linear combination, and noise
//! heun            heun                             results are denoised pictures, steps are straight
//! exponential     unipc                            results are denoised pictures
//! directions      ipndm                            results are directions
//! interpolation   integrals of interpolating polynomials
//! churn           noise added between the steps
//! control         step size and early stop
//! ```

pub mod churn;
pub mod control;
mod directions;
mod exponential;
mod heun;
mod interpolation;
mod mix;

pub use mix::{MAX_RESULTS, Mix, NoiseBlock, mixed_element, noisy_element};

use core::fmt;
use core::str::FromStr;

/// When a step is corrected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Corrected {
    /// Never.
    Never,
    /// By a call at the level reached, made for that: twice the calls. The state that the step reached is corrected.
    ByAnotherCall,
    /// By the call at the level reached that the next step needs anyway. What is corrected is the step: from the state
    /// in which it began.
    ByTheNextCall,
}

/// Makes [`Sampler`] and its properties from one row a sampler:
///
/// - `name`: its name in commands and records,
/// - `order`: the power of the step with which its error shrinks on the published levels,
/// - `results`: how many results a step combines, once there are so many,
/// - `keeps`: what is kept of a call at a level; [`denoised`] or a function from the level to a mix,
/// - `step`: the step from the newest of the levels, by so many results, to a level,
/// - `corrected`, `correction`: when a step is corrected, and the mix of that from the levels, their count and the
///   level reached; [`none`] where it never is.
macro_rules! samplers {
    ($($(#[$attribute:meta])+ $sampler:ident {
        name: $name:literal,
        order: $order:literal,
        results: $results:literal,
        keeps: $keeps:path,
        step: $step:path,
        corrected: $corrected:path,
        correction: $correction:path,
    })+) => {
        /// A sampler; see the module.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum Sampler {
            $($(#[$attribute])+ $sampler,)+
        }

        impl Sampler {
            /// All of them.
            pub const ALL: [Sampler; [$($name),+].len()] = [$(Sampler::$sampler),+];

            /// Its name in commands and records.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Sampler::$sampler => $name,)+
                }
            }

            /// The power of the step with which its error shrinks on the published levels.
            pub const fn order(self) -> u32 {
                match self {
                    $(Sampler::$sampler => $order,)+
                }
            }

            /// How many results a step combines, once there are so many.
            pub const fn result_count(self) -> u32 {
                match self {
                    $(Sampler::$sampler => $results,)+
                }
            }

            /// When a step is corrected, by [`Sampler::correction`].
            pub const fn corrected(self) -> Corrected {
                match self {
                    $(Sampler::$sampler => $corrected,)+
                }
            }

            /// What is kept of a call at level `sigma`, from the state and the denoised picture (as the newest result);
            /// `None` where that is the denoised picture itself.
            pub fn kept(self, sigma: f32) -> Option<Mix> {
                match self {
                    $(Sampler::$sampler => $keeps(sigma),)+
                }
            }

            fn step_by(self, levels: &[f32; MAX_RESULTS], count: u32, next: f32) -> Mix {
                match self {
                    $(Sampler::$sampler => $step(levels, count, next),)+
                }
            }

            fn correction_by(self, levels: &[f32; MAX_RESULTS], count: u32, reached: f32) -> Mix {
                match self {
                    $(Sampler::$sampler => $correction(levels, count, reached),)+
                }
            }
        }
    };
}

samplers! {
    /// `heun`: order 2, two calls a step.
    Heun {
        name: "heun",
        order: 2,
        results: 1,
        keeps: denoised,
        step: heun::euler_step,
        corrected: Corrected::ByAnotherCall,
        correction: heun::correction,
    }
    /// `unipc`: three results, corrected by a fourth.
    UniPc {
        name: "unipc",
        order: 4,
        results: 3,
        keeps: denoised,
        step: exponential::predictor,
        corrected: Corrected::ByTheNextCall,
        correction: exponential::corrector,
    }
    /// `ipndm`: four directions, coefficients of even steps.
    #[default]
    Ipndm {
        name: "ipndm",
        order: 2,
        results: 4,
        keeps: directions::direction,
        step: directions::even_steps,
        corrected: Corrected::Never,
        correction: none,
    }
}

/// The denoised picture itself is kept.
fn denoised(_: f32) -> Option<Mix> {
    None
}

/// No correction.
fn none(_: &[f32; MAX_RESULTS], _: u32, _: f32) -> Mix {
    Mix::STAY
}

impl Sampler {
    /// Whether it uses the newest result only: a condition for noise between the steps.
    pub const fn is_single_step(self) -> bool {
        self.result_count() == 1
    }

    /// Whether a step is ever corrected.
    pub const fn is_corrected(self) -> bool {
        !matches!(self.corrected(), Corrected::Never)
    }

    /// Calls of the denoiser in a run over this many levels above 0: one a level; where another call corrects each
    /// step, one more a step but the last, to level 0. Fewer than 2^31 levels.
    pub const fn call_count(self, level_count: u32) -> u32 {
        match self.corrected() {
            Corrected::ByAnotherCall => (2 * level_count).saturating_sub(1),
            Corrected::Never | Corrected::ByTheNextCall => level_count,
        }
    }

    /// The most levels that a run with at most this many calls can have.
    pub const fn level_count(self, call_count: u32) -> u32 {
        match self.corrected() {
            Corrected::ByAnotherCall => call_count.div_ceil(2),
            Corrected::Never | Corrected::ByTheNextCall => call_count,
        }
    }

    /// The step from the newest level of a history to `next`, from the state there and what was kept of the calls.
    /// To level 0 that is the denoised picture, to a level that is not lower (or from no level at all) the state.
    pub fn step(self, history: &History, next: f32) -> Mix {
        if history.count == 0 || !(next < history.levels[0]) {
            return Mix::STAY;
        }
        let known = if self.result_count() < history.count { self.result_count() } else { history.count };
        self.step_by(&history.levels, known, next)
    }

    /// What the step to `next` adds to the step by one result less: the size of the error of such a step, without
    /// another call (embedded solutions of two orders). `None` where a step has one result only.
    pub fn embedded_difference(self, history: &History, next: f32) -> Option<Mix> {
        let known = if self.result_count() < history.count { self.result_count() } else { history.count };
        if known < 2 || !(next < history.levels[0]) {
            return None;
        }
        let less = self.step_by(&history.levels, known - 1, next);
        Some(self.step_by(&history.levels, known, next).beyond(&less))
    }

    /// The correction of a step that reached level `reached`, from what was kept of the calls at the levels of the
    /// history and, as the newest result, of the one at the level reached; of which state, [`Corrected`] says. Where
    /// nothing is corrected, the state.
    pub fn correction(self, history: &History, reached: f32) -> Mix {
        if history.count == 0 || !(reached < history.levels[0] && reached > 0.0) {
            return Mix::STAY;
        }
        self.correction_by(&history.levels, history.count, reached)
    }
}

impl fmt::Display for Sampler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// No sampler has this name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct UnknownSampler;

impl fmt::Display for UnknownSampler {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("unknown sampler; there are: ")?;
        for (index, sampler) in Sampler::ALL.iter().enumerate() {
            f.write_str(if index == 0 { "" } else { ", " })?;
            f.write_str(sampler.name())?;
        }
        Ok(())
    }
}

impl core::error::Error for UnknownSampler {}

impl FromStr for Sampler {
    type Err = UnknownSampler;

    /// The sampler of this name.
    fn from_str(name: &str) -> Result<Sampler, UnknownSampler> {
        Sampler::ALL.into_iter().find(|sampler| sampler.name() == name).ok_or(UnknownSampler)
    }
}

/// The levels at which results are known, the newest first; they fall from call to call.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct History {
    levels: [f32; MAX_RESULTS],
    count: u32,
}

impl History {
    /// No results.
    pub const NONE: History = History { levels: [0.0; MAX_RESULTS], count: 0 };

    /// Adds a result at level `sigma`. If that is not below the newest level, all results before it are dropped:
    /// polynomials need distinct levels.
    pub fn push(&mut self, sigma: f32) {
        if !(sigma < self.levels[0]) {
            self.count = 0;
        }
        let [a, b, c, _] = self.levels;
        self.levels = [sigma, a, b, c];
        self.count = (self.count + 1).min(MAX_RESULTS as u32);
    }

    /// The number of results.
    pub fn count(&self) -> u32 {
        self.count
    }
}
