//! Why a device could not do its work.

use std::error::Error;
use viewfuse_vulkan::VulkanError;

/// A device failed: the one error of every device, so that what is built upon devices has errors without parameters. What
/// the device itself said is shown as it is.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// A Vulkan device did.
    #[error(transparent)]
    Vulkan(#[from] VulkanError),
    /// A device of another kind did.
    #[error(transparent)]
    Other(Box<dyn Error + Send + Sync>),
}
