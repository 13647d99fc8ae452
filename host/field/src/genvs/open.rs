//! The row of GeNVS, and how its network is opened with a person's options.

use super::sampling::{Plan, Steps};
use super::{Genvs, GenvsOptions, Omissions, Rays, presets, test_networks};
use crate::AnyField;
use crate::learned::{NEAR_FAR, parse_near_far};
use crate::options::{BOUNDS, BOUNDS_OR_EXACT, FieldOptions, Flag, FlagAbout, OpenError, count, list, number};
use crate::record::{Omission, VIEWS};
use crate::row::{Origin, Row, Small, TestNetwork};
use viewfuse_core::sampler::Sampler;
use viewfuse_core::sampler::churn::Churn;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_nn::checkpoint::Checkpoint;

/// GeNVS's row.
pub(crate) const ROW: Row = Row {
    name: "genvs",
    title: "GeNVS",
    heading: "Options of GeNVS",
    origin: Origin::Learned {
        prefix: "pixel_nerf_net.",
        test_networks: &[TestNetwork {
            name: "genvs",
            small: Small::One,
            checkpoint: test_networks::deterministic_of_size,
        }],
        open,
    },
    flags: &[
        Flag::new(SAMPLES, "N,N,N|N", "Samples on a ray of a GeNVS [default: 64]", |text| parse_samples(text).map(drop)),
        NEAR_FAR,
        Flag::new(NOISE, "MAX,MIN", "Largest and smallest noise level [default: 80,0.002]", |text| {
            parse_noise(text).map(drop)
        }),
        Flag::new(
            SAMPLER,
            "NAME",
            "Sampler: euler, heun, dpm++2m, dpm++3m, unipc, ipndm [default: ipndm, with --exact heun]",
            |text| parse_sampler(text).map(drop),
        )
        .about(FlagAbout::Effort, BOUNDS),
        Flag::new(
            STEPS,
            "N",
            "Noise levels. Each takes one call of the denoiser; with heun two, except the last [default: 10, with --exact 25]",
            |text| parse_steps(text).map(drop),
        )
        .about(FlagAbout::Effort, BOUNDS),
        Flag::new(
            TOLERANCE,
            "ERROR",
            "Choose the levels adaptively, with each step's error below this (root mean square, of values between -1 and 1); \
             0.01 is just visible",
            |text| parse_tolerance(text).map(drop),
        )
        .about(FlagAbout::Effort, &["max_error", "max_time", SAMPLER, STEPS]),
        Flag::new(
            CHURN,
            "AMOUNT",
            "Add this amount of noise between steps over the whole run; multistep samplers start again each time, so use heun",
            |text| parse_churn(text).map(drop),
        )
        .about(FlagAbout::Effort, &[TOLERANCE]),
        Flag::switch(
            HALF_VOLUMES,
            "Keep views' features in half precision (f16): half the memory, but every row of them is computed",
        )
        .about(FlagAbout::Effort, BOUNDS_OR_EXACT),
        Flag::new(
            REUSE,
            "LEVEL",
            "Start each frame from the one before with noise of this level, about the size of the differences between \
             frames: for orbits",
            |text| parse_level(text).map(drop),
        )
        .about(FlagAbout::Sequence, BOUNDS_OR_EXACT),
    ],
    omissions: &[ROWS, CALLS],
    presets: presets::of,
};

pub(super) const ROWS: Omission =
    Omission { name: "rows", what: "volume rows", part: "that no ray reaches", typical_error: "nothing" };
pub(super) const CALLS: Omission = Omission {
    name: "calls",
    what: "denoiser calls",
    part: "without a visible effect",
    typical_error: "invisible changes of a pixel; the error of starting from the frame before must be measured",
};

const SAMPLES: &str = "samples";
const NOISE: &str = "noise";
const SAMPLER: &str = "sampler";
const STEPS: &str = "steps";
const TOLERANCE: &str = "tolerance";
const CHURN: &str = "churn";
const HALF_VOLUMES: &str = "half-volumes";
const REUSE: &str = "reuse";
/// The flags that concern the denoiser or sequences of pictures.
const OF_DENOISER: [&str; 7] = [NOISE, SAMPLER, STEPS, TOLERANCE, CHURN, HALF_VOLUMES, REUSE];

fn parse_samples(text: &str) -> Result<u32, String> {
    count(text, 2..=1024).map_err(|_| "one number, at least 2, for example 64".to_owned())
}

fn parse_sampler(text: &str) -> Result<Sampler, String> {
    text.parse().map_err(|error: <Sampler as std::str::FromStr>::Err| error.to_string())
}

fn parse_steps(text: &str) -> Result<u32, String> {
    count(text, 1..=1000)
}

fn parse_tolerance(text: &str) -> Result<f32, String> {
    number(text, |error| error > 0.0 && error <= 1.0, "a number above 0 and at most 1")
}

fn parse_churn(text: &str) -> Result<f32, String> {
    number(text, |amount| (0.0..=1000.0).contains(&amount), "a number from 0 to 1000")
}

fn parse_noise(text: &str) -> Result<NoiseSchedule, String> {
    match list(text).as_deref() {
        Some(&[largest, smallest]) => NoiseSchedule::new(smallest, largest).map_err(|error| error.to_string()),
        _ => Err("two noise levels, the largest first, for example 80,0.002".to_owned()),
    }
}

/// A noise level.
fn parse_level(text: &str) -> Result<f32, String> {
    number(text, |level| level > 0.0 && level.is_finite(), "a number above 0")
}

/// Opens the network with these options.
fn open(checkpoint: Checkpoint, options: &FieldOptions) -> Result<AnyField, OpenError> {
    let default = Rays::default();
    let sample_count = options.value(SAMPLES, parse_samples).unwrap_or(default.sample_count);
    let rays = Rays { sample_count, near_far: options.value(NEAR_FAR.name, parse_near_far), ..default };
    let omissions = Omissions {
        unused_views: !options.computes(VIEWS.name),
        unseen_rows: !options.computes(ROWS.name),
        reuse: options.value(REUSE, parse_level),
        half_volumes: options.is_given(HALF_VOLUMES),
    };
    let field = Genvs::new(checkpoint, GenvsOptions { rays, plan: plan(options), omissions })?;
    match (OF_DENOISER.iter().find(|flag| options.is_given(flag)), &field.architecture().denoiser) {
        (Some(flag), None) => Err(OpenError::cannot(*flag, "has no denoiser")),
        _ => Ok(AnyField::new(field)),
    }
}

/// The published run if nothing may be left out, otherwise the fast one; given options take precedence.
fn plan(options: &FieldOptions) -> Plan {
    let seed = options.seed;
    let plan = if options.exact { Plan::published(seed) } else { Plan::fast(seed) };
    let steps = match (options.value(TOLERANCE, parse_tolerance), Plan::careful(seed).steps, plan.steps) {
        (Some(tolerance), Steps::Chosen { most_calls, .. }, _) => Steps::Chosen { tolerance, most_calls },
        (_, _, Steps::Fixed { sampler, level_count }) => Steps::Fixed {
            sampler: options.value(SAMPLER, parse_sampler).unwrap_or(sampler),
            level_count: options.value(STEPS, parse_steps).unwrap_or(level_count),
        },
        (_, _, steps) => steps,
    };
    Plan {
        steps,
        schedule: options.value(NOISE, parse_noise).unwrap_or_else(NoiseSchedule::published),
        from_colours: false,
        compares_orders: false,
        churn: Churn { amount: options.value(CHURN, parse_churn).unwrap_or(0.0), ..Churn::NONE },
        early_termination: plan.early_termination.filter(|_| !options.computes(CALLS.name)),
        seed,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_names_every_sampler() {
        let help = ROW.flags.iter().find(|flag| flag.name == SAMPLER).expect("a flag").help;
        assert!(help.starts_with(&format!("Sampler: {} [", Sampler::ALL.map(Sampler::name).join(", "))), "{help}");
    }
}
