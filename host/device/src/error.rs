//! Why a device could not do its work.

use std::error::Error;
use viewfuse_vulkan::VulkanError;

/// A device failed. This is the one error of every device, so that crates above have errors without type parameters.
/// The device's own message is shown unchanged.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// A Vulkan device failed.
    #[error(transparent)]
    Vulkan(#[from] VulkanError),
    /// A device of another kind failed.
    #[error(transparent)]
    Other(Box<dyn Error + Send + Sync>),
}
