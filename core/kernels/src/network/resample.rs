//! Max pool, and bilinear upsampling with aligned corners.

use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::lookup::split;
use viewfuse_core::math::has_nan_bits;

/// A dispatch of [`pooled_element`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct PoolBlock {
    /// Rows of the input image.
    pub in_height: u32,
    /// Columns of the input image.
    pub in_width: u32,
    /// Rows of the output image: `(in_height + 2 padding - size) / stride + 1`.
    pub out_height: u32,
    /// Columns of the output image.
    pub out_width: u32,
    /// Channels of both.
    pub channels: u32,
    /// Side of the window.
    pub size: u32,
    /// Pixels from one window to the next.
    pub stride: u32,
    /// Padding: how far windows reach over the border. Places there do not count.
    pub padding: u32,
}

/// Output number `element` of `[row][column][channel]`: the largest input of its channel in its window (max pool), NaN
/// where one of them is. A window that holds no pixel, or nothing but negative infinity, gives `-f32::MAX`.
#[inline]
pub fn pooled_element(inputs: &(impl Fetch<f32> + ?Sized), block: &PoolBlock, element: usize) -> f32 {
    let (channels, out_width) = (block.channels, block.out_width);
    let (pixel, channel) = (element as u32 / channels, element as u32 % channels);
    let (out_row, out_column) = (pixel / out_width, pixel % out_width);
    let mut largest = -f32::MAX;
    let mut place = 0;
    while place < block.size * block.size {
        let row = (out_row * block.stride + place / block.size).wrapping_sub(block.padding);
        let column = (out_column * block.stride + place % block.size).wrapping_sub(block.padding);
        if row < block.in_height && column < block.in_width {
            let input = inputs.fetch(((row * block.in_width + column) * channels + channel) as usize);
            // NaN stays, wherever in the window it is.
            if !has_nan_bits(largest) && (has_nan_bits(input) || input > largest) {
                largest = input;
            }
        }
        place += 1;
    }
    largest
}

/// A dispatch of [`upsampled_element`], as plain data. The output may be some of the channels of a wider image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct UpsampleBlock {
    /// Rows of the input image.
    pub in_height: u32,
    /// Columns of the input image.
    pub in_width: u32,
    /// Channels of the input image.
    pub in_channels: u32,
    /// Rows of the output image.
    pub out_height: u32,
    /// Columns of the output image.
    pub out_width: u32,
    /// Channels of the output image.
    pub out_channels: u32,
    /// The output channel that holds input channel 0.
    pub first_channel: u32,
}

impl UpsampleBlock {
    /// Where in the output `[row][column][out_channels]` the value for element `[row][column][in_channels]` belongs.
    #[inline]
    pub fn place(&self, element: usize) -> usize {
        let (pixel, channel) = (element / self.in_channels as usize, element % self.in_channels as usize);
        pixel * self.out_channels as usize + self.first_channel as usize + channel
    }
}

/// Value number `element` of `[output row][output column][input channel]`: bilinear between the pixels of
/// `inputs[row][column][channel]`, the centres of the corner pixels of both images laid over one another
/// (`align_corners`). Columns are mixed first. Where the output has one row or column, it is the first.
#[inline]
pub fn upsampled_element(inputs: &(impl Fetch<f32> + ?Sized), block: &UpsampleBlock, element: usize) -> f32 {
    let channels = block.in_channels as usize;
    let (pixel, channel) = (element / channels, element % channels);
    let (out_row, out_column) = (pixel / block.out_width as usize, pixel % block.out_width as usize);
    let (top, bottom, share_y) = split(aligned(out_row as u32, block.out_height, block.in_height), block.in_height);
    let (left, right, share_x) = split(aligned(out_column as u32, block.out_width, block.in_width), block.in_width);
    let at = |row: usize, column: usize| inputs.fetch((row * block.in_width as usize + column) * channels + channel);
    let upper = at(top, left) + (at(top, right) - at(top, left)) * share_x;
    let lower = at(bottom, left) + (at(bottom, right) - at(bottom, left)) * share_x;
    upper + (lower - upper) * share_y
}

/// The coordinate (centres at halves) among `in_count` nodes that output node `index` of `out_count` lies over.
#[inline]
pub fn aligned(index: u32, out_count: u32, in_count: u32) -> f32 {
    if out_count < 2 {
        return 0.5;
    }
    index as f32 * ((in_count - 1) as f32 / (out_count - 1) as f32) + 0.5
}
