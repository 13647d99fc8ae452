//! What long work needs whoever does it: progress and cancellation through one trait, output files that appear whole or
//! not at all, digests of inputs.
#![forbid(unsafe_code)]

#[cfg(feature = "digest")]
pub mod digest;
pub mod files;
pub mod progress;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
