//! The runs of the denoiser, from the shortest to the published one.

use super::sampling::{Plan, Steps};
use crate::Effort;
use viewfuse_core::sampler::Sampler;

/// Calls of the denoiser, with the error that is typical of so many (the example `efforts` of `viewfuse-evaluate`).
const CALLS: [(u32, f32); 7] = [(2, 0.12), (3, 0.05), (4, 0.044), (6, 0.02), (8, 0.0146), (12, 0.003), (18, 0.0008)];

/// The share of the exact run's work that no number of calls changes: encoding, and the feature image.
const FIXED_WORK: f32 = 0.06;

/// The efforts of a run with this schedule and seed, the cheapest first.
pub(super) fn of(plan: &Plan) -> Vec<(Effort, Plan)> {
    let exact = Plan { steps: Plan::published(plan.seed).steps, early_termination: None, ..*plan };
    let all_calls = match exact.steps {
        Steps::Fixed { sampler, level_count } => sampler.call_count(level_count),
        Steps::Chosen { most_calls, .. } => most_calls,
    };
    let few = CALLS.map(|(calls, error)| {
        let steps = Steps::Fixed { sampler: Sampler::Ipndm, level_count: calls };
        let work = FIXED_WORK + (1.0 - FIXED_WORK) * calls as f32 / all_calls as f32;
        (Effort::new(format!("{calls} calls of the denoiser"), error, work), Plan { steps, ..exact })
    });
    few.into_iter().chain([(Effort::exact(), exact)]).collect()
}
