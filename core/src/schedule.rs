//! The noise schedule of the diffusion denoiser: its noise levels, the network's scaling at a level, and a step between
//! two.
//!
//! Source: Karras et al., "Elucidating the design space of diffusion-based generative models" (2022), equation 5, table
//! 1 and algorithm 1 without churn; published GeNVS runs it with 25 levels. The denoiser is
//! `D(x; s) = c_skip x + c_out F(c_in x; c_noise)` with the network `F`; the picture solves `dx/ds = (x - D) / s`.
//!
//! A step from `s` to `n` in the published form is `d = (x - D) / s`, `e = x + (n - s) d`, `d' = (e - D') / n`,
//! `x + (n - s) (d + d') / 2`. Here it is the same line by line but without the terms that cancel:
//!
//! ```text
//! e = D + n / s (x - D)                   the first-order (Euler) step; exactly D when n = 0
//! e + (s / n - 1) / 2 (D' - D)            the second-order (Heun) correction
//! ```
//!
//! so no difference of large numbers is divided by a small level, `x` may be overwritten by `e`, and the state may
//! be `f32` (the published one is `f64`). Everything but [`HeunStep`]'s two formulas runs once a step, not once a
//! pixel.

use crate::math::{clamp, ln, min, norm3, seventh_root, two_product, two_sum};
use bytemuck::{Pod, Zeroable};
use core::fmt;

/// Standard deviation of the data (colours in `[-1, 1]`) that the preconditioning assumes.
pub const SIGMA_DATA: f32 = 0.5;
/// The smallest noise level that a schedule takes.
pub const SMALLEST_LEVEL: f32 = 1.0e-30;
/// The largest noise level that a schedule takes.
pub const MAX_LEVEL: f32 = 1.0e30;

/// Why two noise levels do not make a schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ScheduleError {
    /// A level lies outside [`SMALLEST_LEVEL`] to [`MAX_LEVEL`] or is NaN.
    Level,
    /// The smallest level is above the largest.
    Order,
}

impl fmt::Display for ScheduleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ScheduleError::Level => {
                write!(f, "noise levels must lie between {SMALLEST_LEVEL:e} and {MAX_LEVEL:e}")
            }
            ScheduleError::Order => f.write_str("the smallest noise level must not be above the largest"),
        }
    }
}

impl core::error::Error for ScheduleError {}

/// Noise levels from `sigma_max` down to `sigma_min`, evenly spaced in the seventh root (rho = 7), then 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NoiseSchedule {
    sigma_min: f32,
    sigma_max: f32,
    // Seventh roots as rounded values and rests: the seventh power makes seven errors of one.
    root_min: (f32, f32),
    root_max: (f32, f32),
}

impl NoiseSchedule {
    /// A schedule between these two levels, in the units of the picture's values.
    ///
    /// # Errors
    /// [`ScheduleError`] if a level is out of range or they are in the wrong order.
    pub fn new(sigma_min: f32, sigma_max: f32) -> Result<NoiseSchedule, ScheduleError> {
        let range = SMALLEST_LEVEL..=MAX_LEVEL;
        if !(range.contains(&sigma_min) && range.contains(&sigma_max)) {
            return Err(ScheduleError::Level);
        }
        if sigma_min > sigma_max {
            return Err(ScheduleError::Order);
        }
        Ok(NoiseSchedule::between(sigma_min, sigma_max))
    }

    /// From 80 down to 0.002: the published one.
    pub fn published() -> NoiseSchedule {
        NoiseSchedule::between(0.002, 80.0)
    }

    fn between(sigma_min: f32, sigma_max: f32) -> NoiseSchedule {
        NoiseSchedule { sigma_min, sigma_max, root_min: exact_root(sigma_min), root_max: exact_root(sigma_max) }
    }

    /// Level `index` of `count`: `(max^(1/7) + index / (count - 1) (min^(1/7) - max^(1/7)))^7`. Level 0 is exactly the
    /// largest, level `count - 1` exactly the smallest (a single level is the largest), and level `count` and
    /// everything behind it 0. Error at most 0.6 ULP for counts up to 2^24 (3 ULP below 1e-28).
    pub fn level(&self, index: u32, count: u32) -> f32 {
        if index >= count {
            return 0.0;
        }
        if index == 0 {
            return self.sigma_max;
        }
        let steps = (count - 1) as f32;
        let (passed, left) = (index as f32, (count - 1 - index) as f32);
        if !(left > 0.0) {
            return self.sigma_min;
        }
        let weighted = add(scale(self.root_max, left), scale(self.root_min, passed));
        let quotient = weighted.0 / steps;
        let (product, error) = two_product(quotient, steps);
        let rest = ((weighted.0 - product) - error + weighted.1) / steps;
        let (level, rest) = seventh_power((quotient, rest));
        clamp(level + rest, self.sigma_min, self.sigma_max)
    }
}

/// The seventh root as the rounded value and the rest.
fn exact_root(x: f32) -> (f32, f32) {
    let root = seventh_root(x);
    let (power, rest) = seventh_power((root, 0.0));
    (root, ((x - power) - rest) * (root / (7.0 * power)))
}

fn seventh_power(x: (f32, f32)) -> (f32, f32) {
    let square = multiply(x, x);
    let cube = multiply(square, x);
    multiply(multiply(square, square), cube)
}

fn multiply(a: (f32, f32), b: (f32, f32)) -> (f32, f32) {
    let (product, error) = two_product(a.0, b.0);
    two_sum(product, error + (a.0 * b.1 + a.1 * b.0))
}

fn scale(a: (f32, f32), factor: f32) -> (f32, f32) {
    let (product, error) = two_product(a.0, factor);
    two_sum(product, error + a.1 * factor)
}

fn add(a: (f32, f32), b: (f32, f32)) -> (f32, f32) {
    let (sum, error) = two_sum(a.0, b.0);
    (sum, error + (a.1 + b.1))
}

/// The four factors around the network at one noise level, for [`SIGMA_DATA`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct Preconditioning {
    /// `c_skip`: factor of the noisy picture (the skip connection), in `[0, 1]`.
    pub skip: f32,
    /// `c_out`: factor of the network's output, in `[0, 0.5]`.
    pub output: f32,
    /// `c_in`: factor of the network's input, in `[0, 2]`. Published GeNVS scales the condition channels by it as well.
    pub input: f32,
    /// `c_noise`: the network's noise conditioning, `ln(sigma) / 4`.
    pub noise: f32,
}

impl Preconditioning {
    /// At a noise level of at least 0: `c_skip = d^2 / (s^2 + d^2)`, `c_out = s d / sqrt(s^2 + d^2)`,
    /// `c_in = 1 / sqrt(s^2 + d^2)`, `c_noise = ln(s) / 4` with `s` the level and `d` [`SIGMA_DATA`].
    ///
    /// At 0 (and for negative levels and NaN) `1, 0, 2` and -21.8, the value at the smallest normal number, instead of
    /// minus infinity; infinity counts as the largest finite number, where the limits are `0, 0.5, 0`. Relative error
    /// at most 4e-7 each, as long as the results are normal numbers.
    pub fn at(sigma: f32) -> Preconditioning {
        let sigma = clamp(sigma, 0.0, f32::MAX);
        // The scaled norm: squares would overflow from 1.8e19 on.
        let norm = norm3(sigma, SIGMA_DATA, 0.0);
        let share = SIGMA_DATA / norm;
        Preconditioning {
            skip: share * share,
            output: sigma / norm * SIGMA_DATA,
            input: 1.0 / norm,
            noise: 0.25 * ln(sigma),
        }
    }

    /// The network's input for a value of the noisy picture.
    #[inline]
    pub fn network_input(&self, noisy: f32) -> f32 {
        self.input * noisy
    }

    /// The denoised value from the noisy one and the network's output there.
    #[inline]
    pub fn denoised(&self, noisy: f32, network_output: f32) -> f32 {
        self.skip * noisy + self.output * network_output
    }
}

/// The two factors of a step between noise levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct HeunStep {
    /// `n / s`: what remains of the noise.
    pub remaining: f32,
    /// `(s / n - 1) / 2`: factor of the second-order correction; 0 where the level reached is 0 and none is taken.
    pub correction: f32,
}

impl HeunStep {
    /// From level `sigma` to level `next`, both at least 0. From level 0 the step gives the denoised value. Factors
    /// that would overflow are the largest finite number.
    pub fn between(sigma: f32, next: f32) -> HeunStep {
        let remaining = if sigma > 0.0 { min(next / sigma, f32::MAX) } else { 0.0 };
        let correction = if next > 0.0 { clamp(0.5 * (sigma - next) / next, -0.5, f32::MAX) } else { 0.0 };
        HeunStep { remaining, correction }
    }

    /// Whether the correction changes anything: the step to level 0 has none and needs no second call of the network.
    #[inline]
    pub fn is_corrected(&self) -> bool {
        self.correction != 0.0
    }

    /// The first-order step of a value: `noisy` at the level before, and its denoised value.
    #[inline]
    pub fn euler(&self, noisy: f32, denoised: f32) -> f32 {
        denoised + self.remaining * (noisy - denoised)
    }

    /// The second-order step: the first-order one, the denoised value that led to it, and the denoised value there.
    #[inline]
    pub fn correct(&self, stepped: f32, denoised: f32, denoised_there: f32) -> f32 {
        stepped + self.correction * (denoised_there - denoised)
    }
}
