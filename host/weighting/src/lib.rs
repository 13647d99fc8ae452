//! Weights of the source views for a target view: weighting schemes by name, attention with parameters from files, and
//! weightings that other crates implement.
//!
//! ```text
//! sources     the most sources of a run                  SourcePoses, SourceWeights
//! attention   attention's parameters from files          AttentionModel
//! spec        the text form, parsed without any file     WeightingSpec, scheme_names, grammar
//! choice      a scheme or the best for the scene         WeightingChoice, choice_grammar
//! weighting   ready to weigh                             Weighting, Weigh
//! opened      a choice that is ready for use             OpenedChoice
//! select      the few sources that targets need
//! ```

#![forbid(unsafe_code)]

pub mod attention;
mod choice;
mod opened;
pub mod select;
pub mod sources;
mod spec;
mod weighting;

pub use choice::{WeightingChoice, choice_grammar};
pub use opened::OpenedChoice;
pub use spec::{WeightingError, WeightingSpec, grammar, scheme_names};
pub use weighting::{Weigh, Weighting};
