//! Which field makes the pictures, and how.
//!
//! ```text
//! any         a field of any kind, and work with it
//! name        what --model takes
//! omission    what --compute takes
//! genvs       from noise to a picture
//! ```

mod any;
mod genvs;
mod name;
mod omission;

pub(crate) use any::{AnyField, Work};
pub(crate) use genvs::parse_level;

use super::parse::parse_share;
use super::wrong;
use anyhow::Context;
use clap::{Args, ValueEnum};
use genvs::{RunOptions, parse_noise};
use name::Model;
use omission::{Omission, of_genvs, of_pixelnerf};
use std::path::Path;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_field::family::Family;
use viewfuse_field::genvs::sampling::Plan;
use viewfuse_field::genvs::{Genvs, GenvsOptions, Omissions as GenvsOmissions, Rays};
use viewfuse_field::photo::PhotoField;
use viewfuse_field::pixelnerf::{Omissions as PixelNerfOmissions, PixelNerf, PixelNerfOptions, Sampling};
use viewfuse_nn::checkpoint::Checkpoint;

/// Heading of the options of any network.
const NETWORK: &str = "Options of networks";
/// Heading of the options of one family.
const PIXELNERF: &str = "Options of PixelNeRF";
/// Heading of the options of one family.
pub(crate) const GENVS: &str = "Options of GeNVS";

/// Names of options, and whether they were given.
type Given = Vec<(&'static str, bool)>;

/// Which network makes the pictures, and where it looks.
#[derive(Args)]
pub(crate) struct NetworkOptions {
    /// Checkpoint of a PixelNeRF or a GeNVS (.pth, .pt, .safetensors, .pkl); or one of the networks without training, for
    /// measuring: formula[:WIDTH] and body[:WIDTH] are PixelNeRFs, genvs and genvs:small GeNVSs [default: the field that
    /// needs no network]
    #[arg(long, value_name = "FILE", help_heading = NETWORK)]
    model: Option<Model>,
    /// Samples on a ray: of PixelNeRF in the first pass, in the second by weight, in the second around the depth; of GeNVS a
    /// single number [default: 64,16,16 and 64]
    #[arg(long, value_name = "N,N,N|N", value_parser = parse_samples, requires = "model", help_heading = NETWORK)]
    samples: Option<Samples>,
    /// Where rays begin and end, world units [default: 8/13 and 18/13 of the cameras' distance from what they look at]
    #[arg(long, value_name = "NEAR,FAR", value_parser = parse_near_far, requires = "model", help_heading = NETWORK)]
    near_far: Option<[f32; 2]>,
    /// Second-pass samples around the depth that the published code takes (the sum of weights times depths, too near on
    /// rays that are not opaque), not around the mean depth
    #[arg(long, requires = "model", help_heading = PIXELNERF)]
    published_depth: bool,
    /// Noise levels to start from and to end at [default: 80,0.002]
    #[arg(long, value_name = "MAX,MIN", value_parser = parse_noise, requires = "model", help_heading = GENVS)]
    noise: Option<NoiseSchedule>,
}

/// Which network makes the pictures, and what it leaves out.
#[derive(Args)]
pub(crate) struct ModelOptions {
    #[command(flatten)]
    network: NetworkOptions,
    /// Leave nothing out: every view, layer and sample, whether the scene needs it or not; of GeNVS also every call of the
    /// published run, heun over 25 levels, unless --sampler, --steps or --tolerance say otherwise
    #[arg(long, conflicts_with_all = ["compute", "probe_step", "probe_error", "leave_out", "settled"], help_heading = NETWORK)]
    pub(crate) exact: bool,
    /// Compute these although the scene does not need them
    #[arg(long, value_name = "WHAT", value_enum, value_delimiter = ',', requires = "model", help_heading = NETWORK)]
    compute: Vec<Omission>,
    /// Probe one ray in every square of this many pixels on a side for empty space [default: 4]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(2..=64), requires = "model", help_heading = PIXELNERF)]
    probe_step: Option<u32>,
    /// Let more of space count as empty while the probes' colours change by no more than this in the root of the mean
    /// square, 1 being from black to white [default: 1/128]
    #[arg(long, value_name = "ERROR", value_parser = parse_share, requires = "model", help_heading = PIXELNERF)]
    probe_error: Option<f32>,
    #[command(flatten)]
    run: RunOptions,
}

/// What `--samples` says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Samples {
    /// As GeNVS takes it.
    One(u32),
    /// As PixelNeRF takes it.
    Three([u32; 3]),
}

/// A network that is not set up yet.
struct Unset<'a> {
    model: &'a Model,
    checkpoint: Checkpoint,
    family: Family,
}

impl Unset<'_> {
    /// Arguments that were given for the other family are refused.
    fn refuse(&self, given: Given) -> anyhow::Result<()> {
        match given.into_iter().find(|(_, is_given)| *is_given) {
            Some((option, _)) => Err(self.refused(&format!("{option} cannot be used"))),
            None => Ok(()),
        }
    }

    fn refused(&self, what: &str) -> anyhow::Error {
        wrong(format_args!("{what} with '--model {}', which is a {}", self.model, self.family))
    }
}

impl NetworkOptions {
    /// Where the network comes from, if there is one.
    pub(crate) fn label(&self) -> Option<String> {
        self.model.as_ref().map(Model::to_string)
    }

    /// The file of the network's parameters, if they come from one.
    pub(crate) fn file(&self) -> Option<&Path> {
        match &self.model {
            Some(Model::File(path)) => Some(path),
            _ => None,
        }
    }

    /// Reads the field, as it is unless a person says otherwise.
    #[cfg(feature = "pareto")]
    pub(crate) fn open(&self, seed: u64) -> anyhow::Result<AnyField> {
        match self.unset()? {
            None => Ok(AnyField::Photo(PhotoField::default())),
            Some(network) => match network.family {
                Family::PixelNerf => self.pixelnerf(&network, seed, PixelNerfOmissions::default()),
                Family::Genvs => {
                    let plan = Plan { schedule: self.schedule(), ..Plan::fast(seed) };
                    self.genvs(network, plan, GenvsOmissions::default(), Given::new())
                }
            },
        }
    }

    fn unset(&self) -> anyhow::Result<Option<Unset<'_>>> {
        let Some(model) = &self.model else { return Ok(None) };
        let checkpoint = model.checkpoint()?;
        let family = Family::of(&checkpoint).context("--model")?;
        Ok(Some(Unset { model, checkpoint, family }))
    }

    fn schedule(&self) -> NoiseSchedule {
        self.noise.unwrap_or_else(NoiseSchedule::published)
    }

    fn pixelnerf(&self, network: &Unset<'_>, seed: u64, omissions: PixelNerfOmissions) -> anyhow::Result<AnyField> {
        network.refuse(vec![("--noise", self.noise.is_some())])?;
        let default = Sampling::default();
        let [coarse_count, importance_count, depth_count] = match self.samples {
            None => [default.coarse_count, default.importance_count, default.depth_count],
            Some(Samples::Three(counts)) => counts,
            Some(Samples::One(_)) => return Err(network.refused("--samples takes three numbers")),
        };
        let sampling = Sampling {
            coarse_count,
            importance_count,
            depth_count,
            seed,
            near_far: self.near_far,
            published_depth: self.published_depth,
            ..default
        };
        let field = PixelNerf::new(&network.checkpoint, PixelNerfOptions { sampling, omissions }).context("--model")?;
        Ok(AnyField::PixelNerf(Box::new(field)))
    }

    /// `denoising` are options that only a denoiser understands.
    fn genvs(
        &self,
        network: Unset<'_>,
        plan: Plan,
        omissions: GenvsOmissions,
        denoising: Given,
    ) -> anyhow::Result<AnyField> {
        network.refuse(vec![("--published-depth", self.published_depth)])?;
        let default = Rays::default();
        let sample_count = match self.samples {
            None => default.sample_count,
            Some(Samples::One(count)) if count >= 2 => count,
            Some(_) => return Err(network.refused("--samples takes one number, at least 2,")),
        };
        let rays = Rays { sample_count, near_far: self.near_far, ..default };
        let model = network.model;
        let field = Genvs::new(network.checkpoint, GenvsOptions { rays, plan, omissions }).context("--model")?;
        let given = denoising.into_iter().chain([("--noise", self.noise.is_some())]).find(|(_, is_given)| *is_given);
        match (given, &field.architecture().denoiser) {
            (Some((option, _)), None) => {
                Err(wrong(format_args!("{option} cannot be used with '--model {model}', which has no denoiser")))
            }
            _ => Ok(AnyField::Genvs(Box::new(field))),
        }
    }
}

impl ModelOptions {
    /// Where the network comes from, if there is one.
    pub(crate) fn label(&self) -> Option<String> {
        self.network.label()
    }

    /// The file of the network's parameters, if they come from one.
    pub(crate) fn file(&self) -> Option<&Path> {
        self.network.file()
    }

    /// Reads the field. A GeNVS starts each frame from the one before at level `reuse`, if there is one.
    pub(crate) fn open(&self, seed: u64, reuse: Option<f32>) -> anyhow::Result<AnyField> {
        let Some(network) = self.network.unset()? else { return Ok(AnyField::Photo(PhotoField::default())) };
        if let Some(other) = self.compute.iter().find(|what| !what.is_of(network.family)) {
            let name = other.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned());
            return Err(network.refused(&format!("--compute {name} cannot be used")));
        }
        let mut denoising = self.run.given();
        denoising.push(("--reuse", reuse.is_some()));
        let computes = |what| self.exact || self.compute.contains(&what);
        match network.family {
            Family::PixelNerf => {
                network.refuse(denoising)?;
                let all = PixelNerfOmissions::default();
                let probe_step = self.probe_step.unwrap_or(all.empty_space);
                let probe_error = if self.exact { 0.0 } else { self.probe_error.unwrap_or(all.probe_error) };
                self.network.pixelnerf(&network, seed, of_pixelnerf(computes, probe_step, probe_error))
            }
            Family::Genvs => {
                network.refuse(vec![
                    ("--probe-step", self.probe_step.is_some()),
                    ("--probe-error", self.probe_error.is_some()),
                ])?;
                let plan = self.run.plan(seed, self.network.schedule(), self.exact, computes(Omission::Calls));
                let omissions = of_genvs(computes, reuse, self.run.half_volumes);
                self.network.genvs(network, plan, omissions, denoising)
            }
        }
    }
}

fn parse_samples(text: &str) -> Result<Samples, String> {
    let counts: Option<Vec<u32>> = text.split(',').map(|count| count.trim().parse().ok()).collect();
    match counts.as_deref() {
        Some(&[coarse, importance, depth]) if (1..=1024).contains(&coarse) && importance <= 1024 && depth <= 1024 => {
            Ok(Samples::Three([coarse, importance, depth]))
        }
        Some(&[count]) if (1..=1024).contains(&count) => Ok(Samples::One(count)),
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
