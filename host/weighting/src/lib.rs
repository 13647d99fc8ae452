//! How much each source view counts for a target view: weighting schemes by name, attention with parameters from files, and
//! weightings by code from outside.
//!
//! ```text
//! sources     how many sources there can be              SourcePoses, SourceWeights
//! attention   attention's parameters from files          AttentionModel
//! spec        what a person types, opening no file       WeightingSpec, scheme_names, grammar
//! weighting   ready to weigh                             Weighting, Weigh
//! ```

#![forbid(unsafe_code)]

pub mod attention;
pub mod sources;
mod spec;
mod weighting;

pub use spec::{WeightingError, WeightingSpec, grammar, scheme_names};
pub use weighting::{Weigh, Weighting};

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
