//! The quality of pictures and their run time.
//!
//! The modules are listed in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! metrics      metrics of pictures
//! baseline     baselines without a field: copies and warps of the nearest sources
//! score_json   numbers of scores as JSON
//! evaluator    each weighting scheme on held-out views               Evaluator
//! protocol     which views are sources, which are targets
//! pareto       error against run time
//! run_folder   an evaluation that resumes after a kill, in shards
//! summary      its tables: means with intervals
//! gallery      its pictures
//! ```
#![forbid(unsafe_code)]

pub mod baseline;
mod evaluator;
pub mod gallery;
pub mod metrics;
pub mod pareto;
pub mod protocol;
pub mod run_folder;
mod score_json;
pub mod summary;

pub use evaluator::*;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
