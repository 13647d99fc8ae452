//! UniPC: results are denoised pictures.
//!
//! With `l = -ln s` and the step's length `h = ln(s / n)` the flow is `x_n = n / s x_s + integral of exp(l - l_n) D dl`
//! exactly; a polynomial in `l` through the known results replaces `D`.
//!
//! Source: Zhao et al., "UniPC" (2023), and their code, with data prediction. Where it solves for its coefficients
//! exactly, as for three results and more, they are the integrals of that polynomial, for any function `B(h)`.

use super::Mix;
use super::interpolation::{Row, exponential_moments, places, weights};
use crate::math::ln_ratio;

/// The factor of the state, the length of the step, and the integrals over it.
fn prepared(from: f32, next: f32) -> (f32, f32, Row) {
    let h = ln_ratio(from, next);
    (next / from, h, exponential_moments(h, (from - next) / from))
}

/// UniPC's predictor: the polynomial through `count` results, of third order for three. To level 0 the newest result.
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
