//! The options of a GeNVS: its rays, the denoiser's run, and its omissions.

use super::super::Denoising;
use super::sampling::{Plan, Steps};
use crate::variant::Options;
use viewfuse_core::sampler::Sampler;
use viewfuse_device::Precision;

/// Samples on a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rays {
    /// The number of samples on a ray, evenly spaced from the near to the far bound, at least 2.
    pub sample_count: u32,
    /// Jitter of the samples, in halves of their distance: 1 as published, 0 (the default) for none, so that
    /// neighbouring frames have the same error.
    pub jitter: f32,
    /// Near and far bounds, depths along the target's principal axis; `None`: from the sources' distance to the point
    /// that they look at. The near bound must be smaller.
    pub near_far: Option<[f32; 2]>,
    /// Length of a ray in the unit of length of the network's densities; `None`: as published for SRN, 1 over the focal
    /// length in halves of the image's height.
    pub length: Option<f32>,
    /// Whether weights are inclusive, as in published checkpoints: samples shade themselves.
    pub inclusive: bool,
}

impl Default for Rays {
    /// As published, but without jitter.
    fn default() -> Rays {
        Rays { sample_count: 64, jitter: 0.0, near_far: None, length: None, inclusive: true }
    }
}

/// Omissions. Each has a switch of its own; the number of calls of the denoiser is part of the plan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Omissions {
    /// The encoding of views that no target uses. Exact.
    pub unused_views: bool,
    /// Rows of volumes that no ray of a target reaches, at the encoder's last layer. Exact.
    pub unseen_rows: bool,
    /// Noise levels above this one, if there is an earlier frame: noise of that level is added to it, and the run
    /// starts from the result. `None`: every frame starts from noise alone.
    pub reuse: Option<f32>,
    /// Half of the bits of volumes (f16): features have a relative error of at most 2^-11, and are limited to 65504.
    /// All rows are computed at once then.
    pub half_volumes: bool,
}

impl Omissions {
    /// Nothing is left out.
    pub const NONE: Omissions = Omissions { unused_views: false, unseen_rows: false, reuse: None, half_volumes: false };
    /// The default omissions: those without a visible effect.
    pub const EXACT: Omissions = Omissions { unused_views: true, unseen_rows: true, reuse: None, half_volumes: false };
}

impl Default for Omissions {
    /// [`Omissions::EXACT`].
    fn default() -> Omissions {
        Omissions::EXACT
    }
}

/// A GeNVS render's settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GenvsOptions {
    /// Samples on a ray.
    pub rays: Rays,
    /// The denoiser's run. Its seed is that of jitter as well.
    pub plan: Plan,
    /// Omissions.
    pub omissions: Omissions,
    /// Rows and columns of pictures are divided by this, and the pictures enlarged; 1 for whole pictures.
    pub divisor: u32,
    /// Precision of the denoiser's convolutions, on devices that have another than the exact one. Volumes and feature
    /// images, which take little of the time, are exact.
    pub precision: Precision,
}

impl Default for GenvsOptions {
    /// The fast run with seed 0.
    fn default() -> GenvsOptions {
        GenvsOptions {
            rays: Rays::default(),
            plan: Plan::fast(0),
            omissions: Omissions::default(),
            divisor: 1,
            precision: Precision::Exact,
        }
    }
}

impl Options for GenvsOptions {
    /// Where both keep volumes with as many bits; the denoiser's precision does not change them.
    fn encodes_alike(&self, other: &GenvsOptions) -> bool {
        self.omissions.half_volumes == other.omissions.half_volumes
    }
}

impl GenvsOptions {
    /// Their form in the run record, with the calls that were made and saved.
    pub(super) fn denoising(&self, calls: u64, saved_calls: u64) -> Denoising {
        let Plan { steps, schedule, churn, early_termination, .. } = self.plan;
        let (sampler, levels, tolerance) = match steps {
            Steps::Fixed { sampler, level_count } => (sampler, Some(level_count), None),
            Steps::Chosen { tolerance, .. } => (Sampler::UniPc, None, Some(tolerance)),
        };
        Denoising {
            sampler: sampler.name(),
            levels,
            tolerance,
            noise: [0, 1].map(|index| schedule.level(index, 2)),
            churn: churn.amount,
            early_termination,
            reuse: self.omissions.reuse,
            calls,
            saved_calls,
        }
    }

    /// These options with at least two samples on a ray, and pictures that are divided by at least 1.
    pub(super) fn checked(self) -> GenvsOptions {
        let rays = Rays { sample_count: self.rays.sample_count.max(2), ..self.rays };
        GenvsOptions { rays, divisor: self.divisor.max(1), ..self }
    }
}
