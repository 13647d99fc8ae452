//! The runs of the denoiser, from the shortest to the published one.

use super::Estimate;
use super::sampling::{Accuracy, Plan, Steps};
use crate::Effort;
use std::ops::RangeInclusive;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::schedule::NoiseSchedule;

/// Calls of the denoiser, with the error that is typical of so many, from noise alone and from the colours of the feature
/// image, and what the error is relative to what the run itself tells (host/results/efforts.md, on the network
/// of the published size, the included one, and one without colours after 200 steps of training).
const CALLS: [(u32, [f32; 2], Relative); 8] = [
    (2, [0.12, 0.08], Relative::ToLastChange(4.3)),
    (3, [0.08, 0.033], Relative::ToLastChange(1.65)),
    (4, [0.05, 0.019], Relative::ToSteps(1.35)),
    (5, [0.03, 0.013], Relative::ToSteps(1.05)),
    (6, [0.018, 0.01], Relative::ToSteps(0.64)),
    (8, [0.009, 0.008], Relative::ToSteps(0.65)),
    (12, [0.004, 0.0035], Relative::ToSteps(0.3)),
    (18, [0.0008, 0.0008], Relative::ToSteps(0.17)),
];

/// The error of a run over a part of its [`Accuracy`]; in the three networks within a factor of 1.5 of this.
#[derive(Clone, Copy)]
enum Relative {
    /// Over [`Accuracy::steps`].
    ToSteps(f32),
    /// Over [`Accuracy::last_change`]: runs of two and three steps have no or one step of two orders.
    ToLastChange(f32),
}

/// The root mean square difference of a run's picture from the exact one, colours from 0 to 1: an estimate. 0 for the exact run.
pub(super) fn error_of(effort: usize, accuracy: Accuracy) -> f32 {
    // Pictures are from -1 to 1.
    0.5 * match CALLS.get(effort) {
        Some((.., Relative::ToSteps(share))) => share * accuracy.steps,
        Some((.., Relative::ToLastChange(share))) => share * accuracy.last_change,
        None => 0.0,
    }
}

/// So few calls have other levels than the published ones, of which a good part is spent where the picture hardly changes:
/// they begin at a lower level, and end at a higher one, whose estimate is the picture. A single call is at the largest
/// level, where the estimate is the mean of all pictures that the sources allow.
const FEW: RangeInclusive<u32> = 2..=8;
/// Their largest level, from noise alone and from the colours of the feature image.
const FROM_NOISE: f32 = 20.0;
const FROM_COLOURS: f32 = 10.0;
/// Their smallest level; very few calls end earlier.
const SMALLEST: f32 = 0.05;
const VERY_FEW: (u32, f32) = (4, 0.1);

/// The share of the exact run's work that no number of calls changes: encoding, and the feature image.
const FIXED_WORK: f32 = 0.06;

/// The efforts of a run with this schedule and seed, the cheapest first.
pub(super) fn of(plan: &Plan, estimate: Estimate) -> Vec<(Effort, Plan)> {
    let exact = Plan { steps: Plan::published(plan.seed).steps, early_termination: None, ..*plan };
    let all_calls = match exact.steps {
        Steps::Fixed { sampler, level_count } => sampler.call_count(level_count),
        Steps::Chosen { most_calls, .. } => most_calls,
    };
    let few = CALLS.map(|(calls, [from_noise, from_colours], _)| {
        let work = FIXED_WORK + (1.0 - FIXED_WORK) * calls as f32 / all_calls as f32;
        let error = if estimate == Estimate::FromColours { from_colours } else { from_noise };
        let plan = Plan { compares_orders: true, ..in_calls(&exact, estimate, calls) };
        (Effort::new(format!("{calls} calls of the denoiser"), error, work), plan)
    });
    few.into_iter().chain([(Effort::exact(), exact)]).collect()
}

/// The plan with so many calls; few have their own levels, as far as these lie between the plan's.
pub(super) fn in_calls(plan: &Plan, estimate: Estimate, calls: u32) -> Plan {
    let plan = Plan { steps: Steps::Fixed { sampler: Sampler::Ipndm, level_count: calls }, ..*plan };
    if !FEW.contains(&calls) {
        return plan;
    }
    let [largest, smallest] = [0, 1].map(|index| plan.schedule.level(index, 2));
    let from_colours = estimate == Estimate::FromColours;
    let begin = if from_colours { FROM_COLOURS } else { FROM_NOISE };
    let end = if calls <= VERY_FEW.0 { VERY_FEW.1 } else { SMALLEST };
    match NoiseSchedule::new(smallest.max(end), largest.min(begin)) {
        Ok(schedule) => Plan { schedule, from_colours, ..plan },
        Err(_) => plan,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(plan: &Plan) -> [f32; 2] {
        [0, 1].map(|index| plan.schedule.level(index, 2))
    }

    #[test]
    fn few_calls_have_levels_of_their_own() {
        let all = of(&Plan::fast(3), Estimate::FromColours);
        let (first, exact) = (&all[0].1, &all[all.len() - 1].1);
        assert_eq!((ends(first), first.from_colours, first.seed), ([FROM_COLOURS, VERY_FEW.1], true, 3));
        assert_eq!((ends(exact), exact.from_colours), ([80.0, 0.002], false));
        assert_eq!(*exact, Plan { early_termination: None, ..Plan::published(3) });
        let published = of(&Plan::fast(3), Estimate::Published);
        assert_eq!((ends(&published[0].1), published[0].1.from_colours), ([FROM_NOISE, VERY_FEW.1], false));
        assert_eq!(ends(&published[5].1), [FROM_NOISE, SMALLEST]);
        assert_eq!(ends(&published[6].1), [80.0, 0.002]);
        let single = in_calls(&Plan::fast(3), Estimate::FromColours, 1);
        assert_eq!((ends(&single), single.from_colours), ([80.0, 0.002], false));
    }

    #[test]
    fn given_levels_are_kept() {
        let given = |smallest, largest| {
            let schedule = NoiseSchedule::new(smallest, largest).expect("levels");
            ends(&of(&Plan { schedule, ..Plan::fast(0) }, Estimate::Published)[0].1)
        };
        assert_eq!(given(0.5, 5.0), [5.0, 0.5]);
        // Not in the order of the few calls' levels: left as they are.
        assert_eq!(given(0.01, 0.05), [0.05, 0.01]);
        assert_eq!(given(30.0, 60.0), [60.0, 30.0]);
    }
}
