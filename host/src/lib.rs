//! viewfuse: from a handful of posed photographs, the picture from a camera that was never there.
#![forbid(unsafe_code)]

pub mod formula;
pub mod scene;
