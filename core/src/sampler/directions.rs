//! iPNDM: results are directions `d = (x - D) / s`, which `dx/ds = d` integrates by Adams and Bashforth's method.
//!
//! Sources: Zhang and Chen, "Fast sampling of diffusion models with exponential integrator" (2022), for the method and
//! its start with lower orders; Zhou et al., "Fast ODE-based sampling for diffusion models in around 5 steps" (2024),
//! and their code, for its form on EDM's levels.

use super::Mix;
use super::interpolation::Row;
use crate::math::min;

/// The direction at level `sigma` from the state and the denoised picture. Levels below 1e-38 count as that.
pub(super) fn direction(sigma: f32) -> Option<Mix> {
    let factor = min(1.0 / sigma, 1.0e38);
    Some(Mix { state: factor, results: [-factor, 0.0, 0.0, 0.0] })
}

/// The step by `count` directions as if all steps were as long as this. To level 0 the first-order one, which is the
/// denoised picture.
pub(super) fn even_steps(levels: &Row, count: u32, next: f32) -> Mix {
    let weights = match count {
        _ if !(next > 0.0) => [1.0, 0.0, 0.0, 0.0],
        1 => [1.0, 0.0, 0.0, 0.0],
        2 => [3.0 / 2.0, -1.0 / 2.0, 0.0, 0.0],
        3 => [23.0 / 12.0, -16.0 / 12.0, 5.0 / 12.0, 0.0],
        _ => [55.0 / 24.0, -59.0 / 24.0, 37.0 / 24.0, -9.0 / 24.0],
    };
    stepped(next - levels[0], &weights)
}

fn stepped(step: f32, weights: &Row) -> Mix {
    let [a, b, c, d] = weights;
    Mix { state: 1.0, results: [step * a, step * b, step * c, step * d] }
}
