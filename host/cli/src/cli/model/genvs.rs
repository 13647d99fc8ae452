//! Options of GeNVS's diffusion sampling.

use super::GENVS;
use clap::Args;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_field::options::FieldOptions;

/// The sampler, its levels, and the precision of the views' features.
#[derive(Args)]
pub(crate) struct RunOptions {
    #[arg(long, value_name = "NAME", requires = "model", help = sampler_help(), help_heading = GENVS)]
    sampler: Option<Sampler>,
    /// Noise levels. Each takes one call of the denoiser; with heun two, except the last [default: 10, with --exact 25]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000), requires = "model", help_heading = GENVS)]
    steps: Option<u32>,
    /// Choose the levels adaptively, with each step's error below this (root mean square, of values between -1 and 1);
    /// 0.01 is just visible
    #[arg(long, value_name = "ERROR", value_parser = parse_tolerance, requires = "model", conflicts_with_all = ["sampler", "steps"], help_heading = GENVS)]
    tolerance: Option<f32>,
    /// Add this amount of noise between steps over the whole run; multistep samplers start again each time, so use heun
    #[arg(long, value_name = "AMOUNT", value_parser = parse_churn, requires = "model", conflicts_with = "tolerance", help_heading = GENVS)]
    churn: Option<f32>,
    /// Keep views' features in half precision (f16): half the memory, but every row of them is computed
    #[arg(long, requires = "model", conflicts_with = "exact", help_heading = GENVS)]
    half_volumes: bool,
}

impl RunOptions {
    /// `options` with those that were given here.
    pub(super) fn given_to(&self, options: FieldOptions) -> FieldOptions {
        let RunOptions { sampler, steps, tolerance, churn, half_volumes } = *self;
        FieldOptions { sampler, steps, tolerance, churn, half_volumes, ..options }
    }
}

fn sampler_help() -> String {
    format!("Sampler: {} [default: ipndm, with --exact heun]", Sampler::ALL.map(Sampler::name).join(", "))
}

fn parse_tolerance(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(tolerance) if tolerance > 0.0 && tolerance <= 1.0 => Ok(tolerance),
        _ => Err("an error is a number above 0 and at most 1".to_owned()),
    }
}

fn parse_churn(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(amount) if (0.0..=1000.0).contains(&amount) => Ok(amount),
        _ => Err("an amount is a number from 0 to 1000".to_owned()),
    }
}

/// `MAX,MIN`.
pub(super) fn parse_noise(text: &str) -> Result<NoiseSchedule, String> {
    let levels: Option<Vec<f32>> = text.split(',').map(|level| level.trim().parse().ok()).collect();
    match levels.as_deref() {
        Some(&[largest, smallest]) => NoiseSchedule::new(smallest, largest).map_err(|error| error.to_string()),
        _ => Err("two noise levels, the largest first, for example 80,0.002".to_owned()),
    }
}

/// A noise level.
pub(crate) fn parse_level(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(level) if level > 0.0 && level.is_finite() => Ok(level),
        _ => Err("a noise level is a number above 0".to_owned()),
    }
}
