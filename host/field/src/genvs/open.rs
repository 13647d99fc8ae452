//! The row of GeNVS, and how its network is opened with a person's options.

use super::sampling::{Plan, Steps};
use super::{Genvs, GenvsOptions, test_networks, variants};
use crate::AnyField;
use crate::learned::{NEAR_FAR, parse_near_far};
use crate::options::{BOUNDS, BOUNDS_OR_EXACT, Given, OpenError, count, flags, list, number, switch};
use crate::record::{Omission, VIEWS};
use crate::row::{Origin, Row, Small, TestNetwork};
use viewfuse_core::sampler::Sampler;
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
    flags: FLAGS,
    omissions: &[ROWS, CALLS],
    drawn: variants::drawn,
};

pub(super) const ROWS: Omission =
    Omission { name: "rows", what: "volume rows", part: "that no ray reaches", typical_error: "nothing" };
pub(super) const CALLS: Omission = Omission {
    name: "calls",
    what: "denoiser calls",
    part: "without a visible effect",
    typical_error: "invisible changes of a pixel; the error of starting from the frame before must be measured",
};

flags! {
    GenvsOptions;
    "samples", "N,N,N|N", parse_samples, Picture, &[],
        "Samples on a ray of a GeNVS [default: 64]",
        |options, count| options.rays.sample_count = count;
    "near-far", "NEAR,FAR", parse_near_far, Picture, &[], NEAR_FAR, |options,
    bounds| options.rays.near_far = Some(bounds);
    "noise", "MAX,MIN", parse_noise, Picture, &[],
        "Largest and smallest noise level [default: 80,0.002]",
        |options, schedule| options.plan.schedule = schedule;
    "sampler", "NAME", parse_sampler, Effort, BOUNDS,
        "Sampler: heun, unipc, ipndm [default: ipndm; heun where nothing is omitted]",
        |options, given| if let Steps::Fixed { sampler, .. } = &mut options.plan.steps {
            *sampler = given;
        };
    "steps", "N", parse_steps, Effort, BOUNDS,
        "Noise levels. Each takes one call of the denoiser; with heun two, except the last [default: as many as the \
         bound on the error needs; 10 beside other options of what is omitted; 25 where nothing is]",
        |options, given| if let Steps::Fixed { level_count, .. } = &mut options.plan.steps {
            *level_count = given;
        };
    "tolerance", "ERROR", parse_tolerance, Effort, &["max_error", "max_time", "sampler", "steps"],
        "Choose the levels adaptively, with each step's error below this (root mean square, of values between -1 \
         and 1); 0.01 is just visible",
        |options, tolerance| options.plan.steps = Steps::within(tolerance);
    "churn", "AMOUNT", parse_churn, Effort, &["tolerance"],
        "Add this amount of noise between steps over the whole run; multistep samplers start again each time, so \
         use heun",
        |options, amount| options.plan.churn.amount = amount;
    "half-volumes", "", switch, Effort, BOUNDS_OR_EXACT,
        "Keep views' features in half precision (f16): half the memory, but every row of them is computed",
        |options, ()| options.omissions.half_volumes = true;
    "reuse", "LEVEL", parse_level, Sequence, BOUNDS_OR_EXACT,
        "Start each frame from the one before with noise of this level, about the size of the differences between \
         frames: for orbits",
        |options, level| options.omissions.reuse = Some(level);
}

/// The flags that say nothing of the denoiser or of sequences of pictures.
const OF_FEATURES: [&str; 2] = ["samples", "near-far"];

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

/// Opens the network with what is given: the published run if nothing may be omitted, otherwise the fast one.
fn open(checkpoint: Checkpoint, given: &Given) -> Result<AnyField, OpenError> {
    let plan = if given.exact { Plan::published(given.seed) } else { Plan::fast(given.seed) };
    let mut options = taken(given, GenvsOptions { plan, ..GenvsOptions::default() });
    options.omissions.unused_views = !given.computes(&VIEWS);
    options.omissions.unseen_rows = !given.computes(&ROWS);
    if given.computes(&CALLS) {
        options.plan.early_termination = None;
    }
    let field = Genvs::new(checkpoint, options)?;
    let of_denoiser = given.flags.iter().map(|(flag, _)| flag).filter(|flag| !OF_FEATURES.contains(&flag.as_str()));
    match (of_denoiser.min(), &field.architecture().denoiser) {
        (Some(flag), None) => Err(OpenError::cannot(flag, "has no denoiser")),
        _ => Ok(AnyField::new(field)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_names_every_sampler() {
        let help = ROW.flags.iter().find(|flag| flag.name == "sampler").expect("a flag").help;
        assert!(help.starts_with(&format!("Sampler: {} [", Sampler::ALL.map(Sampler::name).join(", "))), "{help}");
    }
}
