//! Convolution of an image with bias, addend and rectified output. (Networks' "convolution": a correlation.)
//!
//! It is the matrix product of the image's patches, `[output pixel][row of the window][column of the window][channel]`,
//! with the weights; [`patch_value`] is that matrix, which devices read without storing it.

use super::product::{first_of_sum, rectified};
use crate::pages::Fetch;
use bytemuck::{Pod, Zeroable};

/// A dispatch of [`convolve_element`], as plain data. The yes-or-no fields are 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ConvolveBlock {
    /// Rows of the input image.
    pub in_height: u32,
    /// Columns of the input image.
    pub in_width: u32,
    /// Channels of the input image.
    pub in_channels: u32,
    /// Rows of the output image: `(in_height + 2 padding - size) / stride + 1`.
    pub out_height: u32,
    /// Columns of the output image.
    pub out_width: u32,
    /// Channels of the output image.
    pub out_channels: u32,
    /// Side of the window.
    pub size: u32,
    /// Pixels from one window to the next.
    pub stride: u32,
    /// Rows and columns of zeros around the image.
    pub padding: u32,
    /// Negative outputs become 0.
    pub relu_outputs: u32,
    /// Whether there is an addend.
    pub has_addend: u32,
}

impl ConvolveBlock {
    /// Numbers in a patch: the inner index of the product.
    #[inline]
    pub fn patch_len(&self) -> u32 {
        self.size * self.size * self.in_channels
    }

    /// Pixels of the output image.
    #[inline]
    pub fn pixel_count(&self) -> u32 {
        self.out_height * self.out_width
    }
}

/// Number `inner` of the patch that output pixel `pixel` sees: `[row of the window][column of the window][channel]` of
/// `inputs[row][column][channel]`, 0 outside the image.
#[inline]
pub fn patch_value(inputs: &(impl Fetch<f32> + ?Sized), block: &ConvolveBlock, pixel: u32, inner: u32) -> f32 {
    let (channel, place) = (inner % block.in_channels, inner / block.in_channels);
    let (window_column, window_row) = (place % block.size, place / block.size);
    let (out_column, out_row) = (pixel % block.out_width, pixel / block.out_width);
    // Left of or above the image the unsigned difference wraps and is too large as well.
    let row = (out_row * block.stride + window_row).wrapping_sub(block.padding);
    let column = (out_column * block.stride + window_column).wrapping_sub(block.padding);
    if row < block.in_height && column < block.in_width {
        inputs.fetch(((row * block.in_width + column) * block.in_channels + channel) as usize)
    } else {
        0.0
    }
}

/// Output number `element` of `[row][column][channel]`: `bias[channel]` plus `addend[element]`, then the patch times
/// `weights[row of the window][column of the window][input channel][output channel]` in the order of the patch.
#[inline]
pub fn convolve_element(
    inputs: &(impl Fetch<f32> + ?Sized),
    weights: &(impl Fetch<f32> + ?Sized),
    bias: &(impl Fetch<f32> + ?Sized),
    addend: &(impl Fetch<f32> + ?Sized),
    block: &ConvolveBlock,
    element: usize,
) -> f32 {
    let out_channels = block.out_channels as usize;
    let (pixel, channel) = (element / out_channels, element % out_channels);
    let mut sum = first_of_sum(bias, addend, block.has_addend, element, channel);
    let mut inner = 0;
    while inner < block.patch_len() {
        let weight = weights.fetch(inner as usize * out_channels + channel);
        sum += patch_value(inputs, block, pixel as u32, inner) * weight;
        inner += 1;
    }
    rectified(sum, block.relu_outputs)
}
