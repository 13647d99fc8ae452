//! The CPU: every kernel a loop over its elements, spread over all cores.
//!
//! The loops are made from the rows. Where a row says `twin`, a function of the kernel's name in one of the modules has
//! its own, faster loops, and the body in `viewfuse-kernels` is the definition that it is tested against; where it says
//! `looped`, such a function has the loop over the body or its parts.

mod blend;
mod census;
mod group_norm;
mod limits;
mod linear;
mod looped;
mod matrices;
mod network;
mod points;
mod scratch;
mod splats;
mod sweep;
mod tracks;
mod volumes;
mod windows;
mod winograd;

use super::error::DeviceError;
use super::kernels::{Device, LayerShape};
use super::memory::{Element, KernelTime, Memory};
use crate::argument;
use crate::parallel::{Rest, for_each_piece};
use blend::*;
use census::*;
use group_norm::*;
use limits::*;
use looped::*;
use matrices::*;
use network::*;
use points::*;
use pulp::Arch;
use splats::*;
use sweep::*;
use viewfuse_kernels::bodies;
use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::rows::*;
use volumes::*;
use windows::*;

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

    fn upload_owned<T: Element>(&self, values: Vec<T>) -> Result<Vec<T>, DeviceError> {
        Ok(values)
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Vec<T>, DeviceError> {
        // Zeroed by the allocator, which has zeroed pages for large ones: `vec![T::default()]` writes them.
        let no_memory = |()| DeviceError::Other(format!("no memory for {count} elements of {}", size_of::<T>()).into());
        bytemuck::try_zeroed_vec(count).map_err(no_memory)
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

    fn download_first<T: Element>(&self, buffer: &Vec<T>, count: usize) -> Result<Vec<T>, DeviceError> {
        Ok(buffer[..count.min(buffer.len())].to_vec())
    }
}

/// How what is written by hand takes an array: as a slice.
macro_rules! lend {
    (optional $array:ident) => {
        $array.map(Vec::as_slice)
    };
    ($kind:ident $array:ident) => {
        $array
    };
}

/// The work of a kernel, by the marks of its row.
macro_rules! compute {
    ({ twin $($mark:ident)* } $method:ident [$($block:ident)?] [$($count:ident)*] [$($array:tt)*] $elements:tt) => {
        by_hand!($method [$($block)? $($count)*] [$($array)*])
    };
    ({ looped $($mark:ident)* } $method:ident [$($block:ident)?] [$($count:ident)*] [$($array:tt)*] $elements:tt) => {
        by_hand!($method [$($block)? $($count)*] [$($array)*])
    };
    ({ together $($mark:ident)* } $($row:tt)*) => { compute!({ $($mark)* } $($row)*) };
    ({ serial } $method:ident $block:tt $counts:tt $arrays:tt $elements:tt) => {
        serial!($method $block $arrays $elements)
    };
    ({ wide } $method:ident $block:tt $counts:tt $arrays:tt $elements:tt) => {
        parallel!(wide $method $block $arrays $elements)
    };
    ({ measured $($mark:ident)* } $($row:tt)*) => { compute!({ $($mark)* } $($row)*) };
    ({} $method:ident $block:tt $counts:tt $arrays:tt $elements:tt) => {
        parallel!(plain $method $block $arrays $elements)
    };
}

macro_rules! by_hand {
    (
        $method:ident [$($argument:ident)*]
        [$({ $kind:ident $array:ident: $Host:ty, as $entry:tt at $place:tt unless $unless:tt })+]
    ) => {
        $method($($argument,)* $(lend!($kind $array)),+)
    };
}

/// One element after the other.
macro_rules! serial {
    (
        $method:ident [$($block:ident)?]
        [$({ $kind:ident $array:ident: $Host:ty, as $entry:tt at {} unless {} })+]
        { for $element:ident in [$elements:expr] at_least [] }
    ) => {
        for $element in $elements {
            bodies::$method($($block,)? $(whole!($kind $array),)+ $element);
        }
    };
}

/// How a body gets an array.
macro_rules! whole {
    (write $array:ident) => {
        &mut $array[..]
    };
    (one $array:ident) => {
        &$array[0]
    };
    ($kind:ident $array:ident) => {
        &$array[..]
    };
}

/// Some elements at a time, on all cores. An optional array's flag says whether it is there.
macro_rules! parallel {
    (
        $width:ident $method:ident [$($block:ident)?]
        [$({
            $kind:ident $array:ident: $Host:ty, as { $($entry:tt)? } at { $($place:expr)? }
            unless { $($other:ident $told:ident $flag:ident)? }
        })+]
        { for $element:ident in [$elements:expr] at_least [$least:literal] }
    ) => {{
        $($(
            let mut told = *$told;
            told.$flag = u32::from($array.is_some());
            let $told = &told;
            let $array = $array.map_or(&[][..], Vec::as_slice);
            let _ = $other;
        )?)+
        $(split!($kind $array $Host $(, $entry)?);)+
        for_each_piece(
            $elements,
            $least,
            |piece| ($(take!($kind $array piece $element $($place)?),)+),
            |piece, ($(mut $array,)+)| {
                run!($width for $element in piece {
                    bodies::$method($($block,)? $(part!($kind $array),)+ $element)
                });
            },
        );
    }};
}

/// An array that is written, ready to be split; one that is read, as a slice.
macro_rules! split {
    (write $array:ident $Host:ty) => { let mut $array = Rest::new(&mut $array[..]); };
    (write_paged $array:ident $Host:ty) => { let mut $array = Rest::new(&mut $array[..]); };
    (write $array:ident $Host:ty, vectors) => { split!(write $array $Host) };
    (write_paged $array:ident $Host:ty, vectors) => { split!(write $array $Host) };
    ($kind:ident $array:ident $Host:ty $(, $entry:tt)?) => { let $array = &$array[..]; };
}

/// What some elements get of an array.
macro_rules! take {
    (write $array:ident $piece:ident $element:ident) => {
        $array.take($piece.start as usize, $piece.end as usize)
    };
    (write $array:ident $piece:ident $element:ident $place:expr) => {{
        let place = |$element: u32| ($place) as usize;
        $array.take(place($piece.start), place($piece.end))
    }};
    (write_paged $($rest:tt)*) => { take!(write $($rest)*) };
    ($kind:ident $array:ident $piece:ident $element:ident) => { $array };
}

/// How the body gets it.
macro_rules! part {
    (write $array:ident) => {
        &mut $array
    };
    (write_paged $array:ident) => {
        &mut $array
    };
    (one $array:ident) => {
        &$array[0]
    };
    ($kind:ident $array:ident) => {
        $array
    };
}

/// A loop, compiled for the machine's widest vectors too.
macro_rules! run {
    (plain $loop:expr) => {
        $loop
    };
    (wide $loop:expr) => {
        Arch::new().dispatch(
            #[inline(always)]
            || $loop,
        )
    };
}

macro_rules! methods {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({ $kind:ident $array:ident: $Host:ty, $($how:tt)* })+ }
        elements $elements:tt
        marks $marks:tt
    })+) => {
        impl Device for Cpu {
            type Weights = Weights;

            fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Weights, DeviceError> {
                Ok(Weights::new(shape, weights))
            }

            $(
                // Not all kernels write all that they could.
                #[allow(unused_mut)]
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($count: u32,)*
                    $($array: argument!($kind $Host),)+
                ) -> Result<(), DeviceError> {
                    compute!(
                        $marks $method [$($block)?] [$($count)*] [$({ $kind $array: $Host, $($how)* })+] $elements
                    );
                    Ok(())
                }
            )+
        }
    };
}

for_each_kernel!(methods);
