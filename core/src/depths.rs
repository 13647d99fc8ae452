//! Where along a ray to look: depth samples.
//!
//! Depths are distances along the ray in world units. NeRF's two kinds: stratified (one jittered sample in each of `N`
//! equal parts of the interval) and importance samples by inverting the distribution that a first pass found.

use crate::math::clamp;

/// The sample in part `part` of `count` equal parts of `[near, far]`, at the fraction `jitter` in `[0, 1]` of its part
/// (0.5: the middle). The result never leaves `[near, far]`; `count` 0 is taken as 1.
#[inline]
pub fn stratified_depth(near: f32, far: f32, part: u32, count: u32, jitter: f32) -> f32 {
    let fraction = (part as f32 + jitter) / count.max(1) as f32;
    clamp(near + (far - near) * fraction, near, far)
}

/// Added to every coarse weight, so that no part of the ray has probability 0 (as in NeRF).
pub const PROBABILITY_FLOOR: f32 = 1.0e-5;

/// The depth at which the distribution given by `weights` over `N` equal parts of `[near, far]` reaches `u`.
///
/// Within a part the distribution is uniform. Negative and NaN weights count as 0, those above 1e30 as that. `u` is limited to `[0, 1]`. The
/// cumulative sum is compared with `u` times its own total, so that it cannot end below 1 and the result never leaves
/// `[near, far]` (in the published code a sum that rounds below 1 puts samples beyond the end). Increasing in `u`.
#[inline]
pub fn inverse_cdf<const N: usize>(near: f32, far: f32, weights: &[f32; N], u: f32) -> f32 {
    const { assert!(N > 0) };
    let mut total = 0.0;
    let mut part = 0;
    while part < N {
        total += mass_of(weights[part]);
        part += 1;
    }
    let wanted = clamp(u, 0.0, 1.0) * total;
    let mut below = 0.0;
    part = 0;
    let mut mass = mass_of(weights[0]);
    while part + 1 < N && below + mass <= wanted {
        below += mass;
        part += 1;
        mass = mass_of(weights[part]);
    }
    let inside = clamp((wanted - below) / mass, 0.0, 1.0);
    stratified_depth(near, far, part as u32, N as u32, inside)
}

/// Probability of a part before normalising; bounded, so that sums stay finite.
#[inline]
fn mass_of(weight: f32) -> f32 {
    clamp(weight, 0.0, 1.0e30) + PROBABILITY_FLOOR
}
