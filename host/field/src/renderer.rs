//! A field on a device, without types: what commands, evaluations and other loops drive. Each pair of device and field is
//! compiled once, here or where an application pairs its own.

use super::error::FieldError;
use super::field::{About, Field, Prepared};
use viewfuse_device::{Device, DeviceError, KernelTime, Transfers};
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;

/// A field on a device.
pub trait Renderer: Sync {
    /// What the field wants, and how it works.
    fn about(&self) -> About;

    /// What the run record calls the device.
    fn device_name(&self) -> String;

    /// Takes the photographs to the device.
    ///
    /// # Errors
    /// [`FieldError`].
    fn prepare<'a>(
        &'a self,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError>;

    /// Waits until everything that was asked for is done, so that its time can be told.
    ///
    /// # Errors
    /// If the device is lost, or a kernel took too long.
    fn finish(&self) -> Result<(), DeviceError>;

    /// What each kernel took so far; nothing for devices that do not tell.
    fn kernel_times(&self) -> Vec<KernelTime>;

    /// What went to the device and came back so far; nothing for devices whose memory is the host's.
    fn transfers(&self) -> Transfers;
}

/// A renderer from a device and a field, whoever wrote them.
#[derive(Debug)]
pub struct On<'a, D, F> {
    /// Where kernels run.
    pub device: &'a D,
    /// What makes the pictures.
    pub field: &'a F,
}

impl<D: Device + Sync, F: Field + Sync> Renderer for On<'_, D, F> {
    fn about(&self) -> About {
        self.field.about()
    }

    fn device_name(&self) -> String {
        self.device.name()
    }

    fn prepare<'a>(
        &'a self,
        sources: &SourceImages,
        progress: &dyn Progress,
    ) -> Result<Box<dyn Prepared + 'a>, FieldError> {
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
