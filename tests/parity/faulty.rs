//! A device that computes on the CPU and gets one kernel wrong.

use viewfuse::device::DeviceError;
use viewfuse::device::argument;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Element, KernelTime, LayerShape, Memory};
use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::rows::*;

/// The CPU, with one kernel's results too large by 1e-3.
pub(crate) struct Faulty {
    /// Which.
    pub(crate) kernel: Kernel,
}

/// Results that can be wrong.
trait Perturb {
    /// Makes all of them too large by 1e-3.
    fn perturb(values: &mut [Self])
    where
        Self: Sized;
}

impl Perturb for f32 {
    fn perturb(values: &mut [f32]) {
        values.iter_mut().for_each(|value| *value *= 1.001);
    }
}

impl<const N: usize> Perturb for [f32; N] {
    fn perturb(values: &mut [[f32; N]]) {
        f32::perturb(values.as_flattened_mut());
    }
}

/// Flags and packed words have no thousandth part: in every thousandth one, from the first on, the last bit is flipped.
impl Perturb for u32 {
    fn perturb(values: &mut [u32]) {
        values.iter_mut().step_by(1000).for_each(|value| *value ^= 1);
    }
}

impl Perturb for TargetRay {
    fn perturb(values: &mut [TargetRay]) {
        values.iter_mut().for_each(|ray| f32::perturb(&mut ray.direction));
    }
}

impl Perturb for RayPoint {
    fn perturb(values: &mut [RayPoint]) {
        values.iter_mut().for_each(|point| f32::perturb(&mut point.position));
    }
}

impl Perturb for ProjectedGaussian {
    fn perturb(values: &mut [ProjectedGaussian]) {
        values.iter_mut().for_each(|splat| f32::perturb(&mut splat.colour));
    }
}

impl Perturb for SplatGradient {
    fn perturb(values: &mut [SplatGradient]) {
        values.iter_mut().for_each(|sums| f32::perturb(&mut sums.colour));
    }
}

impl Perturb for GaussianBlock {
    fn perturb(values: &mut [GaussianBlock]) {
        values.iter_mut().for_each(|gaussian| f32::perturb(&mut gaussian.colour));
    }
}

memory_of_the_cpu!(Faulty, |faulty| format!("faulty {}", faulty.kernel.name()));

/// Perturbs what is written.
macro_rules! perturb {
    (write $array:ident) => {
        Perturb::perturb(&mut $array[..])
    };
    (write_paged $array:ident) => {
        Perturb::perturb(&mut $array[..])
    };
    ($kind:ident $array:ident) => {};
}

macro_rules! forward {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({ $kind:ident $array:ident: $Host:ty, $($how:tt)* })+ }
        $($rest:tt)*
    })+) => {
        impl Device for Faulty {
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
                    Cpu.$method($($block,)? $($count,)* $($array),+)?;
                    if self.kernel == Kernel::$Kernel {
                        $(perturb!($kind $array);)+
                    }
                    Ok(())
                }
            )+
        }
    };
}

for_each_kernel!(forward);
