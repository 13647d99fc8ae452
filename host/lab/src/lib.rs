//! The laboratory: what viewfuse is trained and tried with, beside the product and not part of it.
//!
//! ```text
//! scenes   generated scenes with exact poses and depths
//! train    networks and weightings, learned from scenes
//! report   evaluations, run times and trainings on one page
//! command  the command `viewfuse-lab`
//! ```
#![forbid(unsafe_code)]
#![allow(missing_docs, reason = "no library for users: what a name says is not said again")]

mod command;
pub mod report;
pub mod scenes;
pub mod train;

pub use command::main;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
