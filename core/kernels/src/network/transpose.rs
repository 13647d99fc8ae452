//! Transposed convolution whose windows touch but do not overlap: every input pixel becomes a square of output pixels.
//!
//! It is the matrix product of the input's pixels with `weights[input channel][place in the square][output channel]`,
//! whose results are put where they belong.

use super::linear::rectified;
use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;

/// A transposed convolution, as plain data: column `column` of an input pixel is its channels times
/// `weights[input channel][column]`, summed in their order, plus `bias[output channel]`. The yes-or-no field is 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct TransposedBlock {
    /// Rows of the input image.
    pub in_height: u32,
    /// Columns of the input image.
    pub in_width: u32,
    /// Channels of the input image.
    pub in_channels: u32,
    /// Numbers from an input pixel to the next.
    pub in_pitch: u32,
    /// Where the first input pixel's first channel lies.
    pub in_first: u32,
    /// Channels of the output image, which has `size` times as many rows and columns.
    pub out_channels: u32,
    /// Numbers from an output pixel to the next.
    pub out_pitch: u32,
    /// Where the first output pixel's first channel lies.
    pub out_first: u32,
    /// Side of the square.
    pub size: u32,
    /// Negative outputs become 0.
    pub relu_outputs: u32,
}

impl TransposedBlock {
    /// Pixels of the input image: the product's rows.
    #[inline]
    pub fn pixel_count(&self) -> u32 {
        self.in_height * self.in_width
    }

    /// Numbers that an input pixel becomes: the product's columns, `[row of the square][column of the
    /// square][channel]`.
    #[inline]
    pub fn column_count(&self) -> u32 {
        self.size * self.size * self.out_channels
    }

    /// Where column `column` of input pixel `pixel` belongs in the output.
    #[inline]
    pub fn place(&self, pixel: u32, column: u32) -> usize {
        let (channel, corner) = (column % self.out_channels, column / self.out_channels);
        let row = pixel / self.in_width * self.size + corner / self.size;
        let out_column = pixel % self.in_width * self.size + corner % self.size;
        let out_pixel = row * self.in_width * self.size + out_column;
        (self.out_first + out_pixel * self.out_pitch + channel) as usize
    }

    /// What is written there, from the sum of the products.
    #[inline]
    pub fn output(&self, bias: &(impl Fetch<f32> + ?Sized), column: u32, sum: f32) -> f32 {
        rectified(bias.fetch((column % self.out_channels) as usize) + sum, self.relu_outputs)
    }
}
