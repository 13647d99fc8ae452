//! The settings tried for GeNVS.

use super::super::Setting;
use super::{ALL, EXACT};
use viewfuse_core::sampler::Sampler;
use viewfuse_core::sampler::control::HALF_A_LEVEL;
use viewfuse_field::AnyField;
use viewfuse_field::enlarged::Enlarged;
use viewfuse_field::genvs::sampling::{Plan, Steps};
use viewfuse_field::genvs::{Genvs, GenvsOptions, Omissions, Rays};
use viewfuse_field::render::RenderOptions;

const NONE: Omissions = Omissions::NONE;

/// Levels of the single-step sampler of the published run, which calls the denoiser twice for each.
const HEUN: [u32; 2] = [12, 8];
/// Levels of every multistep sampler.
const LEVELS: [u32; 5] = [6, 8, 10, 12, 18];
/// Weight of the views that are left out.
const MIN_SHARES: [f32; 2] = [0.05, 0.2];
/// Levels with everything skipped.
const FAST: [u32; 2] = [6, 18];
/// Error tolerances of a step, where levels are chosen adaptively.
const TOLERANCES: [f32; 2] = [0.01, 0.03];
/// The exact picture's samples on a ray are divided by this.
const FEWER: [u32; 2] = [2, 4];
/// Levels at which a picture starts from the one before.
const REUSED: [f32; 2] = [20.0, 2.0];

/// The settings of a GeNVS for this many targets. Calls of the denoiser take nearly all of the time: other omissions
/// are tried with the default number of calls. `field` gives the rays, the first and last level and the seed; `options`
/// give the weight that `all` leaves out, the size and the background. What the field itself skips is ignored.
pub(super) fn of_genvs(field: &Genvs, options: &RenderOptions, target_count: usize) -> Vec<Setting> {
    let GenvsOptions { rays, plan: own, .. } = field.options();
    let exact = Plan { schedule: own.schedule, ..Plan::published(own.seed) };
    let over = |plan: Plan, sampler, level_count| Plan { steps: Steps::Fixed { sampler, level_count }, ..plan };
    let careful = |plan: Plan, tolerance| match Plan::careful(own.seed).steps {
        Steps::Chosen { most_calls, .. } => Plan { steps: Steps::Chosen { tolerance, most_calls }, ..plan },
        steps => Plan { steps, ..plan },
    };
    let setting = |words: &str, rays, plan, omissions, leave_out, factor| Setting {
        words: words.to_owned(),
        field: AnyField::from(Enlarged { field: field.with_options(GenvsOptions { rays, plan, omissions }), factor }),
        options: RenderOptions { leave_out, early_termination: 0.0, ..options.clone() },
    };
    let fewer = |divisor: u32| Rays { sample_count: rays.sample_count.div_ceil(divisor), ..rays };

    let mut settings = vec![setting(EXACT, rays, exact, NONE, 0.0, 1)];
    let planned = |words: String, plan| setting(&words, rays, plan, NONE, 0.0, 1);
    settings.push(setting("unseen rows", rays, exact, Omissions { unseen_rows: true, ..NONE }, 0.0, 1));
    settings.push(setting("half volumes", rays, exact, Omissions { half_volumes: true, ..NONE }, 0.0, 1));
    settings.push(planned("early termination".to_owned(), Plan { early_termination: Some(HALF_A_LEVEL), ..exact }));
    settings.extend(HEUN.map(|count| planned(format!("heun, {count}"), over(exact, Sampler::Heun, count))));
    for sampler in Sampler::ALL.into_iter().filter(|sampler| !sampler.is_single_step()) {
        settings
            .extend(LEVELS.map(|count| planned(format!("{}, {count}", sampler.name()), over(exact, sampler, count))));
    }
    settings.extend(TOLERANCES.map(|error| planned(format!("tolerance {error}"), careful(exact, error))));

    let fast = Plan { schedule: own.schedule, ..Plan::fast(own.seed) };
    let all = |words: &str, rays, plan, reuse, factor| {
        let omissions = Omissions { reuse, ..Omissions::default() };
        setting(&format!("{ALL}{words}"), rays, plan, omissions, options.leave_out, factor)
    };
    settings.push(all("", rays, fast, None, 1));
    settings.extend(MIN_SHARES.map(|least| Setting {
        options: RenderOptions { leave_out: least, early_termination: 0.0, ..options.clone() },
        ..all(&format!(", leave out {least}"), rays, fast, None, 1)
    }));
    settings
        .extend(FAST.map(|count| all(&format!(", {count} levels"), rays, over(fast, Sampler::Ipndm, count), None, 1)));
    settings.extend(TOLERANCES.map(|error| all(&format!(", tolerance {error}"), rays, careful(fast, error), None, 1)));
    settings.extend(FEWER.map(|divisor| all(&format!(", samples 1/{divisor}"), fewer(divisor), fast, None, 1)));
    settings.push(all(", half the size", rays, fast, None, 2));
    if target_count > 1 {
        settings.extend(REUSED.map(|level| all(&format!(", reuse {level}"), rays, fast, Some(level), 1)));
    }
    settings
}
