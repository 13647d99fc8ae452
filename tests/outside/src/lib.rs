//! What a crate outside of viewfuse adds to it, one file each: a field, a layout of scenes, a weighting. Only the
//! public interface is used; `tests/packages/outside.rs` renders with all three.
#![forbid(unsafe_code)]

mod lines;
mod nearest;
mod plane;

pub use lines::{LIST, Lines};
pub use nearest::Nearest;
pub use plane::Plane;
