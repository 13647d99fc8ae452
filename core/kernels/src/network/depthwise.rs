//! Depthwise convolution: each channel has its own window. The first half of a separable convolution, and a filter
//! before resampling.

use super::convolve::window_pixel;
use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;

/// A dispatch of [`depthwise_element`], as plain data. The yes-or-no field is 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct DepthwiseBlock {
    /// Rows of the input image.
    pub in_height: u32,
    /// Columns of the input image.
    pub in_width: u32,
    /// Numbers from an input pixel to the next: its channels may be some of a wider image's.
    pub in_pitch: u32,
    /// Where the first pixel's first channel lies.
    pub in_first: u32,
    /// Rows of the output image: `(in_height + 2 padding - (size - 1) dilation - 1) / stride + 1`.
    pub out_height: u32,
    /// Columns of the output image.
    pub out_width: u32,
    /// Channels of both.
    pub channels: u32,
    /// Side of the window.
    pub size: u32,
    /// Pixels from one window to the next.
    pub stride: u32,
    /// Pixels from one place of the window to the next.
    pub dilation: u32,
    /// Rows and columns of zeros around the image.
    pub padding: u32,
    /// Whether all channels have the same weights.
    pub is_shared: u32,
}

impl DepthwiseBlock {
    /// Pixels of the output image.
    #[inline]
    pub fn pixel_count(&self) -> u32 {
        self.out_height * self.out_width
    }
}

/// Output number `element` of `[row][column][channel]`: the channel's pixels in the window times
/// `weights[row of the window][column of the window][channel]` (without the last index where they are shared), in that
/// order; 0 outside the image.
#[inline]
pub fn depthwise_element(
    inputs: &(impl Fetch<f32> + ?Sized),
    weights: &(impl Fetch<f32> + ?Sized),
    block: &DepthwiseBlock,
    element: usize,
) -> f32 {
    let (pixel, channel) = (element as u32 / block.channels, element as u32 % block.channels);
    let (out_row, out_column) = (pixel / block.out_width, pixel % block.out_width);
    let mut sum = 0.0;
    let mut place = 0;
    while place < block.size * block.size {
        let row = out_row * block.stride + place / block.size * block.dilation;
        let column = out_column * block.stride + place % block.size * block.dilation;
        let seen = window_pixel([block.in_height, block.in_width], 1, block.padding, row, column);
        if seen != u32::MAX {
            let weight = if block.is_shared != 0 { place } else { place * block.channels + channel };
            let input = inputs.fetch((block.in_first + seen * block.in_pitch + channel) as usize);
            sum += input * weights.fetch(weight as usize);
        }
        place += 1;
    }
    sum
}
