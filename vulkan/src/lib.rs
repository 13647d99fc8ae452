//! The kernels of viewfuse on any Vulkan device.

pub mod kernel;
