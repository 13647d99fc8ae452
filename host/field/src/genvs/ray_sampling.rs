//! Where a target's rays are sampled.

/// Sampling of rays in volumes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RaySampling {
    /// Near and far bounds of a camera's rays and volume, along its principal axis.
    pub(super) near_far: [f32; 2],
    /// Samples on a ray, at least 2; the first at `near`, the last at `far`.
    pub(super) sample_count: u32,
    /// Jitter of the samples, in halves of their distance: 0 or 1.
    pub(super) jitter: f32,
    /// Seed of the random draws.
    pub(super) seed: u64,
    /// Length of a ray from `near` to `far` in the unit of length of the network's densities.
    pub(super) ray_length: f32,
    /// Whether weights are inclusive, as published: samples shade themselves.
    pub(super) inclusive: bool,
}
