//! Layers of networks.

use super::super::memory::Memory;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};

/// The parameters of a layer in a device's memory. They never change, and all blocks that they are used with have the
/// same inner index and columns.
pub struct Layer<D: Memory + ?Sized> {
    weights: D::Buffer<f32>,
    bias: D::Buffer<f32>,
    rearranged: D::Rearranged,
}

impl<D: Memory + ?Sized> Layer<D> {
    /// A layer of `weights[inner][column]` (for a convolution `[row of the window][column of the window][input
    /// channel][output channel]`) and `bias[column]`.
    pub fn new(weights: D::Buffer<f32>, bias: D::Buffer<f32>) -> Layer<D> {
        Layer { weights, bias, rearranged: D::Rearranged::default() }
    }

    /// As given to [`Layer::new`].
    pub fn weights(&self) -> &D::Buffer<f32> {
        &self.weights
    }

    /// As given to [`Layer::new`].
    pub fn bias(&self) -> &D::Buffer<f32> {
        &self.bias
    }

    /// What the device made of the weights.
    pub fn rearranged(&self) -> &D::Rearranged {
        &self.rearranged
    }
}

/// Kernels of [`viewfuse_core::network`]. Buffers may be longer than a block says. Sums run in an order of the device's
/// choice. A device sets a block's `has_addend` by whether there is one.
pub trait NetworkKernels: Memory {
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
