//! What long work needs whoever does it: progress and cancellation through one trait, output files that appear whole or
//! not at all, digests of inputs.
//!
//! The modules stand in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! progress   what is reported and asked while work goes on    Progress, Silent, Interrupted
//! files      output files that appear whole or not at all     write_whole
//! digest     SHA-256 of what results hang on
//! ```
#![forbid(unsafe_code)]

#[cfg(feature = "digest")]
pub mod digest;
pub mod files;
pub mod progress;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
