//! Samplers over given levels with the state in `f64` and core's coefficients: what rounding of a state hides shows
//! here.

use viewfuse_core::random::normal;
use viewfuse_core::sampler::{Corrected, History, Mix, Sampler};
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_tests::mixture::{DIMENSIONS, Mixture};

/// How many data a picture has here.
pub(crate) const DATA: usize = 32;

/// The noise that runs start from, at this level.
pub(crate) fn start(sigma: f32) -> Vec<f64> {
    (0..(DATA * DIMENSIONS) as u32).map(|element| f64::from(sigma * normal([5, 0], element, 0))).collect()
}

/// The published levels, and 0.
pub(crate) fn published(count: u32) -> Vec<f32> {
    (0..=count).map(|index| NoiseSchedule::published().level(index, count)).collect()
}

pub(crate) fn mixed(mix: &Mix, state: &[f64], results: &[&[f64]]) -> Vec<f64> {
    let mut mixed: Vec<f64> = state.iter().map(|value| f64::from(mix.state) * value).collect();
    for (coefficient, result) in mix.results.iter().zip(results) {
        mixed.iter_mut().zip(*result).for_each(|(mixed, value)| *mixed += f64::from(*coefficient) * value);
    }
    // What is not there counts nothing.
    assert!(mix.results[results.len()..].iter().all(|coefficient| *coefficient == 0.0), "{mix:?}");
    mixed
}

/// The state at the last level, corrected if that is not 0; if it is, what the denoiser said last.
pub(crate) fn walk(sampler: Sampler, levels: &[f32], start: &[f64], mixture: &Mixture) -> Vec<f64> {
    let mut history = History::NONE;
    let mut results: Vec<Vec<f64>> = Vec::new();
    let mut state = start.to_vec();
    let mut begun: Option<Vec<f64>> = None;
    let said = |state: &[f64], sigma: f32| mixture.denoised(state, f64::from(sigma));
    for (index, sigma) in levels.iter().enumerate() {
        if *sigma == 0.0 {
            break;
        }
        let denoised = said(&state, *sigma);
        if let Some(begun) = begun.take() {
            let all: Vec<&[f64]> = std::iter::once(&denoised).chain(&results).take(4).map(Vec::as_slice).collect();
            state = mixed(&sampler.correction(&history, *sigma), &begun, &all);
        }
        let Some(next) = levels.get(index + 1) else { break };
        let kept = sampler.kept(*sigma).map_or_else(|| denoised.clone(), |mix| mixed(&mix, &state, &[&denoised]));
        history.push(*sigma);
        results.insert(0, kept);
        results.truncate(sampler.result_count() as usize);
        let all: Vec<&[f64]> = results.iter().map(Vec::as_slice).collect();
        let reached = mixed(&sampler.step(&history, *next), &state, &all);
        let before = std::mem::replace(&mut state, reached);
        if sampler.corrected() == Corrected::ByAnotherCall && *next > 0.0 {
            let there = said(&state, *next);
            state = mixed(&sampler.correction(&history, *next), &state, &[&there, &results[0]]);
        }
        if sampler.corrected() == Corrected::ByTheNextCall {
            begun = Some(before);
        }
    }
    state
}

/// Small numbers beside one another.
pub(crate) fn row(values: &[f64]) -> String {
    values.iter().map(|value| format!("{value:7.1e}")).collect::<Vec<_>>().join(" ")
}
