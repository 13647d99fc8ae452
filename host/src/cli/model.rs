//! Which field makes the pictures, and how.

use anyhow::Context;
use clap::{Args, ValueEnum};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use viewfuse::checkpoint::Checkpoint;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::Field;
use viewfuse::field::genvs;
use viewfuse::field::photo::PhotoField;
use viewfuse::field::pixelnerf::{Architecture, Omissions, PixelNerf, PixelNerfOptions, Sampling, made};

/// The field of a run.
pub(crate) enum AnyField {
    Photo(PhotoField),
    PixelNerf(Box<PixelNerf>),
}

/// Where a network's parameters come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Model {
    /// A checkpoint.
    File(PathBuf),
    /// Computed from the tensors' names; the width of a small member of the family, or the published size.
    Formula(Option<u16>),
    /// A solid body, for measuring.
    Body(Option<u16>),
    /// GeNVS, computed from the tensors' names: the small member of its family, or the published size.
    Genvs { small: bool },
}

impl FromStr for Model {
    type Err = String;

    fn from_str(text: &str) -> Result<Model, String> {
        let (name, size) = match text.split_once(':') {
            Some((name, size)) => (name, Some(size)),
            None => (text, None),
        };
        let width = || match size.map(str::parse::<u16>) {
            None => Ok(None),
            Some(Ok(width)) if (8..=2048).contains(&width) && width % 8 == 0 => Ok(Some(width)),
            Some(_) => Err(format!("'{text}': a width is a multiple of 8 from 8 to 2048")),
        };
        match name {
            "formula" => Ok(Model::Formula(width()?)),
            "body" => Ok(Model::Body(width()?)),
            "genvs" => match size {
                None => Ok(Model::Genvs { small: false }),
                Some("small") => Ok(Model::Genvs { small: true }),
                Some(_) => Err(format!("'{text}': there is genvs, of the published size, and genvs:small")),
            },
            _ => Ok(Model::File(PathBuf::from(text))),
        }
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, width) = match self {
            Model::File(path) => return write!(f, "{}", path.display()),
            Model::Formula(width) => ("formula", width),
            Model::Body(width) => ("body", width),
            Model::Genvs { small } => return f.write_str(if *small { "genvs:small" } else { "genvs" }),
        };
        match width {
            Some(width) => write!(f, "{name}:{width}"),
            None => f.write_str(name),
        }
    }
}

impl Model {
    /// The parameters.
    pub(crate) fn checkpoint(&self) -> anyhow::Result<Checkpoint> {
        let sizes = |width: &Option<u16>| match width {
            Some(width) => Architecture::small(usize::from(*width)),
            None => Architecture::published(),
        };
        Ok(match self {
            Model::File(path) => Checkpoint::open(path)?,
            Model::Formula(width) => made::by_formula(&sizes(width)),
            Model::Body(width) => made::body(&sizes(width)),
            Model::Genvs { small: true } => genvs::made::by_formula(&genvs::Architecture::small()),
            Model::Genvs { small: false } => genvs::made::by_formula(&genvs::Architecture::published()),
        })
    }
}

/// Something that `--compute` turns on again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Omission {
    /// Encode views that no target uses
    Views,
    /// Latent layers at every point instead of once on the grid
    Layers,
    /// First-pass samples in empty space
    Space,
    /// Second-pass samples on empty rays
    Rays,
    /// Second-pass samples in empty parts of rays
    Parts,
    /// Second-pass samples behind surfaces
    Hidden,
}

/// Which network makes the pictures, and where it looks.
#[derive(Args)]
pub(crate) struct NetworkOptions {
    /// PixelNeRF checkpoint (.pth, .pt, .safetensors); or formula[:WIDTH] or body[:WIDTH], networks without training for
    /// measuring [default: the field that needs no network]
    #[arg(long, value_name = "FILE")]
    model: Option<Model>,
    /// Samples on a ray: first pass, second pass by weight, second pass around the depth
    #[arg(long, value_name = "N,N,N", default_value = "64,16,16", value_parser = parse_samples, requires = "model")]
    samples: [u32; 3],
    /// Where rays begin and end, world units [default: 8/13 and 18/13 of the cameras' distance from what they look at]
    #[arg(long, value_name = "NEAR,FAR", value_parser = parse_near_far, requires = "model")]
    near_far: Option<[f32; 2]>,
    /// Second-pass samples around the depth that the published code takes (the sum of weights times depths, too near on
    /// rays that are not opaque), not around the mean depth
    #[arg(long, requires = "model")]
    published_depth: bool,
}

/// Which network makes the pictures, and what it leaves out.
#[derive(Args)]
pub(crate) struct ModelOptions {
    #[command(flatten)]
    network: NetworkOptions,
    /// Leave nothing out: every view, layer and sample, whether the scene needs it or not
    #[arg(long, conflicts_with_all = ["compute", "probe_step", "leave_out", "settled"])]
    pub(crate) exact: bool,
    /// Compute these although the scene does not need them
    #[arg(long, value_name = "WHAT", value_enum, value_delimiter = ',', requires = "model")]
    compute: Vec<Omission>,
    /// Probe one ray in every square of this many pixels on a side for empty space
    #[arg(long, value_name = "PIXELS", default_value_t = 4, value_parser = clap::value_parser!(u32).range(2..=64), requires = "model")]
    probe_step: u32,
}

impl AnyField {
    /// What the run record calls it.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            AnyField::Photo(field) => Field::<Cpu>::name(field),
            AnyField::PixelNerf(field) => Field::<Cpu>::name(field.as_ref()),
        }
    }

    /// The least number of sources it can work with.
    pub(crate) fn least_sources(&self) -> usize {
        match self {
            AnyField::Photo(field) => Field::<Cpu>::least_sources(field),
            AnyField::PixelNerf(field) => Field::<Cpu>::least_sources(field.as_ref()),
        }
    }
}

impl NetworkOptions {
    /// Where the network comes from, if there is one.
    pub(crate) fn label(&self) -> Option<String> {
        self.model.as_ref().map(Model::to_string)
    }

    /// Reads the field.
    pub(crate) fn open(&self, seed: u64, omissions: Omissions) -> anyhow::Result<AnyField> {
        let Some(model) = &self.model else { return Ok(AnyField::Photo(PhotoField::default())) };
        let checkpoint = model.checkpoint()?;
        let [coarse_count, importance_count, depth_count] = self.samples;
        let sampling = Sampling {
            coarse_count,
            importance_count,
            depth_count,
            seed,
            near_far: self.near_far,
            published_depth: self.published_depth,
            ..Sampling::default()
        };
        let field = PixelNerf::new(&checkpoint, PixelNerfOptions { sampling, omissions }).context("--model")?;
        Ok(AnyField::PixelNerf(Box::new(field)))
    }
}

impl ModelOptions {
    /// Where the network comes from, if there is one.
    pub(crate) fn label(&self) -> Option<String> {
        self.network.label()
    }

    /// Reads the field.
    pub(crate) fn open(&self, seed: u64) -> anyhow::Result<AnyField> {
        self.network.open(seed, self.omissions())
    }

    fn omissions(&self) -> Omissions {
        let computes = |what| self.exact || self.compute.contains(&what);
        Omissions {
            unused_views: !computes(Omission::Views),
            latent_layers: !computes(Omission::Layers),
            empty_space: if computes(Omission::Space) { 0 } else { self.probe_step },
            empty_rays: !computes(Omission::Rays),
            empty_parts: !computes(Omission::Parts),
            hidden_samples: !computes(Omission::Hidden),
        }
    }
}

fn parse_samples(text: &str) -> Result<[u32; 3], String> {
    let counts: Option<Vec<u32>> = text.split(',').map(|count| count.trim().parse().ok()).collect();
    match counts.as_deref() {
        Some(&[coarse, importance, depth]) if (1..=1024).contains(&coarse) && importance <= 1024 && depth <= 1024 => {
            Ok([coarse, importance, depth])
        }
        _ => Err("three whole numbers up to 1024, the first at least 1, for example 64,16,16".to_owned()),
    }
}

fn parse_near_far(text: &str) -> Result<[f32; 2], String> {
    let ends: Option<Vec<f32>> = text.split(',').map(|end| end.trim().parse().ok()).collect();
    match ends.as_deref() {
        Some(&[near, far]) if near >= 0.0 && near < far && far.is_finite() => Ok([near, far]),
        _ => Err("two distances, for example 0.8,1.8, the first at least 0 and less than the second".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::Model;

    #[test]
    fn models_by_name() {
        for text in ["formula", "formula:64", "body", "body:16", "genvs", "genvs:small", "network-snapshot-005000.pkl"]
        {
            let model: Model = text.parse().expect(text);
            assert_eq!(model.to_string(), text);
            assert_eq!(matches!(model, Model::File(_)), text.ends_with(".pkl"));
        }
        for text in ["formula:7", "body:", "genvs:", "genvs:64", "genvs:Small"] {
            let message = text.parse::<Model>().expect_err(text);
            assert!(message.starts_with(&format!("'{text}': ")), "{message}");
        }
    }
}
