//! The trait of a device: a method for every kernel, from the kernels' rows.

use super::error::DeviceError;
use super::memory::Memory;
use super::precision::Precision;
use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::rows::*;

/// The sizes of a layer's weights, and what they are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerShape {
    /// Products that an output is the sum of: channels of the input, times places of the window.
    pub inner_count: usize,
    /// Output channels; for a transposed convolution times places of the square.
    pub column_count: usize,
    /// Whether it is used only by convolutions with windows of 3x3, without dilation, at every pixel of large images
    /// (32x32 or more). A device may have another algorithm for these.
    pub has_wide_images: bool,
}

/// How a device's method takes an array of a row.
#[doc(hidden)]
#[macro_export]
macro_rules! argument {
    (layer $Host:ty) => { &<Self as $crate::Device>::Weights };
    (optional $Host:ty) => { Option<&<Self as $crate::Memory>::Buffer<$Host>> };
    (write $Host:ty) => { &mut <Self as $crate::Memory>::Buffer<$Host> };
    (write_paged $Host:ty) => { &mut <Self as $crate::Memory>::Buffer<$Host> };
    ($kind:ident $Host:ty) => { &<Self as $crate::Memory>::Buffer<$Host> };
}

macro_rules! device {
    ($({
        $Kernel:ident $method:ident
        doc { $($doc:tt)* }
        block { $($block:ident: $Block:ty)? }
        counts { $($count:ident)* }
        arrays { $({ $kind:ident $array:ident: $Host:ty, $($how:tt)* })+ }
        $($rest:tt)*
    })+) => {
        /// Something that runs every kernel: a method for each row of [`viewfuse_kernels::rows`], so that a kernel that
        /// exists on one device only does not compile. A method takes the kernel's parameters, the numbers that say how
        /// many elements there are, and the arrays in the order of the row. Buffers may be longer than the parameters
        /// say. Sizes are at least 1, and products of them and of counts below 2^32: a device may panic or write nothing
        /// of others.
        pub trait Device: Memory {
            /// A layer's weights in the device's own form.
            type Weights: Send + Sync;

            /// Takes `weights[inner][column]` (for a convolution `[row of the window][column of the window][input
            /// channel][output channel]`) to the device, in its own form; they may be longer than the shape says.
            ///
            /// # Errors
            /// If the device has no memory left.
            fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Self::Weights, DeviceError>;

            /// Whether it computes linear layers and convolutions in this precision: it gains by that, and a product that
            /// was tried was within its bound. `false` means that [`Device::linear_in`] and
            /// [`Device::convolve_in`] are exact. The first question of a precision takes the time of a trial.
            fn rounds(&self, _precision: Precision) -> bool {
                false
            }

            /// The precisions that it has besides the exact one, the coarsest first.
            fn precisions(&self) -> Vec<Precision> {
                Vec::new()
            }

            /// Those of [`Device::precisions`] where pictures of so many multiply-adds of layers gain from them; none
            /// where their trial would take longer than they save. A matter of the work alone, not of measured times.
            fn precisions_for(&self, _multiply_adds: u64) -> Vec<Precision> {
                self.precisions()
            }

            /// Begins to compile kernels, given in the order of their first use, and returns at once: they are there
            /// when they are needed, or sooner than without. Nothing on a device whose kernels are compiled.
            fn compile_ahead(&self, _kernels: &[Kernel]) {}

            /// What of the device is not used because its results were wrong, each in one sentence. Empty on a device
            /// without faults.
            fn faults(&self) -> Vec<String> {
                Vec::new()
            }

            /// As [`Device::linear`], in another precision where the device [rounds](Device::rounds) so. A factor
            /// beyond 65,504 makes outputs of [`Precision::ROUNDED`] NaN.
            ///
            /// # Errors
            /// If the device is lost.
            #[allow(clippy::too_many_arguments)]
            fn linear_in(
                &self,
                _precision: Precision,
                block: &LinearBlock,
                inputs: &Self::Buffer<f32>,
                weights: &Self::Weights,
                bias: &Self::Buffer<f32>,
                residual: Option<&Self::Buffer<f32>>,
                outputs: &mut Self::Buffer<f32>,
            ) -> Result<(), DeviceError> {
                self.linear(block, inputs, weights, bias, residual, outputs)
            }

            /// As [`Device::convolve`], in another precision where the device [rounds](Device::rounds) so. A factor
            /// beyond 65,504 makes outputs of [`Precision::ROUNDED`] NaN.
            ///
            /// # Errors
            /// If the device is lost.
            #[allow(clippy::too_many_arguments)]
            fn convolve_in(
                &self,
                _precision: Precision,
                block: &ConvolveBlock,
                inputs: &Self::Buffer<f32>,
                weights: &Self::Weights,
                bias: &Self::Buffer<f32>,
                residual: Option<&Self::Buffer<f32>>,
                outputs: &mut Self::Buffer<f32>,
            ) -> Result<(), DeviceError> {
                self.convolve(block, inputs, weights, bias, residual, outputs)
            }

            /// As [`Device::repeat_product`], by matrix units; `false`, and nothing is done, where there are none that
            /// the device [rounds](Device::rounds) by, or the columns are not whole fours.
            ///
            /// # Errors
            /// If the device is lost.
            fn repeat_product_by_units(
                &self,
                _block: &RepeatedBlock,
                _left: &Self::Buffer<f32>,
                _right: &Self::Buffer<f32>,
                _sums: &mut Self::Buffer<f32>,
            ) -> Result<bool, DeviceError> {
                Ok(false)
            }

            $(
                $($doc)*
                ///
                /// # Errors
                /// If the device is lost.
                #[allow(clippy::too_many_arguments)]
                fn $method(
                    &self,
                    $($block: &$Block,)?
                    $($count: u32,)*
                    $($array: argument!($kind $Host),)+
                ) -> Result<(), DeviceError>;
            )+
        }
    };
}

for_each_kernel!(device);
