//! Settings of a GeNVS to compare.

use super::sampling::{Plan, Steps};
use super::{Genvs, GenvsOptions, Omissions, Rays};
use crate::AnyField;
use crate::enlarged::Enlarged;
use crate::render::RenderOptions;
use crate::row::{ALL, EXACT, Preset};
use viewfuse_core::sampler::Sampler;
use viewfuse_core::sampler::control::HALF_A_LEVEL;

const NONE: Omissions = Omissions::NONE;

/// Levels of the single-step sampler of the published run, which calls the denoiser twice for each.
const HEUN: [u32; 2] = [12, 8];
/// Levels of every multistep sampler.
const LEVELS: [u32; 5] = [6, 8, 10, 12, 18];
/// Weight of the views that are left out.
const MIN_SHARES: [f32; 2] = [0.05, 0.2];
/// Levels with everything left out.
const FAST: [u32; 2] = [6, 18];
/// Error tolerances of a step, where levels are chosen adaptively.
const TOLERANCES: [f32; 2] = [0.01, 0.03];
/// The exact picture's samples on a ray are divided by this.
const FEWER: [u32; 2] = [2, 4];
/// Levels at which a picture starts from the one before.
const REUSED: [f32; 2] = [20.0, 2.0];

/// The presets for this many targets. Calls of the denoiser take nearly all of the time: other omissions
/// are compared with the default number of calls. `field` gives the rays, the first and last level and the seed; `options`
/// give the weight that `all` leaves out, the size and the background. What the field itself leaves out is ignored.
pub(super) fn of(field: &AnyField, options: &RenderOptions, target_count: usize) -> Vec<Preset> {
    let Some(field) = field.downcast_ref::<Genvs>() else { return Vec::new() };
    let GenvsOptions { rays, plan: own, .. } = field.options();
    let exact = Plan { schedule: own.schedule, ..Plan::published(own.seed) };
    let over = |plan: Plan, sampler, level_count| Plan { steps: Steps::Fixed { sampler, level_count }, ..plan };
    let careful = |plan: Plan, tolerance| match Plan::careful(own.seed).steps {
        Steps::Chosen { most_calls, .. } => Plan { steps: Steps::Chosen { tolerance, most_calls }, ..plan },
        steps => Plan { steps, ..plan },
    };
    let preset = |words: &str, rays, plan, omissions, leave_out, factor| Preset {
        words: words.to_owned(),
        field: AnyField::new(Enlarged { field: field.with_options(GenvsOptions { rays, plan, omissions }), factor }),
        options: RenderOptions { leave_out, early_termination: 0.0, ..options.clone() },
    };
    let fewer = |divisor: u32| Rays { sample_count: rays.sample_count.div_ceil(divisor), ..rays };

    let mut presets = vec![preset(EXACT, rays, exact, NONE, 0.0, 1)];
    let planned = |words: String, plan| preset(&words, rays, plan, NONE, 0.0, 1);
    presets.push(preset("unseen rows", rays, exact, Omissions { unseen_rows: true, ..NONE }, 0.0, 1));
    presets.push(preset("half volumes", rays, exact, Omissions { half_volumes: true, ..NONE }, 0.0, 1));
    presets.push(planned("early termination".to_owned(), Plan { early_termination: Some(HALF_A_LEVEL), ..exact }));
    presets.extend(HEUN.map(|count| planned(format!("heun, {count}"), over(exact, Sampler::Heun, count))));
    for sampler in Sampler::ALL.into_iter().filter(|sampler| !sampler.is_single_step()) {
        presets
            .extend(LEVELS.map(|count| planned(format!("{}, {count}", sampler.name()), over(exact, sampler, count))));
    }
    presets.extend(TOLERANCES.map(|error| planned(format!("tolerance {error}"), careful(exact, error))));

    let fast = Plan { schedule: own.schedule, ..Plan::fast(own.seed) };
    let all = |words: &str, rays, plan, reuse, factor| {
        let omissions = Omissions { reuse, ..Omissions::default() };
        preset(&format!("{ALL}{words}"), rays, plan, omissions, options.leave_out, factor)
    };
    presets.push(all("", rays, fast, None, 1));
    presets.extend(MIN_SHARES.map(|least| Preset {
        options: RenderOptions { leave_out: least, early_termination: 0.0, ..options.clone() },
        ..all(&format!(", leave out {least}"), rays, fast, None, 1)
    }));
    presets
        .extend(FAST.map(|count| all(&format!(", {count} levels"), rays, over(fast, Sampler::Ipndm, count), None, 1)));
    presets.extend(TOLERANCES.map(|error| all(&format!(", tolerance {error}"), rays, careful(fast, error), None, 1)));
    presets.extend(FEWER.map(|divisor| all(&format!(", samples 1/{divisor}"), fewer(divisor), fast, None, 1)));
    presets.push(all(", half the size", rays, fast, None, 2));
    if target_count > 1 {
        presets.extend(REUSED.map(|level| all(&format!(", reuse {level}"), rays, fast, Some(level), 1)));
    }
    presets
}
