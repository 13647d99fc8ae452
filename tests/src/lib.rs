//! What the tests of viewfuse share: scenes built on disk, and running the command. Seeded inputs, comparators that NaN
//! cannot slip through and the evaluations in `f64` are the program's own, in `viewfuse::check`.
#![forbid(unsafe_code)]

pub mod alone;
pub mod checkpoints;
pub mod cloud;
pub mod command;
pub mod contract;
pub mod devices;
pub mod emulator;
pub mod fields;
pub mod listener;
pub mod lorry;
pub mod mixture;
pub mod module;
pub mod patience;
pub mod places;
pub mod scenes;
pub mod source;
pub mod trials;
pub mod viewer;

/// The examples of the main README, and of core's, the kernels' and the weighting's, compiled and run. Core and kernels
/// are `no_std` and become shaders: they have no tests of their own. The weighting's example scores pictures.
#[cfg(doctest)]
mod readmes {
    #[doc = include_str!("../../README.md")]
    struct Main;
    #[doc = include_str!("../../core/README.md")]
    struct Core;
    #[doc = include_str!("../../core/kernels/README.md")]
    struct Kernels;
    #[doc = include_str!("../../host/weighting/README.md")]
    struct Weighting;
}
