//! What can go wrong on the way to a picture, each with the numbers that a person needs.

use ash::vk;
use std::fmt;
use std::time::Duration;

/// Why work on a Vulkan device failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VulkanError {
    /// There is no Vulkan loader on this machine.
    #[error("no Vulkan loader: {detail}; on Debian it is the package libvulkan1")]
    NoLoader {
        /// What the system's linker said.
        detail: String,
    },
    /// The loader is older than Vulkan 1.1.
    #[error("the Vulkan loader is of version {}; 1.1 is needed", version(*.found))]
    LoaderTooOld {
        /// Its version, packed.
        found: u32,
    },
    /// No driver, or none with a device.
    #[error("no Vulkan device: {detail}")]
    NoDevice {
        /// What was looked for and what is there.
        detail: String,
    },
    /// The device lacks something.
    #[error("{device} lacks what viewfuse needs: {}", list(.missing))]
    Missing {
        /// The device.
        device: String,
        /// What it lacks.
        missing: Vec<Missing>,
    },
    /// The work needs more than a limit of the device allows, and cannot be cut any finer.
    #[error("{device}: {what} needs {needed} bytes, but {limit} is {available}")]
    Limit {
        /// The device.
        device: String,
        /// What was to be done.
        what: String,
        /// The limit's name in Vulkan.
        limit: &'static str,
        /// What would be needed.
        needed: u64,
        /// What the device allows.
        available: u64,
    },
    /// There is not enough memory.
    #[error("{device} is out of memory: {asked} bytes were asked for, {available} of {total} are free")]
    OutOfMemory {
        /// The device.
        device: String,
        /// How much was asked for.
        asked: u64,
        /// How much is free, as far as the device says.
        available: u64,
        /// How much there is.
        total: u64,
    },
    /// The memory's manager failed for another reason than lack of memory.
    #[error("{device}: {detail}")]
    Memory {
        /// The device.
        device: String,
        /// What it said.
        detail: String,
    },
    /// The device stopped working: a driver's fault, a reset, a card that was taken out.
    #[error("{device} was lost in {call}")]
    DeviceLost {
        /// The device.
        device: String,
        /// The call that found out.
        call: &'static str,
    },
    /// A submission took too long.
    #[error("{device}: {work} did not end within {} s", .limit.as_secs_f64())]
    TimeLimit {
        /// The device.
        device: String,
        /// What was running.
        work: String,
        /// How long it was given.
        limit: Duration,
    },
    /// The validation layers complained.
    #[error("validation: {message}")]
    Validation {
        /// The first message.
        message: String,
    },
    /// The validation layer was asked for and is not there.
    #[error("the layer {layer} is not installed; on Debian it is the package vulkan-validationlayers")]
    NoValidation {
        /// Its name.
        layer: &'static str,
    },
    /// A kernel was given arrays that are not those of its list.
    #[error("kernel {kernel}: {detail}")]
    Arguments {
        /// The kernel.
        kernel: &'static str,
        /// What does not fit.
        detail: String,
    },
    /// An array lies in the memory of another device.
    #[error("the array lies in the memory of {owner}, not of {device}")]
    OtherDevice {
        /// The device that was to use it.
        device: String,
        /// The device that has it.
        owner: String,
    },
    /// Any other call that failed.
    #[error("{call}: {result}")]
    Call {
        /// The call.
        call: &'static str,
        /// Vulkan's answer.
        result: vk::Result,
    },
}

/// Something that a device lacks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Missing {
    /// The version of Vulkan, packed.
    Version {
        /// What it has.
        found: u32,
    },
    /// A feature, by Vulkan's name.
    Feature(&'static str),
    /// A limit that is too low.
    Limit {
        /// Vulkan's name.
        name: &'static str,
        /// What is needed.
        needed: u64,
        /// What it has.
        found: u64,
    },
    /// A queue that computes.
    ComputeQueue,
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Missing::Version { found } => write!(f, "Vulkan 1.1 (it has {})", version(*found)),
            Missing::Feature(name) => write!(f, "the feature {name}"),
            Missing::Limit { name, needed, found } => write!(f, "{name} of {needed} (it has {found})"),
            Missing::ComputeQueue => write!(f, "a queue that computes"),
        }
    }
}

fn list(missing: &[Missing]) -> String {
    missing.iter().map(Missing::to_string).collect::<Vec<_>>().join(", ")
}

/// A packed version as people write it.
pub fn version(packed: u32) -> String {
    format!("{}.{}.{}", vk::api_version_major(packed), vk::api_version_minor(packed), vk::api_version_patch(packed))
}

/// Adds the call's name to Vulkan's answer.
pub(crate) fn failed(call: &'static str) -> impl Fn(vk::Result) -> VulkanError {
    move |result| VulkanError::Call { call, result }
}
