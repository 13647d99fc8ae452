//! The Vulkan devices of the machine that tests run on.

use std::env;
use std::path::PathBuf;
use std::sync::Arc;
use viewfuse::vulkan::{Adapter, Instance, InstanceOptions, VulkanError};

/// All of them, with the loader and the validation layers that the environment asks for (`VIEWFUSE_VULKAN_LOADER`,
/// `VIEWFUSE_VALIDATION=1`), as the command does it.
///
/// # Errors
/// [`VulkanError`] without a loader, a driver or a device.
pub fn vulkan_devices() -> Result<(Arc<Instance>, Vec<Adapter>), VulkanError> {
    viewfuse::device::choice::vulkan_devices(&InstanceOptions {
        loader: env::var_os("VIEWFUSE_VULKAN_LOADER").map(PathBuf::from),
        validation: env::var_os("VIEWFUSE_VALIDATION").is_some_and(|value| value == "1"),
    })
}
