//! A device that computes on the CPU and keeps what the kernel `blend_planes` was given last.

use super::TargetPlanes;
use std::any::Any;
use std::sync::{Mutex, PoisonError};
use viewfuse_device::cpu::Cpu;
use viewfuse_device::{Device, DeviceError, Element, KernelTime, LayerShape, Memory};
use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::rows::*;

/// The CPU with a memory of one dispatch.
#[derive(Default)]
pub(super) struct Keeping(Mutex<Option<TargetPlanes>>);

impl Keeping {
    /// What was kept since the last call.
    pub(super) fn take(&self) -> Option<TargetPlanes> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Keeps the arguments of the one kernel: its parameters, and the arrays that it reads.
    fn look(&self, kernel: Kernel, block: &[&dyn Any], arrays: &[&dyn Any]) {
        fn copied<T: Clone + 'static>(argument: Option<&&dyn Any>) -> Option<T> {
            argument.and_then(|argument| argument.downcast_ref::<T>()).cloned()
        }
        if kernel == Kernel::BlendPlanes {
            let planes = || {
                Some(TargetPlanes {
                    block: copied(block.first())?,
                    views: copied(arrays.first())?,
                    texels: copied(arrays.get(1))?,
                    disparities: copied(arrays.get(2))?,
                    costs: copied(arrays.get(3))?,
                })
            };
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = planes();
        }
    }
}

impl Memory for Keeping {
    type Buffer<T: Element> = Vec<T>;

    fn name(&self) -> String {
        Cpu.name()
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Vec<T>, DeviceError> {
        Cpu.upload(values)
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Vec<T>, DeviceError> {
        Cpu.zeros(count)
    }

    fn most_elements<T: Element>(&self) -> usize {
        Cpu.most_elements::<T>()
    }

    fn busy_elements(&self) -> usize {
        Cpu.busy_elements()
    }

    fn finish(&self) -> Result<(), DeviceError> {
        Cpu.finish()
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        Cpu.kernel_times()
    }

    fn download<T: Element>(&self, buffer: &Vec<T>) -> Result<Vec<T>, DeviceError> {
        Cpu.download(buffer)
    }
}

/// How the device's method takes an array of a row.
macro_rules! argument {
    (layer $host:ty) => { &<Cpu as Device>::Weights };
    (optional $host:ty) => { Option<&Vec<$host>> };
    (write $host:ty) => { &mut Vec<$host> };
    (write_paged $host:ty) => { &mut Vec<$host> };
    ($kind:ident $host:ty) => { &Vec<$host> };
}

/// An array that can be looked at; of the other kinds nothing.
macro_rules! shown {
    (read $array:ident) => {
        $array
    };
    (paged $array:ident) => {
        $array
    };
    ($kind:ident $array:ident) => {
        &()
    };
}

macro_rules! forward {
    ($(
        $(#[$doc:meta])*
        $Kernel:ident $method:ident($($block:ident: $Block:ty)? $(; $($count:ident),+)?) [$elements:expr]
        by $($body:ident)::+ $(, $way:ident)* {
            $($kind:ident $array:ident: $host:ty $(as $entry:ty)? $(= $other:ident if !$told:ident.$flag:ident)?),+ $(,)?
        }
    )+) => {
        impl Device for Keeping {
            type Weights = <Cpu as Device>::Weights;

            fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Self::Weights, DeviceError> {
                Cpu.weights(shape, weights)
            }

            $(
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($($count: u32,)+)?
                    $($array: argument!($kind $host),)+
                ) -> Result<(), DeviceError> {
                    self.look(Kernel::$Kernel, &[$($block)?], &[$(shown!($kind $array)),+]);
                    Cpu.$method($($block,)? $($($count,)+)? $($array),+)
                }
            )+
        }
    };
}

for_each_kernel!(forward);
