//! Euler's step, and Heun's correction of it by a second call at the level reached.
//!
//! Source: Karras et al., "Elucidating the design space of diffusion-based generative models" (2022), algorithm 1.

use super::Mix;
use super::interpolation::Row;
use crate::schedule::HeunStep;

/// A straight step: the denoised picture counts as much as the level falls.
pub(super) fn euler_step(levels: &Row, _: u32, next: f32) -> Mix {
    let remaining = HeunStep::between(levels[0], next).remaining;
    Mix { state: remaining, results: [1.0 - remaining, 0.0, 0.0, 0.0] }
}

/// The correction of the state that [`euler_step`] reached, by the difference of the two calls.
pub(super) fn correction(levels: &Row, _: u32, reached: f32) -> Mix {
    let correction = HeunStep::between(levels[0], reached).correction;
    Mix { state: 1.0, results: [correction, -correction, 0.0, 0.0] }
}
