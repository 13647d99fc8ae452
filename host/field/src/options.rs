//! Options of learned fields. A field has defaults for missing options, and rejects options that it does not have.

use viewfuse_core::sampler::Sampler;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_nn::checkpoint::CheckpointError;

/// An omission of a family that `compute` switches off: name and help.
pub type Computable = (&'static str, &'static str);

/// Options of a learned field. Errors name them as the members here, with dashes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldOptions {
    /// Seed of every random draw.
    pub seed: u64,
    /// Leave nothing out.
    pub exact: bool,
    /// Near and far bounds of rays, world units.
    pub near_far: Option<[f32; 2]>,
    /// Samples on a ray: as many numbers as the field takes; empty for its default.
    pub samples: Vec<u32>,
    /// Omissions that are switched off, by names of the family's list.
    pub compute: Vec<String>,
    /// Second-pass samples around the depth that the published code takes.
    pub published_depth: bool,
    /// Side in pixels of the squares in which one ray is probed for empty space.
    pub probe_step: Option<u32>,
    /// The largest change of the probes' colours.
    pub probe_error: Option<f32>,
    /// Keep the grids of latents that points look up in half precision (f16).
    pub half_latents: bool,
    /// The largest and the smallest noise level.
    pub noise: Option<NoiseSchedule>,
    /// The sampler.
    pub sampler: Option<Sampler>,
    /// The number of noise levels.
    pub steps: Option<u32>,
    /// The largest error of a step of adaptive levels.
    pub tolerance: Option<f32>,
    /// Noise that is added between steps (churn), over the whole run.
    pub churn: Option<f32>,
    /// Keep views' features in half precision (f16).
    pub half_volumes: bool,
    /// The noise level at which a frame starts from the one before.
    pub reuse: Option<f32>,
}

impl FieldOptions {
    /// Names of the given options, of those that not every field has.
    pub fn given(&self) -> Vec<&'static str> {
        let all = [
            ("published-depth", self.published_depth),
            ("probe-step", self.probe_step.is_some()),
            ("probe-error", self.probe_error.is_some()),
            ("half-latents", self.half_latents),
            ("sampler", self.sampler.is_some()),
            ("steps", self.steps.is_some()),
            ("tolerance", self.tolerance.is_some()),
            ("churn", self.churn.is_some()),
            ("half-volumes", self.half_volumes),
            ("reuse", self.reuse.is_some()),
            ("noise", self.noise.is_some()),
        ];
        all.into_iter().filter(|(_, is_given)| *is_given).map(|(name, _)| name).collect()
    }

    /// Whether an omission is switched off.
    pub fn computes(&self, what: &str) -> bool {
        self.exact || self.compute.iter().any(|name| name == what)
    }
}

/// Why a learned field cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The checkpoint is of no family, or cannot be read.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// An option does not go with the network.
    #[error("{option} {problem} with a network that {reason}")]
    Refused {
        /// The option's name, perhaps with a value.
        option: String,
        /// The problem, for example "cannot be used".
        problem: &'static str,
        /// The reason, for example "is a PixelNeRF".
        reason: String,
    },
}

impl OpenError {
    /// An option that the network does not have.
    pub fn cannot(option: impl Into<String>, reason: impl Into<String>) -> OpenError {
        OpenError::Refused { option: option.into(), problem: "cannot be used", reason: reason.into() }
    }
}
