//! Where a target's rays are sampled.

/// How rays go through volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RaySampling {
    /// Depths along a camera's principal axis between which its rays and its volume lie.
    pub(super) near_far: [f32; 2],
    /// Samples on a ray, at least 2; the first at `near`, the last at `far`.
    pub(super) sample_count: u32,
    /// How far samples stray at random, in halves of their distance: 0 or 1.
    pub(super) jitter: f32,
    /// Of the random numbers.
    pub(super) seed: u64,
    /// How long a ray is from `near` to `far` in the lengths that the network's densities are for.
    pub(super) ray_length: f32,
    /// Whether samples shade themselves, as published.
    pub(super) inclusive: bool,
}
