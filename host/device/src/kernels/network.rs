//! Layers of networks.

use super::super::memory::Memory;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::depthwise::DepthwiseBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_core::network::transpose::TransposedBlock;

/// The sizes of a layer's weights, and what they are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LayerShape {
    /// Numbers that an output is made of: channels of the input, times places of the window.
    pub inner_count: usize,
    /// Output channels; for a transposed convolution times places of the square.
    pub column_count: usize,
    /// Whether it is used by nothing but convolutions with windows of 3x3 without gaps at every pixel of images that are
    /// large (32x32 or more). A device may have another way for these.
    pub has_wide_images: bool,
}

/// The parameters of a layer in a device's memory. They never change, and all blocks that they are used with have the
/// same inner index and columns.
pub struct Layer<D: NetworkKernels + ?Sized> {
    /// As the device wants them.
    pub weights: D::Weights,
    /// `[column]`.
    pub bias: D::Buffer<f32>,
}

impl<D: NetworkKernels + ?Sized> Layer<D> {
    /// A layer of `weights[inner][column]` (for a convolution `[row of the window][column of the window][input
    /// channel][output channel]`) and `bias[column]` (for a transposed convolution `bias[output channel]`).
    ///
    /// # Errors
    /// If the device has no room.
    pub fn new(device: &D, shape: &LayerShape, weights: &[f32], bias: &[f32]) -> Result<Layer<D>, D::Error> {
        Ok(Layer { weights: device.weights(shape, weights)?, bias: device.upload(bias)? })
    }
}

/// Kernels of [`viewfuse_core::network`] that have weights. Buffers may be longer than a block says. Sums run in an order
/// of the device's choice. A device sets a block's `has_addend` by whether there is one.
pub trait NetworkKernels: Memory {
    /// A layer's weights as the device wants them.
    type Weights: Send + Sync;

    /// Puts `weights[inner][column]` where and how the kernels need them; they may be longer than the shape says.
    ///
    /// # Errors
    /// If the device has no room.
    fn weights(&self, shape: &LayerShape, weights: &[f32]) -> Result<Self::Weights, Self::Error>;

    /// Kernel `convolve` for every number of the output image.
    ///
    /// # Errors
    /// If the device is lost.
    fn convolve(
        &self,
        block: &ConvolveBlock,
        inputs: &Self::Buffer<f32>,
        layer: &Layer<Self>,
        addend: Option<&Self::Buffer<f32>>,
        outputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `convolve_depthwise` for every number of the output image, with `weights[place of the window][channel]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn convolve_depthwise(
        &self,
        block: &DepthwiseBlock,
        inputs: &Self::Buffer<f32>,
        weights: &Self::Buffer<f32>,
        outputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `convolve_transposed` for every number of the output image.
    ///
    /// # Errors
    /// If the device is lost.
    fn convolve_transposed(
        &self,
        block: &TransposedBlock,
        inputs: &Self::Buffer<f32>,
        layer: &Layer<Self>,
        outputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `max_pool` for every number of the output image.
    ///
    /// # Errors
    /// If the device is lost.
    fn max_pool(
        &self,
        block: &PoolBlock,
        inputs: &Self::Buffer<f32>,
        outputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `upsample` for every number of the input's channels: writes those channels of the output image.
    ///
    /// # Errors
    /// If the device is lost.
    fn upsample(
        &self,
        block: &UpsampleBlock,
        inputs: &Self::Buffer<f32>,
        outputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `product` for every number of the outputs.
    ///
    /// # Errors
    /// If the device is lost.
    fn product(
        &self,
        block: &ProductBlock,
        inputs: &Self::Buffer<f32>,
        layer: &Layer<Self>,
        addend: Option<&Self::Buffer<f32>>,
        outputs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;
}
