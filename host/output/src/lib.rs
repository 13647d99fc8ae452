//! What a run writes beside its pictures.
#![forbid(unsafe_code)]

pub mod canvas;
pub mod png;
pub mod record;
pub mod sheet;
