//! Splits: of a data set's scenes, or of a scene's views.

use std::fmt;
use std::str::FromStr;

/// A split of the scenes of a data set, or of the views of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// For training.
    Train,
    /// For validation during training.
    Validation,
    /// For testing the result.
    Test,
}

/// The name is not that of a split.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a split of a data set: train, val or test")]
pub struct UnknownSplit(String);

impl Split {
    /// All of them.
    pub const ALL: [Split; 3] = [Split::Train, Split::Validation, Split::Test];
}

impl fmt::Display for Split {
    /// As in the folders' suffixes: `train`, `val`, `test`.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Split::Train => "train",
            Split::Validation => "val",
            Split::Test => "test",
        })
    }
}

impl FromStr for Split {
    type Err = UnknownSplit;

    fn from_str(name: &str) -> Result<Split, UnknownSplit> {
        Split::ALL.into_iter().find(|split| split.to_string() == name).ok_or_else(|| UnknownSplit(name.to_owned()))
    }
}
