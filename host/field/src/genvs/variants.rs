//! The variants of a GeNVS: its efforts, from the shortest run of the denoiser to the published one, and what `pareto`
//! draws. A new one is a line of a table here.

use super::sampling::{Accuracy, Plan, Steps};
use super::{Estimate, Genvs, GenvsOptions, Omissions, Rays};
use crate::AnyField;
use crate::render::RenderOptions;
use crate::rounding::{Rounding, rounded};
use crate::row::{ALL, Drawn};
use crate::variant::{EXACT, Variant};
use std::ops::RangeInclusive;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::sampler::control::HALF_A_LEVEL;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_device::Precision;

/// Calls of the denoiser, with the error that is typical of so many, from noise alone and from the colours of the
/// feature image, and what the error is relative to what the run itself tells (`host/results/efforts.md`,
/// on the network of the published size, the included one, and one without colours after 200 steps of training).
const CALLS: [(u32, [f32; 2], Relative); 9] = [
    (2, [0.12, 0.08], Relative::ToLastChange(4.3)),
    (3, [0.08, 0.033], Relative::ToLastChange(1.65)),
    (4, [0.05, 0.019], Relative::ToSteps(1.35)),
    (5, [0.03, 0.013], Relative::ToSteps(1.05)),
    (6, [0.018, 0.01], Relative::ToSteps(0.64)),
    (8, [0.009, 0.008], Relative::ToSteps(0.65)),
    (12, [0.004, 0.0035], Relative::ToSteps(0.3)),
    (14, [0.0028, 0.0025], Relative::ToSteps(0.25)),
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

/// Pictures of less than half the side of the network's training have so many times the error: of 56 of a quarter of
/// it, one had more than 1.5 times that (`host/results/bounds.md`).
const OF_SMALL: f32 = 1.75;

/// What rounded products are typically worth. Errors: emulated on the network of the published size, with an encoder
/// and feature images that are rounded too, 61.5 and 89 dB from the exact picture; times: what convolutions take of a
/// picture, at the rates of prototypes on a GPU (`host/results/efforts.md`).
const ROUNDINGS: [Rounding; 3] = [
    Rounding { precision: Precision::Half, typical_error: 8.4e-4, typical_share: 0.7 },
    Rounding { precision: Precision::TwoHalves, typical_error: 3.6e-5, typical_share: 0.8 },
    // No coarser than two parts, which round more.
    Rounding { precision: Precision::Fused, typical_error: 3.6e-5, typical_share: 0.8 },
];
/// What rounding changes in a picture over what it changes in an estimate at the largest level, both with colours from
/// 0 to 1 (`host/results/efforts.md`).
const GROWTH: f32 = 3.0;

/// The root mean square difference from the exact picture, colours from 0 to 1, of a denoiser whose estimate at the
/// largest level changes by this, values from -1 to 1: an estimate.
pub(super) fn rounding_error(change: f32) -> f32 {
    0.5 * GROWTH * change
}

/// The plan of the exact picture.
fn exact_plan(plan: &Plan) -> Plan {
    let steps = Plan::published(plan.seed).steps;
    Plan { steps, early_termination: None, compares_orders: false, ..*plan }
}

/// The root mean square difference of an effort's picture from the exact one, colours from 0 to 1, without what
/// rounding changes: an estimate. Infinite for other runs. `share` is the picture's longer side over that of the
/// network's training.
pub(super) fn error_of(plan: &Plan, accuracy: Accuracy, share: f32) -> f32 {
    if *plan == exact_plan(plan) {
        return 0.0;
    }
    let is_own = |(calls, ..): &&(u32, [f32; 2], Relative)| {
        plan.compares_orders && plan.steps == Steps::Fixed { sampler: Sampler::Ipndm, level_count: *calls }
    };
    // Pictures are from -1 to 1.
    let of_size = if share < 0.5 { OF_SMALL } else { 1.0 };
    0.5 * of_size
        * match CALLS.iter().find(is_own) {
            Some((.., Relative::ToSteps(share))) => share * accuracy.steps,
            Some((.., Relative::ToLastChange(share))) => share * accuracy.last_change,
            None => f32::INFINITY,
        }
}

/// So few calls have other levels than the published ones, of which a good part is spent where the picture hardly
/// changes: they begin at a lower level, and end at a higher one, whose estimate is the picture. A single call is at
/// the largest level, where the estimate is the mean of all pictures that the sources allow.
const FEW: RangeInclusive<u32> = 2..=8;
/// Their largest level, from noise alone and from the colours of the feature image.
const FROM_NOISE: f32 = 20.0;
const FROM_COLOURS: f32 = 10.0;
/// Their smallest level; very few calls end earlier.
const SMALLEST: f32 = 0.05;
const VERY_FEW: (u32, f32) = (4, 0.1);

/// Levels of the single-step sampler of the published run, which calls the denoiser twice for each.
const HEUN: [u32; 2] = [12, 8];
/// Levels of every multistep sampler.
const LEVELS: [u32; 5] = [6, 8, 10, 12, 18];
/// Weight of the views that are dropped.
const MIN_SHARES: [f32; 2] = [0.05, 0.2];
/// Levels with everything omitted.
const FAST: [u32; 2] = [6, 18];
/// Error tolerances of a step, where levels are chosen adaptively.
const TOLERANCES: [f32; 2] = [0.01, 0.03];
/// The exact picture's samples on a ray are divided by this.
const FEWER: [u32; 2] = [2, 4];
/// Levels at which a picture starts from the one before.
const REUSED: [f32; 2] = [20.0, 2.0];

/// The share of the exact run's work that no number of calls changes: encoding, and the feature image.
const FIXED_WORK: f32 = 0.06;

/// The efforts of these options, with a denoiser of this kind, the cheapest first. On a device with other precisions
/// than the exact one, all but the exact effort use them.
pub(super) fn efforts(
    options: &GenvsOptions,
    estimate: Estimate,
    precisions: &[Precision],
) -> Vec<Variant<GenvsOptions>> {
    let exact = exact_plan(&options.plan);
    let all_calls = match exact.steps {
        Steps::Fixed { sampler, level_count } => sampler.call_count(level_count),
        Steps::Chosen { most_calls, .. } => most_calls,
    };
    let few = CALLS.map(|(calls, [from_noise, from_colours], _)| {
        let work = FIXED_WORK + (1.0 - FIXED_WORK) * calls as f32 / all_calls as f32;
        let error = if estimate == Estimate::FromColours { from_colours } else { from_noise };
        let plan = Plan { compares_orders: true, ..in_calls(&exact, estimate, calls) };
        Variant::new(format!("{calls} calls of the denoiser"), GenvsOptions { plan, ..*options }, error, work)
    });
    let exact = GenvsOptions { plan: exact, precision: Precision::Exact, ..*options };
    let all = few.into_iter().chain([Variant::exact(exact)]).collect();
    rounded(all, precisions, &ROUNDINGS, |options, precision| GenvsOptions { precision, ..*options })
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

/// What `pareto` draws for this many targets. Calls of the denoiser take nearly all of the time: other omissions are
/// compared with the default number of calls. `field` gives the rays, the first and last level and the seed; `options`
/// give the weight that `all` leaves out, the size and the background. What the field itself omits is ignored.
pub(super) fn drawn(
    field: &AnyField,
    options: &RenderOptions,
    target_count: usize,
    precisions: &[Precision],
) -> Vec<Drawn> {
    let Some(field) = field.downcast_ref::<Genvs>() else { return Vec::new() };
    let GenvsOptions { rays, plan: Plan { schedule, seed, .. }, .. } = field.options();
    let exact = Plan { schedule, ..Plan::published(seed) };
    let over = |plan: Plan, sampler, level_count| Plan { steps: Steps::Fixed { sampler, level_count }, ..plan };
    let variant = |label: &str, changed: GenvsOptions, leave_out| {
        let field = AnyField::new(field.with_options(changed));
        Variant::to_measure(label, (field, RenderOptions { leave_out, early_termination: 0.0, ..options.clone() }))
    };
    let precision = Precision::Exact;
    let alone = GenvsOptions { rays, plan: exact, omissions: Omissions::NONE, divisor: 1, precision };
    let planned = |label: String, plan| variant(&label, GenvsOptions { plan, ..alone }, 0.0);
    let omitting = |label: &str, omissions| variant(label, GenvsOptions { omissions, ..alone }, 0.0);

    let in_precision =
        |precision: &Precision| variant(precision.name(), GenvsOptions { precision: *precision, ..alone }, 0.0);

    let mut drawn = vec![variant(EXACT, alone, 0.0)];
    drawn.extend(precisions.iter().map(in_precision));
    drawn.push(omitting("unseen rows", Omissions { unseen_rows: true, ..Omissions::NONE }));
    drawn.push(omitting("half volumes", Omissions { half_volumes: true, ..Omissions::NONE }));
    drawn.push(planned("early termination".to_owned(), Plan { early_termination: Some(HALF_A_LEVEL), ..exact }));
    drawn.extend(HEUN.map(|count| planned(format!("heun, {count}"), over(exact, Sampler::Heun, count))));
    for sampler in Sampler::ALL.into_iter().filter(|sampler| !sampler.is_single_step()) {
        drawn.extend(LEVELS.map(|count| planned(format!("{}, {count}", sampler.name()), over(exact, sampler, count))));
    }
    let within = |plan: Plan, tolerance| Plan { steps: Steps::within(tolerance), ..plan };
    drawn.extend(TOLERANCES.map(|error| planned(format!("tolerance {error}"), within(exact, error))));

    let fast = Plan { schedule, ..Plan::fast(seed) };
    let together = GenvsOptions { plan: fast, omissions: Omissions::default(), ..alone };
    let all = |label: String, changed| variant(&format!("{ALL}{label}"), changed, options.leave_out);
    drawn.push(all(String::new(), together));
    drawn.extend(MIN_SHARES.map(|least| variant(&format!("{ALL}, leave out {least}"), together, least)));
    let steps = |plan| GenvsOptions { plan, ..together };
    drawn.extend(FAST.map(|count| all(format!(", {count} levels"), steps(over(fast, Sampler::Ipndm, count)))));
    drawn.extend(TOLERANCES.map(|error| all(format!(", tolerance {error}"), steps(within(fast, error)))));
    let fewer = |divisor| Rays { sample_count: rays.sample_count.div_ceil(divisor), ..rays };
    drawn.extend(FEWER.map(|by| all(format!(", samples 1/{by}"), GenvsOptions { rays: fewer(by), ..together })));
    drawn.push(all(", half the size".to_owned(), GenvsOptions { divisor: 2, ..together }));
    if target_count > 1 {
        let reusing = |level| Omissions { reuse: Some(level), ..Omissions::default() };
        drawn.extend(
            REUSED.map(|level| all(format!(", reuse {level}"), GenvsOptions { omissions: reusing(level), ..together })),
        );
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ends(plan: &Plan) -> [f32; 2] {
        [0, 1].map(|index| plan.schedule.level(index, 2))
    }

    fn plans(plan: Plan, estimate: Estimate) -> Vec<Plan> {
        let options = GenvsOptions { plan, ..GenvsOptions::default() };
        efforts(&options, estimate, &[]).into_iter().map(|effort| effort.options.plan).collect()
    }

    #[test]
    fn few_calls_have_levels_of_their_own() {
        let all = plans(Plan::fast(3), Estimate::FromColours);
        let (first, exact) = (&all[0], &all[all.len() - 1]);
        assert_eq!((ends(first), first.from_colours, first.seed), ([FROM_COLOURS, VERY_FEW.1], true, 3));
        assert_eq!((ends(exact), exact.from_colours), ([80.0, 0.002], false));
        assert_eq!(*exact, Plan { early_termination: None, ..Plan::published(3) });
        let published = plans(Plan::fast(3), Estimate::Published);
        assert_eq!((ends(&published[0]), published[0].from_colours), ([FROM_NOISE, VERY_FEW.1], false));
        assert_eq!(ends(&published[5]), [FROM_NOISE, SMALLEST]);
        assert_eq!(ends(&published[6]), [80.0, 0.002]);
        let single = in_calls(&Plan::fast(3), Estimate::FromColours, 1);
        assert_eq!((ends(&single), single.from_colours), ([80.0, 0.002], false));
    }

    #[test]
    fn small_pictures_have_more_error_than_their_steps_tell() {
        let plan = in_calls(&Plan::fast(3), Estimate::FromColours, 6);
        let accuracy = Accuracy { steps: 0.02, last_change: 0.01 };
        let of = |share: f32| error_of(&Plan { compares_orders: true, ..plan }, accuracy, share);
        assert!(of(1.0) > 0.0 && of(1.0) == of(0.5));
        assert_eq!(of(0.49), OF_SMALL * of(1.0));
    }

    #[test]
    fn given_levels_are_kept() {
        let given = |smallest, largest| {
            let schedule = NoiseSchedule::new(smallest, largest).expect("levels");
            ends(&plans(Plan { schedule, ..Plan::fast(0) }, Estimate::Published)[0])
        };
        assert_eq!(given(0.5, 5.0), [5.0, 0.5]);
        // Not in the order of the few calls' levels: left as they are.
        assert_eq!(given(0.01, 0.05), [0.05, 0.01]);
        assert_eq!(given(30.0, 60.0), [60.0, 30.0]);
    }
}
