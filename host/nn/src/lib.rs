//! Neural networks: their parameters from checkpoints.
#![forbid(unsafe_code)]

pub mod checkpoint;
pub mod formula;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
