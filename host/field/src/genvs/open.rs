//! Opens a GeNVS from a checkpoint with a person's options.

use super::sampling::{Plan, Steps};
use super::{Genvs, GenvsOptions, Omissions, Rays};
use crate::AnyField;
use crate::enlarged::Enlarged;
use crate::options::{Computable, FieldOptions, OpenError};
use viewfuse_core::sampler::churn::Churn;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_nn::checkpoint::Checkpoint;

/// Omissions that `compute` switches off.
pub const COMPUTABLE: &[Computable] = &[
    ("rows", "GeNVS: rows of volumes that no ray reaches"),
    ("calls", "GeNVS: calls of the denoiser without a visible effect"),
];

/// Opens the network with these options.
///
/// # Errors
/// [`OpenError`] if the checkpoint cannot be used, or an option does not fit.
pub fn open(checkpoint: Checkpoint, options: &FieldOptions) -> Result<AnyField, OpenError> {
    let default = Rays::default();
    let sample_count = match options.samples[..] {
        [] => default.sample_count,
        [count] if count >= 2 => count,
        _ => {
            let (option, reason) = ("samples".to_owned(), "is a GeNVS".to_owned());
            return Err(OpenError::Refused { option, problem: "takes one number, at least 2,", reason });
        }
    };
    let rays = Rays { sample_count, near_far: options.near_far, ..default };
    let omissions = Omissions {
        unused_views: !options.computes("views"),
        unseen_rows: !options.computes("rows"),
        reuse: options.reuse,
        half_volumes: options.half_volumes,
    };
    let field = Genvs::new(checkpoint, GenvsOptions { rays, plan: plan(options), omissions })?;
    match (options.given().first(), &field.architecture().denoiser) {
        // All options of this family alone concern the denoiser or sequences of pictures.
        (Some(option), None) => Err(OpenError::cannot(*option, "has no denoiser")),
        _ => Ok(field.into()),
    }
}

impl From<Genvs> for AnyField {
    /// Compiled here for both devices, not again in every crate that calls it.
    #[inline(never)]
    fn from(field: Genvs) -> AnyField {
        AnyField::new(field)
    }
}

impl From<Enlarged<Genvs>> for AnyField {
    /// As above.
    #[inline(never)]
    fn from(field: Enlarged<Genvs>) -> AnyField {
        AnyField::new(field)
    }
}

/// The published run if nothing may be left out, otherwise the fast one; given options take precedence.
fn plan(options: &FieldOptions) -> Plan {
    let seed = options.seed;
    let plan = if options.exact { Plan::published(seed) } else { Plan::fast(seed) };
    let steps = match (options.tolerance, Plan::careful(seed).steps, plan.steps) {
        (Some(tolerance), Steps::Chosen { most_calls, .. }, _) => Steps::Chosen { tolerance, most_calls },
        (_, _, Steps::Fixed { sampler, level_count }) => Steps::Fixed {
            sampler: options.sampler.unwrap_or(sampler),
            level_count: options.steps.unwrap_or(level_count),
        },
        (_, _, steps) => steps,
    };
    Plan {
        steps,
        schedule: options.noise.unwrap_or_else(NoiseSchedule::published),
        from_colours: false,
        compares_orders: false,
        churn: Churn { amount: options.churn.unwrap_or(0.0), ..Churn::NONE },
        early_termination: plan.early_termination.filter(|_| !options.computes("calls")),
        seed,
    }
}
