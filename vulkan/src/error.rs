//! Errors of Vulkan devices, with the numbers that a person needs.

use ash::vk;
use std::fmt;
use std::time::Duration;

/// Why work on a Vulkan device failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VulkanError {
    /// There is no Vulkan loader on this machine: the error of the system's linker.
    #[error("no Vulkan loader: {0}; on Debian it is the package libvulkan1")]
    NoLoader(String),
    /// The loader is older than Vulkan 1.1: its version, packed.
    #[error("the Vulkan loader is of version {}; 1.1 is needed", version(*.0))]
    LoaderTooOld(u32),
    /// No driver, or none with a device: the request, and the devices that exist.
    #[error("no Vulkan device: {0}")]
    NoDevice(String),
    /// No device has this number, or these words in its name, between quotes; and number and name of each device.
    #[error("no Vulkan device {}; {}", .0, counted(.1))]
    NoSuchDevice(String, Vec<String>),
    /// The device lacks requirements.
    #[error("{} lacks what viewfuse needs: {}", .0, list(.1))]
    Missing(String, Vec<Missing>),
    /// The work exceeds a limit of the device, and cannot be split any finer.
    #[error("{device}: {what} needs {needed} bytes, but {limit} is {available}")]
    Limit {
        /// The device.
        device: String,
        /// The work.
        what: String,
        /// The limit's name in Vulkan.
        limit: &'static str,
        /// The required value.
        needed: u64,
        /// The device's limit.
        available: u64,
    },
    /// The device has not enough free memory.
    #[error("{device} is out of memory: {requested} bytes were requested, {available} of {total} are free")]
    OutOfMemory {
        /// The device.
        device: String,
        /// Requested bytes.
        requested: u64,
        /// Free bytes, as reported by the device.
        available: u64,
        /// All bytes.
        total: u64,
    },
    /// The device's memory allocator failed for another reason than lack of memory.
    #[error("{0}: {1}")]
    Memory(String, String),
    /// The device was lost: a fault of the driver, a reset, or a removed card; and the call that reported it.
    #[error("{0} was lost in {1}")]
    DeviceLost(String, &'static str),
    /// A submission exceeded its time limit.
    #[error("{device}: {work} did not finish within {} s", .limit.as_secs_f64())]
    TimeLimit {
        /// The device.
        device: String,
        /// The work of the submission.
        work: String,
        /// The time limit.
        limit: Duration,
    },
    /// The validation layers reported an error: the first message.
    #[error("validation: {0}")]
    Validation(String),
    /// The requested validation layer is not installed.
    #[error("the layer {0} is not installed; on Debian it is the package vulkan-validationlayers")]
    NoValidation(&'static str),
    /// A kernel's arguments do not match its row: the kernel, and the difference.
    #[error("kernel {0}: {1}")]
    Arguments(&'static str, String),
    /// An array is not in the memory of the kernel's device, but of another one.
    #[error("the array is in the memory of {1}, opened by itself, not in that of {0} as it is used here")]
    OtherDevice(String, String),
    /// Any other call that failed, with Vulkan's result code.
    #[error("{0}: {1}")]
    Call(&'static str, vk::Result),
}

/// A missing requirement of a device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Missing {
    /// A version of Vulkan: the device's, packed.
    Version(u32),
    /// A feature, by Vulkan's name.
    Feature(&'static str),
    /// A limit that is too low.
    Limit {
        /// Vulkan's name.
        name: &'static str,
        /// The required value.
        needed: u64,
        /// The device's value.
        found: u64,
    },
    /// A compute queue.
    ComputeQueue,
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Missing::Version(found) => write!(f, "Vulkan 1.1 (it has {})", version(*found)),
            Missing::Feature(name) => write!(f, "the feature {name}"),
            Missing::Limit { name, needed, found } => write!(f, "{name} of {needed} (it has {found})"),
            Missing::ComputeQueue => write!(f, "a compute queue"),
        }
    }
}

/// Devices in words.
fn counted(there: &[String]) -> String {
    match there {
        [] => "there is none".to_owned(),
        [one] => format!("there is: {one}"),
        several => format!("there are: {}", several.join(", ")),
    }
}

fn list(missing: &[Missing]) -> String {
    missing.iter().map(Missing::to_string).collect::<Vec<_>>().join(", ")
}

/// A packed version as text.
pub fn version(packed: u32) -> String {
    format!("{}.{}.{}", vk::api_version_major(packed), vk::api_version_minor(packed), vk::api_version_patch(packed))
}

/// Adds the call's name to Vulkan's result code.
pub(crate) fn failed(call: &'static str) -> impl Fn(vk::Result) -> VulkanError {
    move |result| VulkanError::Call(call, result)
}
