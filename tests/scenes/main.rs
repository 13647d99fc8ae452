//! Scenes: how they lie on the disk, what is refused with which words, and those that are generated.

mod datasets;
mod errors;
mod layouts;
mod photographs;
mod synthetic;
