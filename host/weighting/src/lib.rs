//! Weighting schemes by name: what a person types, and the weights it gives.

#![forbid(unsafe_code)]

pub mod attention;
pub mod sources;

use crate::attention::{AttentionError, AttentionModel};
use crate::sources::{SourcePoses, SourceWeights};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use viewfuse_core::attention::published_cross_attention;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::{AngleKind, Scheme, weigh};

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Every scheme that needs no file, with its default parameters: the rows of tables over all schemes.
pub const SCHEME_NAMES: [&str; 12] = [
    "mean",
    "l1",
    "frobenius",
    "relative-frobenius",
    "gaussian:beta=1",
    "distance:power=1",
    "distance:power=2",
    "distance:power=3",
    "error:alpha=1",
    "error:alpha=0.5",
    "error:alpha=1,angle=full",
    "cross-attention",
];

const GRAMMAR: &str = "mean, l1, frobenius, relative-frobenius, gaussian:beta=B, distance:power=1|2|3, \
     error:alpha=A[,angle=axis|full], cross-attention, attention:FILE";

/// What stands before the file of learned attention.
const ATTENTION: &str = "attention:";

/// Why a text is not a weighting scheme.
#[derive(Debug, thiserror::Error)]
pub enum WeightingError {
    /// No scheme has this name.
    #[error("unknown weighting scheme '{name}'; there are: {GRAMMAR}")]
    UnknownScheme {
        /// What was given.
        name: String,
    },
    /// The scheme has no such parameter.
    #[error("weighting scheme '{scheme}' has no parameter '{key}'; there are: {GRAMMAR}")]
    UnknownParameter {
        /// The scheme.
        scheme: String,
        /// What was given.
        key: String,
    },
    /// The parameter's value is not usable.
    #[error("weighting scheme '{scheme}': {key} must be {wanted}, not '{value}'")]
    BadValue {
        /// The scheme.
        scheme: String,
        /// The parameter.
        key: String,
        /// What it must be.
        wanted: &'static str,
        /// What was given.
        value: String,
    },
    /// Learned attention without its parameters.
    #[error("weighting scheme 'attention' needs a file of parameters: attention:FILE")]
    NoFile,
    /// The attention parameters could not be read.
    #[error(transparent)]
    Attention(#[from] AttentionError),
}

/// A weighting scheme, ready to weigh.
#[derive(Clone, Debug)]
pub struct Weighting {
    name: String,
    kind: Kind,
}

#[derive(Clone, Debug)]
enum Kind {
    Formula(Scheme),
    CrossAttention,
    Attention(Box<AttentionModel>),
}

impl Weighting {
    /// The scheme used where a person names none: error weighting with `alpha = 1`, the best of the paper's formulas.
    pub fn default_scheme() -> Weighting {
        Weighting { name: "error:alpha=1".to_owned(), kind: Kind::Formula(Scheme::ERROR) }
    }

    /// The file of its parameters, if it has one.
    pub fn file(&self) -> Option<&Path> {
        self.name.strip_prefix(ATTENTION).map(Path::new)
    }

    /// The weights of the sources for a target, in the order of the sources.
    pub fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights {
        match &self.kind {
            Kind::Formula(scheme) => weigh(*scheme, sources, target),
            Kind::CrossAttention => published_cross_attention(sources, target),
            Kind::Attention(model) => model.weigh(sources, target),
        }
    }
}

impl fmt::Display for Weighting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl FromStr for Weighting {
    type Err = WeightingError;

    /// `NAME`, `NAME:KEY=VALUE[,KEY=VALUE]` or `attention:FILE` (the file is read here).
    fn from_str(text: &str) -> Result<Weighting, WeightingError> {
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        if name == "attention" {
            if rest.is_empty() {
                return Err(WeightingError::NoFile);
            }
            let model = AttentionModel::open(&PathBuf::from(rest))?;
            return Ok(Weighting { name: text.to_owned(), kind: Kind::Attention(Box::new(model)) });
        }
        let mut parameters = Parameters::parse(name, rest)?;
        let kind = match name {
            "mean" => Kind::Formula(Scheme::MEAN),
            "l1" => Kind::Formula(Scheme::L1),
            "frobenius" => Kind::Formula(Scheme::FROBENIUS),
            "relative-frobenius" => Kind::Formula(Scheme::RELATIVE_FROBENIUS),
            "cross-attention" => Kind::CrossAttention,
            "gaussian" => {
                let (value, text) = parameters.number("beta", 1.0)?;
                let wanted = "finite and at least 0";
                Kind::Formula(Scheme::gaussian(value).map_err(|_| parameters.bad("beta", wanted, &text))?)
            }
            "distance" => {
                let (value, text) = parameters.number("power", 1.0)?;
                let power = if value.fract() == 0.0 { value as u32 } else { 0 };
                Kind::Formula(Scheme::distance(power).map_err(|_| parameters.bad("power", "1, 2 or 3", &text))?)
            }
            "error" => {
                let angle = match parameters.take("angle").as_deref() {
                    None | Some("axis") => AngleKind::PrincipalAxis,
                    Some("full") => AngleKind::FullRotation,
                    Some(other) => return Err(parameters.bad("angle", "axis or full", other)),
                };
                let (value, text) = parameters.number("alpha", 1.0)?;
                let wanted = "between 0 and 1";
                Kind::Formula(Scheme::error(value, angle).map_err(|_| parameters.bad("alpha", wanted, &text))?)
            }
            _ => return Err(WeightingError::UnknownScheme { name: name.to_owned() }),
        };
        parameters.finish()?;
        Ok(Weighting { name: text.to_owned(), kind })
    }
}

/// The `KEY=VALUE` pairs behind a scheme's name, taken one by one.
struct Parameters {
    scheme: String,
    pairs: Vec<(String, String)>,
}

impl Parameters {
    fn parse(scheme: &str, text: &str) -> Result<Parameters, WeightingError> {
        let mut pairs = Vec::new();
        for pair in text.split(',').filter(|pair| !pair.is_empty()) {
            let (key, value) = pair.split_once('=').unwrap_or((pair, ""));
            pairs.push((key.to_owned(), value.to_owned()));
        }
        Ok(Parameters { scheme: scheme.to_owned(), pairs })
    }

    fn take(&mut self, key: &str) -> Option<String> {
        let at = self.pairs.iter().position(|(k, _)| k == key)?;
        Some(self.pairs.remove(at).1)
    }

    /// The number given for `key` with its text, or the default.
    fn number(&mut self, key: &str, default: f32) -> Result<(f32, String), WeightingError> {
        match self.take(key) {
            None => Ok((default, default.to_string())),
            Some(text) => match text.parse() {
                Ok(value) => Ok((value, text)),
                Err(_) => Err(self.bad(key, "a number", &text)),
            },
        }
    }

    fn bad(&self, key: &str, wanted: &'static str, value: &str) -> WeightingError {
        WeightingError::BadValue { scheme: self.scheme.clone(), key: key.to_owned(), wanted, value: value.to_owned() }
    }

    fn finish(self) -> Result<(), WeightingError> {
        match self.pairs.into_iter().next() {
            None => Ok(()),
            Some((key, _)) => Err(WeightingError::UnknownParameter { scheme: self.scheme, key }),
        }
    }
}
