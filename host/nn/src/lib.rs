//! Neural networks on any device: their parameters from checkpoints, and the layers that all networks of viewfuse
//! share.
//!
//! ```text
//! checkpoint             files of named tensors, and which of them an architecture must have
//! initialisation         deterministic initialisation of test networks
//! image, scratch         images in a device's memory, and their buffers, used again and again
//! window                 positions of windows on an image
//! linear, convolution    one layer or operation each
//! norm, pool, resample
//! attention
//! weights, loader        tensors in the order of kernels, batch norms folded in; to the device
//! resnet                 the trunk of both published networks
//! ```
//!
//! Images are `[row][column][channel]`, matrices `[row][column]`. A layer is loaded once and run with options on images
//! of any size. Sums run in an order of the device's choice.
#![forbid(unsafe_code)]

pub mod attention;
pub mod checkpoint;
pub mod convolution;
pub mod image;
pub mod initialisation;
pub mod linear;
pub mod loader;
pub mod norm;
pub mod pool;
pub mod resample;
pub mod resnet;
pub mod scratch;
pub mod weights;
mod window;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
