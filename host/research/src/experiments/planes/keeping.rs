//! A device that computes on the CPU and keeps what the kernel `blend_planes` was given last.

use super::TargetPlanes;
use std::any::Any;
use std::sync::{Mutex, PoisonError};
use viewfuse_device::argument;
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
    ($({
        $Kernel:ident $method:ident
        doc { $($doc:tt)* }
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({ $kind:ident $array:ident: $Host:ty, $($how:tt)* })+ }
        $($rest:tt)*
    })+) => {
        impl Device for Keeping {
            type Weights = <Cpu as Device>::Weights;

            fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Self::Weights, DeviceError> {
                Cpu.weights(shape, weights)
            }

            $(
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($count: u32,)*
                    $($array: argument!($kind $Host),)+
                ) -> Result<(), DeviceError> {
                    self.look(Kernel::$Kernel, &[$($block)?], &[$(shown!($kind $array)),+]);
                    Cpu.$method($($block,)? $($count,)* $($array),+)
                }
            )+
        }
    };
}

for_each_kernel!(forward);
