//! Common parts of long jobs: progress and cancellation through one trait, output files that are written completely or
//! not at all, panics of other libraries as errors, digests of inputs, medians.
//!
//! The modules are listed in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! text       text of files, in messages                    in_line
//! named      the values of an enum by their names          named!, UnknownName
//! shell      words as a shell takes them                  quoted
//! hint       what helps on from an error, as a code       Hint, Hinted
//! progress   progress reports and cancellation                Progress, Silent, Interrupted
//! panics     panics of other libraries as errors              caught
//! files      output files, completely or not at all           write_whole, WholeFile, WholeFolder
//! process    processes that end with their owner              Process
//! digest     SHA-256 of inputs
//! medians    the median, by two conventions                  median, upper_median
//! ```
#![forbid(unsafe_code)]

pub mod digest;
pub mod files;
pub mod hint;
pub mod medians;
pub mod named;
pub mod panics;
pub mod process;
pub mod progress;
pub mod shell;
pub mod text;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
