//! The CPU: every kernel a loop over its elements, spread over all cores.
//!
//! A kernel's form here is a function of its name in one of the modules, on slices. Most forms call the kernel's body.
//! Where the row says `twin`, the form has its own, faster loops, and the body in `viewfuse-core` is the definition
//! that it is tested against.

mod compositing;
mod group_norm;
mod limits;
mod linear;
mod lists;
mod matrices;
mod network;
mod plane_sweep;
mod points;
mod rays;
mod sampler;
mod scratch;
mod visual_hull;
mod volumes;
mod weighting;
mod winograd;

use super::error::DeviceError;
use super::kernels::{Device, LayerShape};
use super::memory::{Element, KernelTime, Memory};
use crate::argument;
use compositing::*;
use group_norm::*;
use limits::*;
use lists::*;
use matrices::*;
use network::*;
use plane_sweep::*;
use points::*;
use rays::*;
use sampler::*;
use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::rows::*;
use visual_hull::*;
use volumes::*;
use weighting::*;

pub use network::Weights;

/// All cores of this machine. Buffers are vectors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cpu;

impl Memory for Cpu {
    type Buffer<T: Element> = Vec<T>;

    fn name(&self) -> String {
        format!("cpu ({} threads)", rayon::current_num_threads())
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Vec<T>, DeviceError> {
        Ok(values.to_vec())
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Vec<T>, DeviceError> {
        Ok(vec![T::default(); count])
    }

    fn most_elements<T: Element>(&self) -> usize {
        usize::MAX
    }

    fn busy_elements(&self) -> usize {
        1
    }

    fn finish(&self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn kernel_times(&self) -> Vec<KernelTime> {
        Vec::new()
    }

    fn download<T: Element>(&self, buffer: &Vec<T>) -> Result<Vec<T>, DeviceError> {
        Ok(buffer.clone())
    }
}

/// How a form takes it: as a slice.
macro_rules! lend {
    (optional $array:ident) => {
        $array.map(Vec::as_slice)
    };
    ($kind:ident $array:ident) => {
        $array
    };
}

macro_rules! forms {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({ $kind:ident $array:ident: $Host:ty, $($how:tt)* })+ }
        $($rest:tt)*
    })+) => {
        impl Device for Cpu {
            type Weights = Weights;

            fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Weights, DeviceError> {
                Ok(Weights::new(shape, weights))
            }

            $(
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($count: u32,)*
                    $($array: argument!($kind $Host),)+
                ) -> Result<(), DeviceError> {
                    $method($($block,)? $($count,)* $(lend!($kind $array)),+);
                    Ok(())
                }
            )+
        }
    };
}

for_each_kernel!(forms);
