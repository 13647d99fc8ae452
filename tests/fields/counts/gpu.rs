//! A device that computes as the CPU does and says that it is a GPU: what fields do on GPUs, with its transfers
//! counted.

use std::sync::{Mutex, MutexGuard};
use viewfuse::device::argument;
use viewfuse::device::cpu::{Cpu, Weights};
use viewfuse::device::{
    Device, DeviceError, Element, KernelTime, Later, LayerShape, Memory, TransferCounter, Transfers,
};
use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::rows::*;

/// The CPU with the counts of a GPU.
#[derive(Default)]
pub(super) struct CpuAsGpu(Mutex<TransferCounter>);

impl CpuAsGpu {
    fn counter(&self) -> MutexGuard<'_, TransferCounter> {
        self.0.lock().expect("no panic")
    }
}

impl Memory for CpuAsGpu {
    type Buffer<T: Element> = Vec<T>;

    fn name(&self) -> String {
        "the CPU as a GPU".to_owned()
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Vec<T>, DeviceError> {
        self.counter().upload(size_of_val(values));
        Cpu.upload(values)
    }

    fn table<T: Element>(&self, values: &[T]) -> Result<Vec<T>, DeviceError> {
        Cpu.upload(values)
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Vec<T>, DeviceError> {
        Cpu.zeros(count)
    }

    fn most_elements<T: Element>(&self) -> usize {
        (4 << 30) / size_of::<T>()
    }

    fn busy_elements(&self) -> usize {
        1 << 20
    }

    fn is_software(&self) -> bool {
        false
    }

    fn finish(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        Vec::new()
    }

    fn transfers(&self) -> Transfers {
        self.counter().transfers()
    }

    fn download_first<T: Element>(&self, buffer: &Vec<T>, count: usize) -> Result<Vec<T>, DeviceError> {
        let values = Cpu.download_first(buffer, count)?;
        self.counter().download(size_of_val(&values[..]));
        Ok(values)
    }

    fn download_later<T: Element>(&self, buffer: &Vec<T>) -> Result<Later<'_, T>, DeviceError> {
        let values = Cpu.download(buffer)?;
        let number = self.counter().ask();
        Ok(Later::new(move || {
            self.counter().take(number, size_of_val(&values[..]));
            Ok(values)
        }))
    }
}

macro_rules! methods {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({ $kind:ident $array:ident: $Host:ty, $($how:tt)* })+ }
        $($rest:tt)*
    })+) => {
        impl Device for CpuAsGpu {
            type Weights = Weights;

            fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Weights, DeviceError> {
                self.counter().upload(size_of_val(weights));
                Cpu.weights(shape, weights)
            }

            $(
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($count: u32,)*
                    $($array: argument!($kind $Host),)+
                ) -> Result<(), DeviceError> {
                    Cpu.$method($($block,)? $($count,)* $($array),+)
                }
            )+
        }
    };
}

for_each_kernel!(methods);
