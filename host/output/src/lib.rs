//! What a run writes beside its pictures.
#![forbid(unsafe_code)]

pub mod canvas;
pub mod png;
pub mod record;
pub mod sheet;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
