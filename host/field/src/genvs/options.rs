//! What a person can set about a GeNVS render, and what may be left out of it.

use super::super::Denoising;
use super::sampling::{Plan, Steps};
use viewfuse_core::sampler::Sampler;

/// Samples on a ray, and where they go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rays {
    /// How many samples a ray has, evenly spread from its beginning to its end, at least 2.
    pub sample_count: u32,
    /// How far samples stray at random, in halves of their distance: 1 as published, 0 (the default) not at all, so that
    /// neighbouring frames have the same error.
    pub jitter: f32,
    /// Depths along the target's principal axis where rays begin and end; `None`: by the sources' distance from what they
    /// look at. The first must be smaller.
    pub near_far: Option<[f32; 2]>,
    /// How long a ray is in the lengths that the network's densities are for; `None`: as published for SRN, 1 over the
    /// focal length in halves of the image's height.
    pub length: Option<f32>,
    /// Whether samples shade themselves, as in published checkpoints.
    pub inclusive: bool,
}

impl Default for Rays {
    /// As published, but without jitter.
    fn default() -> Rays {
        Rays { sample_count: 64, jitter: 0.0, near_far: None, length: None, inclusive: true }
    }
}

/// What may be left out. Each is a switch of its own; how many calls of the denoiser there are is the plan's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Omissions {
    /// The encoding of views that no target uses. Exact.
    pub unused_views: bool,
    /// Rows of volumes that no ray of a target reaches, at the encoder's last layer. Exact.
    pub unseen_rows: bool,
    /// Levels of the denoiser above this one, where there is a frame before: it is given noise of that level, and the run
    /// goes on from there. `None`: every frame starts from noise alone.
    pub reuse: Option<f32>,
    /// Half of the bits of volumes: features are off by up to 2^-11 of what they are, beyond 65504 they are that. All rows
    /// are computed at once then.
    pub half_volumes: bool,
}

impl Omissions {
    /// Nothing is left out.
    pub const NONE: Omissions = Omissions { unused_views: false, unseen_rows: false, reuse: None, half_volumes: false };
    /// All that is left out unless a person says otherwise: what costs nothing.
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
    /// From noise to a picture. Its seed is that of jitter as well.
    pub plan: Plan,
    /// What may be left out.
    pub omissions: Omissions,
}

impl Default for GenvsOptions {
    /// Fast, from seed 0.
    fn default() -> GenvsOptions {
        GenvsOptions { rays: Rays::default(), plan: Plan::fast(0), omissions: Omissions::default() }
    }
}

impl GenvsOptions {
    /// What a run record says of them, with so many calls made and so many saved.
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

    /// With at least two samples on a ray.
    pub(super) fn checked(self) -> GenvsOptions {
        GenvsOptions { rays: Rays { sample_count: self.rays.sample_count.max(2), ..self.rays }, ..self }
    }
}
