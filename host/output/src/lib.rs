//! The output of a run: pictures, depth maps, contact sheets, and the run record ([`run`]).
//!
//! The modules are listed in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! png      pictures as files
//! canvas   text, lines and small pictures on a picture
//! sheet    the contact sheet of a target
//! record   the run record, as JSON
//! run      all of it in a folder
//! folder   checks of that folder before work begins
//! ```
#![forbid(unsafe_code)]

pub mod canvas;
pub mod folder;
pub mod png;
pub mod record;
pub mod run;
pub mod sheet;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
