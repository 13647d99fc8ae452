//! Convolution of an image with bias, residual, scaled and rectified output. (Networks' "convolution": a correlation.)
//!
//! Input, output and residual may be some of the channels of wider images, so that images are put side by side without
//! copies.
//!
//! It is the matrix product of the image's patches, `[output pixel][row of the window][column of the window][channel]`,
//! with the weights; [`patch_value`] is that matrix, which devices compute on the fly and do not store.

use super::linear::{first_of_sum, first_of_sums, rectified, rectified_four};
use super::tile::{Fours, Left, Loaded};
use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use viewfuse_core::fetch::Fetch;

/// A convolution, as plain data: a channel of an output pixel is its patch ([`patch_value`]) times
/// `weights[row of the window][column of the window][input channel][output channel]`, summed in the order of the patch,
/// then [`convolved`]. The yes-or-no fields are 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ConvolveBlock {
    /// Rows of the input image.
    pub in_height: u32,
    /// Columns of the input image.
    pub in_width: u32,
    /// Channels of the input image.
    pub in_channels: u32,
    /// Numbers from an input pixel to the next: its channels may be some of a wider image's.
    pub in_pitch: u32,
    /// Where the first pixel's first channel lies.
    pub in_first: u32,
    /// How many times each input pixel is repeated in both directions: the image counts as enlarged by this, at least
    /// 1.
    pub enlarge: u32,
    /// Rows of the output image: `(in_height enlarge + 2 padding - (size - 1) dilation - 1) / stride + 1`.
    pub out_height: u32,
    /// Columns of the output image.
    pub out_width: u32,
    /// Channels of the output image.
    pub out_channels: u32,
    /// Numbers from an output pixel to the next.
    pub out_pitch: u32,
    /// Where the first output pixel's first channel lies.
    pub out_first: u32,
    /// Side of the window.
    pub size: u32,
    /// Pixels from one window to the next.
    pub stride: u32,
    /// Pixels from one place of the window to the next: 1 for a window without gaps.
    pub dilation: u32,
    /// Rows and columns of zeros around the image.
    pub padding: u32,
    /// Factor of the sum, before it is rectified.
    pub scale: f32,
    /// Negative outputs become 0.
    pub relu_outputs: u32,
    /// Whether there is a residual.
    pub has_residual: u32,
    /// Numbers from a pixel of the residual to the next; 0: all pixels have the same.
    pub residual_pitch: u32,
    /// Where the residual's first pixel's first channel lies.
    pub residual_first: u32,
}

impl ConvolveBlock {
    /// The same convolution of images that fill their buffers and are not enlarged, with windows without gaps and
    /// nothing scaled.
    #[inline]
    pub fn packed(self) -> ConvolveBlock {
        ConvolveBlock {
            in_pitch: self.in_channels,
            in_first: 0,
            enlarge: 1,
            out_pitch: self.out_channels,
            out_first: 0,
            dilation: 1,
            scale: 1.0,
            residual_pitch: self.out_channels,
            residual_first: 0,
            ..self
        }
    }

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

    /// Whether the channels of all images are whole fours that begin at multiples of four.
    pub const fn is_in_fours(&self) -> bool {
        self.in_channels.is_multiple_of(4)
            && self.in_pitch.is_multiple_of(4)
            && self.in_first.is_multiple_of(4)
            && self.out_channels.is_multiple_of(4)
            && self.out_pitch.is_multiple_of(4)
            && self.out_first.is_multiple_of(4)
            && self.residual_pitch.is_multiple_of(4)
            && self.residual_first.is_multiple_of(4)
    }

    /// Numbers of inputs, weights, bias, residual and outputs up to the last one that it uses.
    pub fn used(&self) -> [u64; 5] {
        let (channels, pixels) = (self.out_channels as u64, self.out_height as u64 * self.out_width as u64);
        let in_pixels = self.in_height as u64 * self.in_width as u64;
        let inner = self.size as u64 * self.size as u64 * self.in_channels as u64;
        let up_to = |first: u32, pixels: u64, pitch: u32, channels: u64| {
            first as u64 + pixels.saturating_sub(1) * pitch as u64 + channels
        };
        let residual =
            if self.has_residual != 0 { up_to(self.residual_first, pixels, self.residual_pitch, channels) } else { 0 };
        [
            up_to(self.in_first, in_pixels, self.in_pitch, self.in_channels as u64),
            inner * channels,
            channels,
            residual,
            up_to(self.out_first, pixels, self.out_pitch, channels),
        ]
    }

    /// First row and column of the window that output pixel `pixel` sees, in the enlarged image, plus the padding.
    #[inline(always)]
    pub fn window(&self, pixel: u32) -> [u32; 2] {
        [pixel / self.out_width * self.stride, pixel % self.out_width * self.stride]
    }

    /// Row and column of the number `inner` of a patch in its window, in the enlarged image, and its channel.
    #[inline(always)]
    pub fn place_in_window(&self, inner: u32) -> [u32; 3] {
        let (place, channel) = (inner / self.in_channels, inner % self.in_channels);
        [place / self.size * self.dilation, place % self.size * self.dilation, channel]
    }

    /// Where channel `channel` of output pixel `pixel` belongs.
    #[inline]
    pub fn place(&self, pixel: u32, channel: u32) -> usize {
        (self.out_first + pixel * self.out_pitch + channel) as usize
    }
}

/// Where a place of a window lies in an image that is `height` by `width` times `enlarge`: the pixel's number there, or
/// `u32::MAX` outside. `top` and `left` are the window's first row and column, in the enlarged image, plus `padding`.
#[inline(always)]
pub fn window_pixel(size: [u32; 2], enlarge: u32, padding: u32, row: u32, column: u32) -> u32 {
    let [height, width] = size;
    // Left of or above the image the unsigned difference wraps and is too large as well.
    let (row, column) = (row.wrapping_sub(padding), column.wrapping_sub(padding));
    if row >= height * enlarge || column >= width * enlarge {
        return u32::MAX;
    }
    // Few images are enlarged, and a GPU has no instruction for a division.
    if enlarge == 1 { row * width + column } else { row / enlarge * width + column / enlarge }
}

/// Number `inner` of the patch that output pixel `pixel` sees: `[row of the window][column of the window][channel]` of
/// `inputs[row][column][channel]`, 0 outside the image.
#[inline]
pub fn patch_value(inputs: &(impl Fetch<f32> + ?Sized), block: &ConvolveBlock, pixel: u32, inner: u32) -> f32 {
    patch_number(inputs, block, block.window(pixel), block.place_in_window(inner))
}

/// The number of a [window](ConvolveBlock::window) at a [place](ConvolveBlock::place_in_window) in it.
#[inline(always)]
pub fn patch_number(
    inputs: &(impl Fetch<f32> + ?Sized),
    block: &ConvolveBlock,
    window: [u32; 2],
    place: [u32; 3],
) -> f32 {
    let at = patch_place(block, window, place);
    if at == u32::MAX { 0.0 } else { inputs.fetch(at as usize) }
}

/// Where that number lies in the input, or `u32::MAX` outside the image.
#[inline(always)]
fn patch_place(block: &ConvolveBlock, [first_row, first_column]: [u32; 2], [row, column, channel]: [u32; 3]) -> u32 {
    let (row, column) = (first_row + row, first_column + column);
    let seen = window_pixel([block.in_height, block.in_width], block.enlarge, block.padding, row, column);
    if seen == u32::MAX { seen } else { block.in_first + seen * block.in_pitch + channel }
}

/// The matrix of the patches that the output pixels see.
#[derive(Clone, Copy, Debug)]
pub struct Patches<'a, A> {
    /// The convolution.
    pub block: &'a ConvolveBlock,
    /// The input image.
    pub inputs: A,
}

impl<A: Fours> Left for Patches<'_, A> {
    type Row = [u32; 2];
    type Inner = [u32; 3];

    #[inline(always)]
    fn row(self, pixel: u32) -> [u32; 2] {
        self.block.window(pixel)
    }

    #[inline(always)]
    fn inner(self, inner: u32) -> [u32; 3] {
        self.block.place_in_window(inner)
    }

    #[inline(always)]
    fn moved(self, [row, column, channel]: [u32; 3], by: u32) -> [u32; 3] {
        let ConvolveBlock { in_channels, size, dilation, .. } = *self.block;
        let channel = channel + by;
        if channel < in_channels {
            return [row, column, channel];
        }
        // Pixels of the window further on; divisions are for few inner indices.
        let (more, channel) = (channel / in_channels, channel % in_channels);
        let place = row / dilation * size + column / dilation + more;
        [place / size * dilation, place % size * dilation, channel]
    }

    #[inline(always)]
    fn number(self, window: [u32; 2], place: [u32; 3]) -> f32 {
        patch_number(&self.inputs, self.block, window, place)
    }

    #[inline(always)]
    fn four(self, window: [u32; 2], place: [u32; 3]) -> Loaded {
        let at = patch_place(self.block, window, place);
        let is_inside = at != u32::MAX;
        Loaded { numbers: self.inputs.four(if is_inside { at } else { 0 }), is_inside }
    }

    #[inline(always)]
    fn finished(self, loaded: Loaded) -> Vec4 {
        loaded.or_zero()
    }
}

/// The output for channel `channel` of pixel `pixel` from the sum of the products: `bias[channel]` plus
/// `residual[pixel][channel]` comes first, then `sum`; the result is scaled and rectified.
#[inline]
pub fn convolved(
    bias: &(impl Fetch<f32> + ?Sized),
    residual: &(impl Fetch<f32> + ?Sized),
    block: &ConvolveBlock,
    pixel: u32,
    channel: u32,
    sum: f32,
) -> f32 {
    let element = (block.residual_first + pixel * block.residual_pitch + channel) as usize;
    let first = first_of_sum(bias, residual, block.has_residual, element, channel as usize);
    rectified((first + sum) * block.scale, block.relu_outputs)
}

/// [`convolved`] for four channels from `channel` on, a multiple of four.
#[inline(always)]
pub fn convolved_four(
    bias: &impl Fours,
    residual: &impl Fours,
    block: &ConvolveBlock,
    pixel: u32,
    channel: u32,
    sums: Vec4,
) -> Vec4 {
    let element = block.residual_first + pixel * block.residual_pitch + channel;
    let first = first_of_sums(bias, residual, block.has_residual, element, channel);
    rectified_four((first + sums) * block.scale, block.relu_outputs)
}
