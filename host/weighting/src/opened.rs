//! A choice of the scheme that is ready for use.

use crate::attention::AttentionError;
use crate::choice::WeightingChoice;
use crate::weighting::Weighting;
use std::fmt;
use std::path::Path;

/// A scheme that is ready for use, or the choice of the best one.
#[derive(Clone, Debug)]
pub enum OpenedChoice {
    /// The best one for the scene, found from the sources alone.
    Auto,
    /// This one.
    Given(Weighting),
}

impl OpenedChoice {
    /// The file of the scheme's parameters, if any.
    pub fn file(&self) -> Option<&Path> {
        match self {
            OpenedChoice::Auto => None,
            OpenedChoice::Given(weighting) => weighting.file(),
        }
    }
}

impl WeightingChoice {
    /// Opens the scheme, if one is given: learned attention is read from its file.
    ///
    /// # Errors
    /// [`AttentionError`], always with the file.
    pub fn open(&self) -> Result<OpenedChoice, AttentionError> {
        match self {
            WeightingChoice::Auto => Ok(OpenedChoice::Auto),
            WeightingChoice::Given(spec) => Ok(OpenedChoice::Given(spec.open()?)),
        }
    }
}

impl From<Weighting> for OpenedChoice {
    fn from(weighting: Weighting) -> OpenedChoice {
        OpenedChoice::Given(weighting)
    }
}

impl fmt::Display for OpenedChoice {
    /// The name in tables and records.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OpenedChoice::Auto => WeightingChoice::Auto.fmt(f),
            OpenedChoice::Given(weighting) => weighting.fmt(f),
        }
    }
}
