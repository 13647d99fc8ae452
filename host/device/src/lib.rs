//! Devices: where kernels run.
//!
//! A device holds buffers ([`Memory`]) and runs kernels on them, one method per kernel ([`Device`]), made from the rows
//! of [`viewfuse_kernels::rows`], so that a kernel that exists on one device only does not compile. The body of every
//! kernel is a function in `viewfuse-kernels`; a device decides how its elements are spread over cores or invocations.
//!
//! The modules are listed in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! error         the errors of any device                                DeviceError
//! memory        buffers on a device                                     Memory, Element, KernelTime, Recorded
//! parallel      one parallel driver under all kernels of the CPU
//! queue         work on other threads while the caller goes on          Queue
//! precision     how precisely a layer multiplies                        Precision
//! kernels       a method for each kernel, made from the rows            Device, LayerShape
//! bundles       arguments that belong together                          Layer, HullScene, Pixels, Rays
//! cpu, vulkan   the devices                                             Cpu, Vulkan
//! choice        the choice of one of this machine's devices             Choice
//! ```
#![forbid(unsafe_code)]

pub mod bundles;
pub mod choice;
pub mod cpu;
pub mod error;
pub mod kernels;
pub mod memory;
pub mod parallel;
pub mod precision;
pub mod queue;
pub mod vulkan;

pub use bundles::{HullScene, Layer, Pixels, Rays};
pub use error::DeviceError;
pub use kernels::{Device, LayerShape};
pub use memory::{Element, KernelTime, Later, Memory, Recorded, TransferCounter, Transfers};
pub use precision::Precision;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
