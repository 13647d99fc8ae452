//! The kernels of viewfuse on any Vulkan device.
//!
//! The kernels are functions of `viewfuse-kernels`; rust-gpu makes them into SPIR-V (`shaders/`, `cargo shaders`), which
//! is part of this crate. Vulkan is loaded at run time. The modules are listed in the order of the data:
//!
//! ```text
//! error                          the errors, with numbers
//! kernel                         the list of kernels: names, arrays, parameters
//! messages, instance             the loader and its drivers
//! subgroups, matrices, adapter   devices, what they can do, and missing requirements
//! handle, buffer                 an opened device, memory in it
//! forms, verdicts                forms of tiles: what is measured, what is chosen, what is trusted
//! excerpt, pipelines             the part of a module that a kernel needs, pipelines of kernels
//! ahead                          pipelines that are compiled before their first use
//! commands, submissions          command buffers, submitted
//! staging                        the memory that uploads pass through
//! gpu                            an opened device: its state, recorded commands
//! remembered                     pipelines and forms from one process to the next
//! packed, dispatch, pieces       dispatches, split to fit the device and its watchdog; weights as f16
//! recording                      dispatches that are recorded once and submitted again
//! measure                        forms compared and timed
//! transfers                      arrays between host and device
//! trust                          products by matrix units, tried before they are used
//! ```
//!
//! Unsafe code is only in calls of Vulkan; each has a comment why it is sound.

mod adapter;
mod ahead;
mod buffer;
mod commands;
mod dispatch;
mod error;
mod excerpt;
mod forms;
mod gpu;
mod handle;
mod instance;
pub mod kernel;
mod matrices;
mod measure;
mod messages;
mod packed;
mod pieces;
mod pipelines;
mod recording;
mod remembered;
mod staging;
mod subgroups;
mod submissions;
mod transfers;
mod trust;
mod verdicts;

pub use adapter::{Adapter, AdapterKind, Limits};
pub use buffer::{Bound, Buffer, Coming};
pub use error::{Missing, VulkanError, version};
pub use gpu::{Faults, Gpu, GpuOptions, Tally};
pub use instance::{Instance, InstanceOptions};
pub use messages::Messages;
pub use recording::Recording;

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
