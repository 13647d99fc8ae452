//! Neural networks: their parameters from checkpoints.
#![forbid(unsafe_code)]

pub mod checkpoint;
pub mod formula;
