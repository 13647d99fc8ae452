//! A field of any kind, and work that any device does with it.

use viewfuse_device::Device;
use viewfuse_device::choice::AnyDevice;
use viewfuse_device::cpu::Cpu;
use viewfuse_field::Field;
use viewfuse_field::genvs::Genvs;
use viewfuse_field::photo::PhotoField;
use viewfuse_field::pixelnerf::PixelNerf;

/// The field of a run.
pub(crate) enum AnyField {
    Photo(PhotoField),
    PixelNerf(Box<PixelNerf>),
    Genvs(Box<Genvs>),
}

/// Work that any device does with any field.
pub(crate) trait Work {
    type Output;

    fn run<D: Device, F: Field<D>>(&self, device: &D, field: &F) -> Self::Output;
}

impl AnyField {
    /// Does a piece of work on a device.
    pub(crate) fn on<W: Work>(&self, device: &AnyDevice, work: &W) -> W::Output {
        match device {
            AnyDevice::Cpu(cpu) => self.on_one(cpu, work),
            AnyDevice::Vulkan(vulkan) => self.on_one(vulkan.as_ref(), work),
        }
    }

    fn on_one<D: Device, W: Work>(&self, device: &D, work: &W) -> W::Output {
        match self {
            AnyField::Photo(field) => work.run(device, field),
            AnyField::PixelNerf(field) => work.run(device, field.as_ref()),
            AnyField::Genvs(field) => work.run(device, field.as_ref()),
        }
    }

    /// What the run record calls it.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            AnyField::Photo(field) => Field::<Cpu>::name(field),
            AnyField::PixelNerf(field) => Field::<Cpu>::name(field.as_ref()),
            AnyField::Genvs(field) => Field::<Cpu>::name(field.as_ref()),
        }
    }

    /// The least number of sources it can work with.
    pub(crate) fn least_sources(&self) -> usize {
        match self {
            AnyField::Photo(field) => Field::<Cpu>::least_sources(field),
            AnyField::PixelNerf(field) => Field::<Cpu>::least_sources(field.as_ref()),
            AnyField::Genvs(field) => Field::<Cpu>::least_sources(field.as_ref()),
        }
    }

    /// Whether its rays end where little light still passes.
    pub(crate) fn ends_rays(&self) -> bool {
        !matches!(self, AnyField::Genvs(_))
    }
}
