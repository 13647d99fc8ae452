//! A field of any kind on any of the devices, for applications in which a person chooses both.

use super::field::{About, Field};
use super::renderer::{On, Renderer};
use std::any::Any;
use std::sync::Arc;
use viewfuse_device::choice::AnyDevice;

/// A field of any kind. Copies share it.
#[derive(Clone)]
pub struct AnyField(Arc<dyn OnAnyDevice>);

/// The code that is compiled once a field: the field on each of the devices.
trait OnAnyDevice: Any + Send + Sync {
    fn about(&self) -> About;

    fn on<'a>(&'a self, device: &'a AnyDevice) -> Box<dyn Renderer + 'a>;
}

impl<F: Field + Send + Sync + 'static> OnAnyDevice for F {
    fn about(&self) -> About {
        Field::about(self)
    }

    fn on<'a>(&'a self, device: &'a AnyDevice) -> Box<dyn Renderer + 'a> {
        device.compile_ahead(Field::about(self).kernels);
        match device {
            AnyDevice::Cpu(device) => Box::new(On { device, field: self }),
            AnyDevice::Vulkan(device) => Box::new(On { device: device.as_ref(), field: self }),
        }
    }
}

impl AnyField {
    /// The field with its type erased.
    pub fn new(field: impl Field + Send + Sync + 'static) -> AnyField {
        AnyField(Arc::new(field))
    }

    /// Its requirements and properties.
    pub fn about(&self) -> About {
        self.0.about()
    }

    /// The field on a device, which begins to compile the kernels that the field needs.
    pub fn on<'a>(&'a self, device: &'a AnyDevice) -> Box<dyn Renderer + 'a> {
        self.0.on(device)
    }

    /// The field, if it is of this type.
    pub fn downcast_ref<F: Field + 'static>(&self) -> Option<&F> {
        let field: &dyn Any = self.0.as_ref();
        field.downcast_ref()
    }
}
