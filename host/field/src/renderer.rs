//! A field on a device with types erased, for commands, evaluations and other loops. Each pair of device and field is
//! compiled once, here or in the application that combines them.

use super::error::FieldError;
use super::field::{About, Field, Prepared};
use super::variant::AnyOptions;
use viewfuse_device::{Device, DeviceError, KernelTime, Transfers};
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;

/// A field on a device.
pub trait Renderer: Sync {
    /// The field's requirements and properties.
    fn about(&self) -> About;

    /// The field's options.
    fn options(&self) -> AnyOptions;

    /// The device's name in the run record.
    fn device_name(&self) -> String;

    /// What of the device is not used because its results were wrong; see [`Device::faults`].
    fn device_faults(&self) -> Vec<String>;

    /// Takes the photographs to the device.
    ///
    /// # Errors
    /// [`FieldError`].
    fn prepare<'a>(
        &'a self,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError>;

    /// Waits until all dispatched work is done, so that its time can be measured.
    ///
    /// # Errors
    /// If the device is lost, or a kernel took too long.
    fn finish(&self) -> Result<(), DeviceError>;

    /// The time of each kernel so far; empty for devices without timestamps.
    fn kernel_times(&self) -> Vec<KernelTime>;

    /// The transfers so far; zeros for devices whose memory is the host's.
    fn transfers(&self) -> Transfers;
}

/// A renderer from any device and any field.
#[derive(Debug)]
pub struct On<'a, D, F> {
    /// The device.
    pub device: &'a D,
    /// The field.
    pub field: &'a F,
}

impl<D: Device + Sync, F: Field + Sync> Renderer for On<'_, D, F> {
    fn about(&self) -> About {
        self.field.about()
    }

    fn options(&self) -> AnyOptions {
        self.field.options()
    }

    fn device_name(&self) -> String {
        self.device.name()
    }

    fn device_faults(&self) -> Vec<String> {
        self.device.faults()
    }

    fn prepare<'a>(
        &'a self,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared<'a> + 'a>, FieldError> {
        self.field.prepare(self.device, sources, progress)
    }

    fn finish(&self) -> Result<(), DeviceError> {
        self.device.finish()
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        self.device.kernel_times()
    }

    fn transfers(&self) -> Transfers {
        self.device.transfers()
    }
}
