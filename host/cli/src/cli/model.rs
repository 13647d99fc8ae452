//! The field that renders, and its options.
//!
//! ```text
//! name     the values of --model
//! flags    the flags of the fields' rows
//! ```

mod flags;
mod name;

pub(crate) use flags::{Flags, SEQUENCE, of_fields};

use super::options::EFFORTS;
use super::wrong::wrong;
use anyhow::Context;
use clap::Args;
use clap::builder::{PossibleValue, PossibleValuesParser};
use flags::{EFFORT, NETWORK, PICTURE};
use name::{Model, model_help};
use std::path::Path;
use viewfuse_field::options::{Given, OpenError};
use viewfuse_field::rows::ROWS;
use viewfuse_field::{AnyField, Omission, VIEWS};
use viewfuse_scene::{READERS, looked_for};
use viewfuse_weighting::{Weighting, WeightingChoice};

/// The field, and what its exact pictures depend on.
#[derive(Args)]
pub(crate) struct NetworkOptions {
    #[arg(long, value_name = "FILE", help = model_help(), help_heading = NETWORK)]
    model: Option<Model>,
    #[command(flatten)]
    flags: Flags<PICTURE>,
}

/// The field and its efforts.
#[derive(Args)]
pub(crate) struct ModelOptions {
    #[command(flatten)]
    pub(crate) network: NetworkOptions,
    /// The exact effort: leave nothing out, compute every view, layer and sample, and with GeNVS every call of the
    /// published run, heun over 25 levels, unless --sampler, --steps or --tolerance are given
    #[arg(long, conflicts_with_all = ["compute", "leave_out", "early_termination"], help_heading = EFFORTS)]
    pub(crate) exact: bool,
    /// Omit all that can be but this, without a bound on the error: compute what the scene does not need
    #[arg(long, value_name = "WHAT", value_parser = PossibleValuesParser::new(omissions()), value_delimiter = ',',
        requires = "model", help_heading = EFFORTS)]
    compute: Vec<String>,
    #[command(flatten)]
    flags: Flags<EFFORT>,
}

/// The values of `--compute`.
fn omissions() -> Vec<PossibleValue> {
    let value = |title: &str, Omission { name, what, part, typical_error }: &Omission| {
        PossibleValue::new(name).help(format!("{title}: {what} {part}; typical error: {typical_error}"))
    };
    let of_rows = ROWS.iter().flat_map(|row| row.omissions.iter().map(|omission| value(row.title, omission)));
    [value("all", &VIEWS)].into_iter().chain(of_rows).collect()
}

/// Help of a scene that is looked for in any of the layouts.
pub(crate) fn scene_help() -> String {
    format!("The scene: {}", looked_for(&READERS))
}

/// The scheme of `--weights`; `None` where the scene is to decide: a network's pictures take too long to try out
/// schemes unasked, and Gaussians show the same under all of them.
pub(crate) fn chosen_scheme(
    given: Option<&WeightingChoice>,
    model: &ModelOptions,
    gaussians: Option<&Path>,
) -> anyhow::Result<Option<Weighting>> {
    Ok(match given {
        Some(WeightingChoice::Given(spec)) => Some(spec.open()?),
        None if model.network.label().is_some() || gaussians.is_some() => Some(Weighting::default_scheme()),
        Some(WeightingChoice::Auto) | None => None,
    })
}

impl NetworkOptions {
    /// The source of the network, if there is one.
    pub(crate) fn label(&self) -> Option<String> {
        self.model.as_ref().filter(|model| model.is_network()).map(Model::to_string)
    }

    /// The file of the network's parameters, if there is one.
    pub(crate) fn file(&self) -> Option<&Path> {
        match &self.model {
            Some(Model::File(path)) => Some(path),
            _ => None,
        }
    }

    /// Opens the field with its default efforts.
    pub(crate) fn open(&self, seed: u64) -> anyhow::Result<AnyField> {
        self.open_with(Given { seed, ..Given::default() })
    }

    /// Opens the field, with further options.
    fn open_with(&self, given: Given) -> anyhow::Result<AnyField> {
        let model = self.model.clone().unwrap_or(Model::TrainingFree(ROWS[0]));
        match model.open(&self.flags.add_to(given)) {
            Err(OpenError::Refused { option, problem, reason }) => {
                Err(wrong(format_args!("--{option} {problem} with '--model {model}', which {reason}")))
            }
            opened => opened.context("--model"),
        }
    }
}

impl ModelOptions {
    /// Whether options say what is omitted: no bound is to choose it.
    pub(crate) fn says_omissions(&self) -> bool {
        self.exact || !self.compute.is_empty() || !self.flags.is_empty()
    }

    /// Opens the field, for pictures of their own or for a sequence of them.
    pub(crate) fn open(&self, seed: u64, sequence: Option<&Flags<SEQUENCE>>) -> anyhow::Result<AnyField> {
        let given = Given { seed, exact: self.exact, compute: self.compute.clone(), flags: Vec::new() };
        let given = self.flags.add_to(given);
        self.network.open_with(match sequence {
            Some(sequence) => sequence.add_to(given),
            None => given,
        })
    }
}
