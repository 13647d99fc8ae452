//! What a run writes: pictures, depth maps, contact sheets, and the run record ([`run`]).
#![forbid(unsafe_code)]

pub mod canvas;
pub mod png;
pub mod record;
pub mod run;
pub mod sheet;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
