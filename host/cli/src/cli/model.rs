//! The field that renders, and its options.
//!
//! ```text
//! name        the values of --model
//! genvs       the denoiser's options of GeNVS
//! ```

mod genvs;
mod name;

pub(crate) use genvs::parse_level;

use super::parse::parse_share;
use super::wrong;
use anyhow::Context;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use genvs::{RunOptions, parse_noise};
use name::{Model, model_help};
use std::path::Path;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_field::AnyField;
use viewfuse_field::family::{self, Family, VIEWS};
use viewfuse_field::options::{FieldOptions, OpenError};

/// Heading of the options of any network.
const NETWORK: &str = "Options of networks";
/// Heading of the options of one family.
const PIXELNERF: &str = "Options of PixelNeRF";
/// Heading of the options of one family.
pub(crate) const GENVS: &str = "Options of GeNVS";

/// The network, and the samples on its rays.
#[derive(Args)]
pub(crate) struct NetworkOptions {
    #[arg(long, value_name = "FILE", help = model_help(), help_heading = NETWORK)]
    model: Option<Model>,
    /// Samples on a ray. PixelNeRF: three numbers, for the first pass, the second pass by weight, and the second pass
    /// around the depth [default: 64,16,16]. GeNVS: one number [default: 64]
    #[arg(long, value_name = "N,N,N|N", value_parser = parse_samples, requires = "model", help_heading = NETWORK)]
    samples: Option<Samples>,
    /// Near and far bounds of rays, world units [default: 8/13 and 18/13 of the cameras' distance from the point that they
    /// look at]
    #[arg(long, value_name = "NEAR,FAR", value_parser = parse_near_far, requires = "model", help_heading = NETWORK)]
    near_far: Option<[f32; 2]>,
    /// Place second-pass samples around the depth of the published code (the sum of weights times depths, too near on
    /// rays that are not opaque) instead of the mean depth
    #[arg(long, requires = "model", help_heading = PIXELNERF)]
    published_depth: bool,
    /// Largest and smallest noise level [default: 80,0.002]
    #[arg(long, value_name = "MAX,MIN", value_parser = parse_noise, requires = "model", help_heading = GENVS)]
    noise: Option<NoiseSchedule>,
}

/// The network and its omissions.
#[derive(Args)]
pub(crate) struct ModelOptions {
    #[command(flatten)]
    network: NetworkOptions,
    /// Leave nothing out: compute every view, layer and sample, and with GeNVS every call of the published run, heun
    /// over 25 levels, unless --sampler, --steps or --tolerance are given
    #[arg(long, conflicts_with_all = ["compute", "probe_step", "probe_error", "leave_out", "early_termination"], help_heading = NETWORK)]
    pub(crate) exact: bool,
    /// Switch these omissions off: compute what the scene does not need
    #[arg(long, value_name = "WHAT", value_parser = PossibleValuesParser::new(computable()), value_delimiter = ',', requires = "model", help_heading = NETWORK)]
    compute: Vec<String>,
    /// Probe one ray in every square of this many pixels on a side for empty space [default: 4]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(2..=64), requires = "model", help_heading = PIXELNERF)]
    probe_step: Option<u32>,
    /// Raise the threshold of empty space while the probes' colours change by at most this, root mean square; 1 is from
    /// black to white [default: 1/128]
    #[arg(long, value_name = "ERROR", value_parser = parse_share, requires = "model", help_heading = PIXELNERF)]
    probe_error: Option<f32>,
    /// Keep the latents that points look up in half precision (f16): half of their memory
    #[arg(long, requires = "model", conflicts_with = "exact", help_heading = PIXELNERF)]
    half_latents: bool,
    #[command(flatten)]
    run: RunOptions,
}

/// The value of `--samples`.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Samples(Vec<u32>);

/// The values of `--compute`.
fn computable() -> Vec<PossibleValue> {
    let all = [VIEWS].into_iter().chain(Family::ALL.into_iter().flat_map(|family| family.computable()).copied());
    all.map(|(name, help)| PossibleValue::new(name).help(help)).collect()
}

impl NetworkOptions {
    /// The source of the network, if there is one.
    pub(crate) fn label(&self) -> Option<String> {
        self.model.as_ref().map(Model::to_string)
    }

    /// The file of the network's parameters, if there is one.
    pub(crate) fn file(&self) -> Option<&Path> {
        match &self.model {
            Some(Model::File(path)) => Some(path),
            _ => None,
        }
    }

    /// Opens the field with its default options.
    #[cfg(feature = "pareto")]
    pub(crate) fn open(&self, seed: u64) -> anyhow::Result<AnyField> {
        self.open_with(FieldOptions { seed, ..FieldOptions::default() })
    }

    /// Opens the field, with further options.
    fn open_with(&self, options: FieldOptions) -> anyhow::Result<AnyField> {
        let Some(model) = &self.model else { return Ok(AnyField::default()) };
        let options = FieldOptions {
            near_far: self.near_far,
            samples: self.samples.as_ref().map_or_else(Vec::new, |Samples(counts)| counts.clone()),
            published_depth: self.published_depth,
            noise: self.noise,
            ..options
        };
        match family::open(model.checkpoint()?, &options) {
            Err(OpenError::Refused { option, problem, reason }) => {
                Err(wrong(format_args!("--{option} {problem} with '--model {model}', which {reason}")))
            }
            opened => opened.context("--model"),
        }
    }
}

impl ModelOptions {
    /// The source of the network, if there is one.
    pub(crate) fn label(&self) -> Option<String> {
        self.network.label()
    }

    /// The file of the network's parameters, if there is one.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.network.file()
    }

    /// Opens the field. With `reuse`, a GeNVS starts each frame from the one before at that noise level.
    pub(crate) fn open(&self, seed: u64, reuse: Option<f32>) -> anyhow::Result<AnyField> {
        let ModelOptions { exact, probe_step, probe_error, half_latents, .. } = *self;
        let compute = self.compute.clone();
        let options = FieldOptions {
            seed,
            exact,
            compute,
            probe_step,
            probe_error,
            half_latents,
            reuse,
            ..FieldOptions::default()
        };
        self.network.open_with(self.run.given_to(options))
    }
}

fn parse_samples(text: &str) -> Result<Samples, String> {
    let counts: Option<Vec<u32>> = text.split(',').map(|count| count.trim().parse().ok()).collect();
    match counts.as_deref() {
        Some(&[first, importance, depth]) if (1..=1024).contains(&first) && importance <= 1024 && depth <= 1024 => {
            Ok(Samples(vec![first, importance, depth]))
        }
        Some(&[count]) if (1..=1024).contains(&count) => Ok(Samples(vec![count])),
        _ => Err("one or three whole numbers up to 1024, the first at least 1, for example 64 or 64,16,16".to_owned()),
    }
}

fn parse_near_far(text: &str) -> Result<[f32; 2], String> {
    let ends: Option<Vec<f32>> = text.split(',').map(|end| end.trim().parse().ok()).collect();
    match ends.as_deref() {
        Some(&[near, far]) if near >= 0.0 && near < far && far.is_finite() => Ok([near, far]),
        _ => Err("two distances, for example 0.8,1.8, the first at least 0 and less than the second".to_owned()),
    }
}
