//! DPM-Solver++ and UniPC: results are denoised pictures.
//!
//! With `l = -ln s` and the step's length `h = ln(s / n)` the flow is `x_n = n / s x_s + integral of exp(l - l_n) D dl`
//! exactly; a polynomial in `l` through the known results replaces `D`.
//!
//! Sources: Lu et al., "DPM-Solver++" (2022), and their code; Zhao et al., "UniPC" (2023), and theirs, with data
//! prediction. Where these solve for their coefficients exactly, as for three results and more, they are the integrals of
//! that polynomial, for any function `B(h)`.

use super::Mix;
use super::interpolation::{Row, exponential_moments, places, weights};
use crate::math::ln_ratio;

/// The factor of the state, the length of the step, and the integrals over it.
fn prepared(from: f32, next: f32) -> (f32, f32, Row) {
    let h = ln_ratio(from, next);
    (next / from, h, exponential_moments(h, (from - next) / from))
}

/// DPM-Solver++(2M): the denoised picture in the middle of the step, from two results. With one result, and to level 0,
/// the first-order step.
pub(super) fn second_order(levels: &Row, count: u32, next: f32) -> Mix {
    let share = (levels[0] - next) / levels[0];
    let ahead = if count < 2 || !(next > 0.0) {
        0.0
    } else {
        0.5 * share * (ln_ratio(levels[0], next) / ln_ratio(levels[1], levels[0]))
    };
    Mix { state: next / levels[0], results: [share + ahead, -ahead, 0.0, 0.0] }
}

/// DPM-Solver++(3M) and UniPC's predictor: the polynomial through `count` results. To level 0 the newest result.
///
/// The published DPM-Solver++(3M) halves the term of the second difference, with which it is no longer of third order
/// (`tests/numerics/sampler.rs` measures 2); this is the third-order one.
pub(super) fn predictor(levels: &Row, count: u32, next: f32) -> Mix {
    if !(next > 0.0) {
        return Mix::NEWEST;
    }
    let (remaining, h, moments) = prepared(levels[0], next);
    Mix { state: remaining, results: weights(&places(levels, count, levels[0], h), count, &moments) }
}

/// UniPC's corrector: the polynomial through the result at the level reached and `count`, at most 3, results before it.
pub(super) fn corrector(levels: &Row, count: u32, reached: f32) -> Mix {
    let count = count.min(3);
    let (remaining, h, moments) = prepared(levels[0], reached);
    let [_, a, b, _] = places(levels, count, levels[0], h);
    Mix { state: remaining, results: weights(&[1.0, 0.0, a, b], count + 1, &moments) }
}
