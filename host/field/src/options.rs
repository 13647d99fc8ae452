//! What a person can say about a learned field. What is not said, the field decides; what it does not know, it refuses.

use viewfuse_core::sampler::Sampler;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_nn::checkpoint::CheckpointError;

/// What a family may leave out and a person may ask to compute nevertheless: name and help.
pub type Computable = (&'static str, &'static str);

/// What a person said about a learned field. Names of options in errors are those of the members, with dashes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldOptions {
    /// Seed of every random draw.
    pub seed: u64,
    /// Leave nothing out.
    pub exact: bool,
    /// Near and far bounds of rays, world units.
    pub near_far: Option<[f32; 2]>,
    /// Samples on a ray: as many numbers as the field takes; empty if nothing was said.
    pub samples: Vec<u32>,
    /// What to compute although the scene does not need it, by names of the family's list.
    pub compute: Vec<String>,
    /// Second-pass samples around the depth that the published code takes.
    pub published_depth: bool,
    /// Pixels on a side of the square in which one ray is probed for empty space.
    pub probe_step: Option<u32>,
    /// How much the probes' colours may change.
    pub probe_error: Option<f32>,
    /// The ends of the noise levels.
    pub noise: Option<NoiseSchedule>,
    /// The sampler.
    pub sampler: Option<Sampler>,
    /// Noise levels.
    pub steps: Option<u32>,
    /// The error of a step where levels are chosen on the way.
    pub tolerance: Option<f32>,
    /// Noise that is added on the way, over the whole run.
    pub churn: Option<f32>,
    /// Keep views' features in half precision (f16).
    pub half_volumes: bool,
    /// The noise level at which a frame starts from the one before.
    pub reuse: Option<f32>,
}

impl FieldOptions {
    /// Names of what was given of the options that not every field knows.
    pub fn given(&self) -> Vec<&'static str> {
        let all = [
            ("published-depth", self.published_depth),
            ("probe-step", self.probe_step.is_some()),
            ("probe-error", self.probe_error.is_some()),
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

    /// Whether something is to be computed although the scene does not need it.
    pub fn computes(&self, what: &str) -> bool {
        self.exact || self.compute.iter().any(|name| name == what)
    }
}

/// Why a learned field cannot be had.
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
        /// What is wrong, for example "cannot be used".
        problem: &'static str,
        /// What the network is or has not, for example "is a PixelNeRF".
        reason: String,
    },
}

impl OpenError {
    /// An option that the network has no use for.
    pub fn cannot(option: impl Into<String>, reason: impl Into<String>) -> OpenError {
        OpenError::Refused { option: option.into(), problem: "cannot be used", reason: reason.into() }
    }
}
