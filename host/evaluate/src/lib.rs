//! How good pictures are, and at what cost.
#![forbid(unsafe_code)]

mod evaluator;
pub mod gallery;
pub mod inspect;
pub mod metrics;
pub mod pareto;
pub mod protocol;
#[cfg(feature = "report")]
pub mod report;
pub mod run_folder;
pub mod summary;

pub use evaluator::*;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
