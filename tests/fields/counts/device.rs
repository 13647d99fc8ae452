//! A device that computes nothing: it counts what a GPU of a stated size would be asked for. Buffers have lengths and
//! no content; what is downloaded is zeros, and that all numbers are finite.

use std::marker::PhantomData;
use std::sync::Mutex;
use viewfuse::device::argument;
use viewfuse::device::{Device, DeviceError, Element, KernelTime, Later, LayerShape, Memory, TransferCounter};
use viewfuse_kernels::finite::ALL_FINITE;
use viewfuse_kernels::network::tile::Shape;
use viewfuse_kernels::rows::*;
use viewfuse_kernels::{elements, for_each_kernel};

/// What was asked for.
#[derive(Default)]
pub(super) struct Counted {
    /// Dispatches of each kernel, in the order of [`Kernel::ALL`].
    pub(super) dispatches: Vec<u64>,
    /// The matrix products of tiled kernels, and how often each.
    pub(super) products: Vec<(Kernel, Shape, u64)>,
    /// Arrays up and down.
    pub(super) transfers: TransferCounter,
}

impl Counted {
    /// All dispatches.
    pub(super) fn all(&self) -> u64 {
        self.dispatches.iter().sum()
    }

    fn add(&mut self, kernel: Kernel, elements: std::ops::Range<u32>, shape: Option<Shape>) {
        self.dispatches.resize(Kernel::ALL.len(), 0);
        self.dispatches[kernel as usize] += u64::from(!elements.is_empty());
        let Some(shape) = shape else { return };
        match self.products.iter_mut().find(|(known, of, _)| (*known, *of) == (kernel, shape)) {
            Some((_, _, count)) => *count += 1,
            None => self.products.push((kernel, shape, 1)),
        }
    }
}

/// The device: as busy as a GPU with 80 GB.
#[derive(Default)]
pub(super) struct Counting(pub(super) Mutex<Counted>);

/// A buffer: how many elements it has, and whether what a kernel wrote there says that all numbers are finite.
pub(super) struct Length<T> {
    len: usize,
    says_finite: bool,
    elements: PhantomData<fn() -> T>,
}

impl<T: Element> Length<T> {
    /// What it is said to hold.
    fn first(&self, count: usize) -> Vec<T> {
        let mut values = vec![T::default(); count];
        if self.says_finite {
            bytemuck::cast_slice_mut::<T, u32>(&mut values).fill(ALL_FINITE);
        }
        values
    }
}

impl<T> Length<T> {
    fn written_by(&mut self, kernel: Kernel) {
        self.says_finite = kernel == Kernel::FindNonFinite;
    }
}

impl Counting {
    pub(super) fn take(&self) -> Counted {
        std::mem::take(&mut *self.0.lock().expect("no panic"))
    }
}

impl Memory for Counting {
    type Buffer<T: Element> = Length<T>;

    fn name(&self) -> String {
        "counting".to_owned()
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Length<T>, DeviceError> {
        self.0.lock().expect("no panic").transfers.upload(size_of_val(values));
        self.zeros(values.len())
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Length<T>, DeviceError> {
        Ok(Length { len: count, says_finite: false, elements: PhantomData })
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

    fn download_first<T: Element>(&self, buffer: &Length<T>, count: usize) -> Result<Vec<T>, DeviceError> {
        let count = count.min(buffer.len);
        self.0.lock().expect("no panic").transfers.download(count * size_of::<T>());
        Ok(buffer.first(count))
    }

    fn download_later<T: Element>(&self, buffer: &Length<T>) -> Result<Later<'_, T>, DeviceError> {
        let (values, number) = (buffer.first(buffer.len), self.0.lock().expect("no panic").transfers.ask());
        Ok(Later::new(move || {
            self.0.lock().expect("no panic").transfers.take(number, size_of_val(&values[..]));
            Ok(values)
        }))
    }
}

macro_rules! parameters {
    () => {
        &[]
    };
    ($block:ident) => {
        bytemuck::bytes_of($block)
    };
}

/// Notes who wrote an array.
macro_rules! write {
    (write $array:ident $Kernel:ident) => {
        $array.written_by(Kernel::$Kernel)
    };
    ($kind:ident $array:ident $Kernel:ident) => {};
}

macro_rules! methods {
    ($({
        $Kernel:ident $method:ident
        doc $doc:tt
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({ $kind:ident $array:ident: $Host:ty, $($how:tt)* })+ }
        elements { $($elements:tt)* }
        $($rest:tt)*
    })+) => {
        impl Device for Counting {
            type Weights = ();

            fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<(), DeviceError> {
                self.upload(&weights[..shape.inner_count * shape.column_count]).map(|_| ())
            }

            $(
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($count: u32,)*
                    $($array: argument!($kind $Host),)+
                ) -> Result<(), DeviceError> {
                    $(write!($kind $array $Kernel);)+
                    let _ = ($(&$array,)+ $($count,)*);
                    let shape = Kernel::$Kernel.shape(parameters!($($block)?));
                    self.0.lock().expect("no panic").add(Kernel::$Kernel, elements!($($elements)*), shape);
                    Ok(())
                }
            )+
        }
    };
}

for_each_kernel!(methods);
