//! The choice of a device: the devices of this machine, the requested one, and the reason for the chosen one.

use super::cpu::Cpu;
use super::kernels::Device;
use super::memory::Memory;
use super::precision::Precision;
use super::vulkan::Vulkan;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;
use viewfuse_kernels::rows::Kernel;
use viewfuse_vulkan::{Adapter, GpuOptions, Instance, InstanceOptions, VulkanError};

/// The requested device.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceChoice {
    /// The first GPU that fulfils the requirements, otherwise the CPU.
    Auto,
    /// All cores of this machine.
    Cpu,
    /// A Vulkan device: its number or whole words of its name; empty for the best.
    Vulkan(String),
}

/// A text that does not name a device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown device '{0}'; the choices are auto, cpu, vulkan, vulkan:NUMBER, vulkan:NAME (see `viewfuse devices`)")]
pub struct UnknownDevice(String);

impl FromStr for DeviceChoice {
    type Err = UnknownDevice;

    fn from_str(text: &str) -> Result<DeviceChoice, UnknownDevice> {
        match text.split_once(':') {
            None if text == "auto" => Ok(DeviceChoice::Auto),
            None if text == "cpu" => Ok(DeviceChoice::Cpu),
            None if text == "vulkan" => Ok(DeviceChoice::Vulkan(String::new())),
            Some(("vulkan", wanted)) if !wanted.is_empty() => Ok(DeviceChoice::Vulkan(wanted.to_owned())),
            _ => Err(UnknownDevice(text.to_owned())),
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DeviceChoice::Auto => f.write_str("auto"),
            DeviceChoice::Cpu => f.write_str("cpu"),
            DeviceChoice::Vulkan(wanted) if wanted.is_empty() => f.write_str("vulkan"),
            DeviceChoice::Vulkan(wanted) => write!(f, "vulkan:{wanted}"),
        }
    }
}

/// One of the devices.
pub enum AnyDevice {
    /// All cores of this machine.
    Cpu(Cpu),
    /// A Vulkan device.
    Vulkan(Box<Vulkan>),
}

impl AnyDevice {
    /// Its name in the run record.
    pub fn name(&self) -> String {
        match self {
            AnyDevice::Cpu(cpu) => cpu.name(),
            AnyDevice::Vulkan(vulkan) => vulkan.name(),
        }
    }

    /// Begins to compile kernels; see [`Device::compile_ahead`].
    pub fn compile_ahead(&self, kernels: &[Kernel]) {
        match self {
            AnyDevice::Cpu(cpu) => cpu.compile_ahead(kernels),
            AnyDevice::Vulkan(vulkan) => vulkan.compile_ahead(kernels),
        }
    }

    /// The precisions that it has besides the exact one, the coarsest first; see [`Device::rounds`].
    pub fn precisions(&self) -> Vec<Precision> {
        match self {
            AnyDevice::Cpu(cpu) => cpu.precisions(),
            AnyDevice::Vulkan(vulkan) => vulkan.precisions(),
        }
    }
}

/// A device, and the reason for choosing it.
pub struct Chosen {
    /// The device.
    pub device: AnyDevice,
    /// The reason, as text that follows the device's name.
    pub reason: String,
}

/// Options for finding and opening devices.
#[derive(Clone, Debug, Default)]
pub struct DeviceOptions {
    /// The Vulkan loader, and whether validation layers are on.
    pub instance: InstanceOptions,
    /// Options of a Vulkan device.
    pub gpu: GpuOptions,
    /// Folder where Vulkan devices remember what they compiled and measured; without one, each process does it anew.
    pub memory: Option<PathBuf>,
}

impl DeviceOptions {
    fn open(&self, instance: &Arc<Instance>, adapter: &Adapter) -> Result<Vulkan, VulkanError> {
        match &self.memory {
            Some(folder) => Vulkan::open_with_memory(instance, adapter, &self.gpu, folder),
            None => Vulkan::open(instance, adapter, &self.gpu),
        }
    }
}

/// Opens the requested device.
///
/// # Errors
/// [`VulkanError`] if a Vulkan device was requested and cannot be opened; the automatic choice falls back on the CPU.
pub fn open(choice: &DeviceChoice, options: &DeviceOptions) -> Result<Chosen, VulkanError> {
    let cpu = |reason: String| Chosen { device: AnyDevice::Cpu(Cpu), reason };
    match choice {
        DeviceChoice::Cpu => Ok(cpu("requested".to_owned())),
        DeviceChoice::Vulkan(wanted) => {
            let (instance, adapters) = vulkan_devices(&options.instance)?;
            let adapter = Adapter::choose(&adapters, wanted)?;
            let device = options.open(&instance, adapter)?;
            Ok(Chosen { device: AnyDevice::Vulkan(Box::new(device)), reason: "requested".to_owned() })
        }
        DeviceChoice::Auto => Ok(match automatic(options) {
            Ok(device) => {
                Chosen { device: AnyDevice::Vulkan(Box::new(device)), reason: "the first usable GPU".to_owned() }
            }
            Err(reason) => cpu(reason),
        }),
    }
}

/// Several devices, used one after the other.
#[derive(Default)]
pub struct Several {
    /// The devices; the CPU comes first unless requested otherwise.
    pub devices: Vec<AnyDevice>,
    /// Devices that lack a requirement, and what they lack; or the reason why there is only the CPU.
    pub notes: Vec<String>,
    /// Devices that fulfil the requirements but could not be opened.
    pub failures: Vec<String>,
}

/// Opens the requested devices, in that order; without a request, all usable ones.
///
/// # Errors
/// [`VulkanError`] if a device was requested and cannot be opened.
pub fn open_several(requested: &[DeviceChoice], options: &DeviceOptions) -> Result<Several, VulkanError> {
    let mut several = Several::default();
    if !requested.is_empty() {
        several.devices = requested.iter().map(|choice| Ok(open(choice, options)?.device)).collect::<Result<_, _>>()?;
        return Ok(several);
    }
    several.devices.push(AnyDevice::Cpu(Cpu));
    match vulkan_devices(&options.instance) {
        Ok((instance, adapters)) => {
            for adapter in &adapters {
                match options.open(&instance, adapter) {
                    Ok(device) => several.devices.push(AnyDevice::Vulkan(Box::new(device))),
                    Err(error @ VulkanError::Missing { .. }) => several.notes.push(format!("left aside: {error}")),
                    Err(error) => several.failures.push(error.to_string()),
                }
            }
        }
        // A machine without Vulkan has a CPU.
        Err(error) => several.notes.push(format!("only the CPU: {error}")),
    }
    Ok(several)
}

/// The first usable GPU, or the reason why there is none.
fn automatic(options: &DeviceOptions) -> Result<Vulkan, String> {
    let (instance, adapters) =
        vulkan_devices(&options.instance).map_err(|error| format!("because there is {error}"))?;
    let mut reasons = Vec::new();
    for adapter in &adapters {
        if !adapter.kind.is_gpu() {
            reasons.push(format!("{} is not a GPU", adapter.name));
            continue;
        }
        match options.open(&instance, adapter) {
            Ok(device) => return Ok(device),
            Err(error) => reasons.push(error.to_string()),
        }
    }
    Err(format!("because {}", reasons.join(" and ")))
}

/// Vulkan with its devices, the preferred ones first.
///
/// # Errors
/// [`VulkanError`] without a loader, a driver or a device.
pub fn vulkan_devices(options: &InstanceOptions) -> Result<(Arc<Instance>, Vec<Adapter>), VulkanError> {
    let instance = Instance::load(options)?;
    let adapters = instance.adapters()?;
    Ok((instance, adapters))
}
