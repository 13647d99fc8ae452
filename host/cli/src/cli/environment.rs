//! The environment variables of the command.

use std::env;
use std::path::PathBuf;
use viewfuse_device::choice::DeviceOptions;
use viewfuse_vulkan::{GpuOptions, InstanceOptions};

/// `VIEWFUSE_VULKAN_LOADER` is the path of another Vulkan loader; `VIEWFUSE_VALIDATION=1` turns on the validation layers,
/// each of whose messages is an error.
pub(crate) fn instance_options() -> InstanceOptions {
    InstanceOptions {
        loader: env::var_os("VIEWFUSE_VULKAN_LOADER").map(PathBuf::from),
        validation: env::var_os("VIEWFUSE_VALIDATION").is_some_and(|value| value == "1"),
    }
}

/// The environment's Vulkan, with these device options.
pub(crate) fn device_options(gpu: GpuOptions) -> DeviceOptions {
    DeviceOptions { instance: instance_options(), gpu }
}
