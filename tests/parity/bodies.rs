//! A device that runs the body of every kernel as it stands, one element after the other: the definition of what the
//! CPU has a faster form of. Arrays that may lie in pages lie in four. What a GPU's workgroup computes together runs so
//! as well, with a thread for each invocation. One kernel can be wrong.

use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Barrier, Mutex};
use viewfuse::device::DeviceError;
use viewfuse::device::argument;
use viewfuse::device::cpu::Cpu;
use viewfuse::device::{Device, Element, KernelTime, LayerShape, Memory};
use viewfuse_core::fetch::Fetch;
use viewfuse_kernels::network::tile::{Fours, Left, Outputs, Right, Shape, Tiles};
use viewfuse_kernels::pages::{Pages, PagesMut};
use viewfuse_kernels::rows::*;
use viewfuse_kernels::store::{Store, StoreFours};
use viewfuse_kernels::workgroup::Workgroup;
use viewfuse_kernels::{bodies, for_each_kernel};

#[derive(Clone, Copy)]
pub(crate) struct Bodies {
    /// Whether what a workgroup computes together is computed so.
    pub(crate) in_workgroups: bool,
    /// The kernel whose results are off by about a thousandth.
    pub(crate) faulty: Option<Kernel>,
}

impl Bodies {
    /// Each element by itself, and nothing wrong.
    pub(crate) const PLAIN: Bodies = Bodies { in_workgroups: false, faulty: None };
}

impl Memory for Bodies {
    type Buffer<T: Element> = Vec<T>;

    fn name(&self) -> String {
        "bodies".to_owned()
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

    fn download_first<T: Element>(&self, buffer: &Vec<T>, count: usize) -> Result<Vec<T>, DeviceError> {
        Cpu.download_first(buffer, count)
    }
}

/// Flips a bit of every word: of the fraction of a number of 32 bits, it is worth a thousandth.
fn spoil<T: Element>(values: &mut [T]) {
    bytemuck::cast_slice_mut::<T, u32>(values).iter_mut().for_each(|word| *word ^= 1 << 13);
}

/// Spoils what is written.
macro_rules! spoil {
    (write $array:ident) => {
        spoil(&mut $array[..])
    };
    (write_paged $array:ident) => {
        spoil(&mut $array[..])
    };
    ($kind:ident $array:ident) => {};
}

/// A matrix product in one piece.
struct Whole;

impl Tiles for Whole {
    fn multiply<L: Left>(self, _invocation: u32, shape: Shape, left: L, right: impl Right, mut outputs: impl Outputs) {
        for row in 0..shape.row_count {
            for column in 0..shape.column_count {
                let number = |inner| left.number(left.row(row), left.inner(inner));
                let products = (0..shape.inner_count).map(|inner| number(inner) * right.number(inner, column));
                outputs.put(row, column, products.fold(0.0, |sum, product| sum + product));
            }
        }
    }
}

/// An array that is read, as a value.
#[derive(Clone, Copy)]
struct Read<'a, T>(&'a [T]);

impl<T: Copy> Fetch<T> for Read<'_, T> {
    fn fetch(&self, index: usize) -> T {
        self.0[index]
    }
}

impl Fours for Read<'_, f32> {}

/// One that is written.
struct Write<'a, T>(&'a mut [T]);

impl<T> Store<T> for Write<'_, T> {
    fn store(&mut self, index: usize, value: T) {
        self.0[index] = value;
    }
}

impl StoreFours for Write<'_, f32> {}

/// One that all invocations of a workgroup write.
struct Shared<'a, T>(&'a Mutex<&'a mut [T]>);

impl<T> Store<T> for Shared<'_, T> {
    fn store(&mut self, index: usize, value: T) {
        self.0.lock().expect("no invocation panicked")[index] = value;
    }
}

/// What the invocations of a workgroup share.
struct Group<'a> {
    memory: &'a [AtomicU32],
    barrier: &'a Barrier,
}

impl Workgroup for Group<'_> {
    fn put_word(&mut self, index: usize, word: u32) {
        self.memory[index].store(word, Ordering::Relaxed);
    }

    fn word(&self, index: usize) -> u32 {
        self.memory[index].load(Ordering::Relaxed)
    }

    fn wait(&mut self) {
        self.barrier.wait();
    }
}

/// A workgroup for one element after the other, with a thread for each of its invocations. Its memory holds what the
/// element before left there.
fn in_workgroups(elements: Range<u32>, run: impl Fn(Group, u32) + Sync) {
    let memory: Vec<AtomicU32> = (0..SHARED_BYTES / 4).map(|_| AtomicU32::new(0)).collect();
    let (run, memory, barrier) = (&run, &memory[..], &Barrier::new(WORKGROUP as usize));
    std::thread::scope(|scope| {
        for invocation in 0..WORKGROUP {
            let elements = elements.clone();
            scope.spawn(move || {
                for element in elements {
                    run(Group { memory, barrier }, element * WORKGROUP + invocation);
                    barrier.wait();
                }
            });
        }
    });
}

/// Binary logarithm of the pages' length by which an array takes all four.
fn page_shift(len: usize) -> u32 {
    len.div_ceil(4).next_power_of_two().trailing_zeros()
}

fn paged<T>(all: &[T]) -> Pages<'_, T> {
    let shift = page_shift(all.len());
    // With shift 0 everything is on the first page.
    let mut pages = all.chunks(if shift == 0 { usize::MAX } else { 1 << shift });
    let [a, b, c, d] = std::array::from_fn(|_| pages.next().unwrap_or_default());
    Pages { a, b, c, d, shift }
}

fn paged_mut<T>(all: &mut [T]) -> PagesMut<'_, T> {
    let shift = page_shift(all.len());
    let mut pages = all.chunks_mut(if shift == 0 { usize::MAX } else { 1 << shift });
    let [a, b, c, d] = std::array::from_fn(|_| pages.next().unwrap_or_default());
    PagesMut { a, b, c, d, shift }
}

/// How a body gets an array.
macro_rules! lend {
    ($kind:ident $array:ident $Host:ty, vectors) => { lend!($kind $array $Host) };
    (write $array:ident $Host:ty) => { &mut $array[..] };
    (write_paged $array:ident $Host:ty) => { &mut paged_mut(&mut $array[..]) };
    (paged $array:ident $Host:ty) => { &paged(&$array[..]) };
    (one $array:ident $Host:ty) => { &$array[0] };
    ($kind:ident $array:ident $Host:ty) => { &$array[..] };
}

/// How the body of a tiled kernel gets an array.
macro_rules! hand {
    (write $array:ident) => {
        Write(&mut $array[..])
    };
    ($kind:ident $array:ident) => {
        Read(&$array[..])
    };
}

/// How the function of an invocation gets an array.
macro_rules! share {
    (write $array:ident) => {
        &mut Shared(&$array)
    };
    ($kind:ident $array:ident) => {
        &Read(&$array[..])
    };
}

/// An array that all invocations write.
macro_rules! lock {
    (write $array:ident) => {
        let $array = Mutex::new(&mut $array[..]);
    };
    ($kind:ident $array:ident) => {};
}

/// All elements of a kernel whose elements workgroups compute; nothing for others.
macro_rules! together {
    (
        { together $($mark:ident)* } $method:ident $block:ident
        { for $element:ident in [$elements:expr] at_least $least:tt } [$({ $kind:ident $array:ident })+]
    ) => {{
        $(lock!($kind $array);)+
        in_workgroups($elements, |group, invocation| {
            bodies::together::$method($block, $(share!($kind $array),)+ group, invocation);
        });
        return Ok(());
    }};
    ($($other:tt)*) => {};
}

/// All elements.
macro_rules! run {
    (
        $method:ident $block:ident { tiles [$rows:expr, $inner:expr, $columns:expr] }
        [$({ $kind:ident $array:ident: $($how:tt)* })+]
    ) => {{
        let shape = Shape { row_count: $rows, inner_count: $inner, column_count: $columns };
        bodies::$method($block, shape, $(hand!($kind $array),)+ Whole, 0);
    }};
    (
        $method:ident $($block:ident)? { for $element:ident in [$elements:expr] at_least $least:tt }
        [$({ $kind:ident $array:ident: $Host:ty, as { $($entry:tt)? } $($how:tt)* })+]
    ) => {
        for $element in $elements {
            bodies::$method($($block,)? $(lend!($kind $array $Host $(, $entry)?),)+ $element);
        }
    };
}

macro_rules! methods {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({
            $kind:ident $array:ident: $Host:ty, as $entry:tt at $place:tt
            unless { $($other:ident $told:ident $flag:ident)? }
        })+ }
        elements $elements:tt
        marks $marks:tt
    })+) => {
        impl Device for Bodies {
            type Weights = Vec<f32>;

            fn weights(&self, _: &LayerShape, weights: &[f32]) -> Result<Vec<f32>, DeviceError> {
                Ok(weights.to_vec())
            }

            $(
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($count: u32,)*
                    $($array: argument!($kind $Host),)+
                ) -> Result<(), DeviceError> {
                    $($(
                        let mut told = *$told;
                        told.$flag = u32::from($array.is_some());
                        let ($told, _) = (&told, &$other);
                        let $array = $array.map_or(&[][..], Vec::as_slice);
                    )?)+
                    if self.in_workgroups {
                        together!($marks $method $($block)? $elements [$({ $kind $array })+]);
                    }
                    run!($method $($block)? $elements [$({ $kind $array: $Host, as $entry })+]);
                    if self.faulty == Some(Kernel::$Kernel) {
                        $(spoil!($kind $array);)+
                    }
                    Ok(())
                }
            )+
        }
    };
}

for_each_kernel!(methods);
