//! Self-attention of an image: matrix products of two computed matrices, and softmax over the rows of a matrix.
//!
//! With queries, keys and values `[pixel][channel]`: scores are `queries keys^T / sqrt(channels)`, their softmax over
//! the keys are weights, and `weights values` is the result. A matrix may be some of the columns of a wider one.

use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::{exp, has_nan_bits, max};

/// A product of two matrices, as plain data: `outputs[row][column]` are the products along the inner index, summed in
/// its order, times the scale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct MatrixBlock {
    /// Rows of the left matrix and of the outputs.
    pub row_count: u32,
    /// Columns of the left matrix, rows of the right one.
    pub inner_count: u32,
    /// Columns of the right matrix and of the outputs.
    pub column_count: u32,
    /// Numbers from a row of the left matrix to the next.
    pub left_pitch: u32,
    /// Where the left matrix starts.
    pub left_first: u32,
    /// Numbers from a row of the right matrix to the next.
    pub right_row_pitch: u32,
    /// Numbers from a column of the right matrix to the next: its rows' pitch and 1 are exchanged where it is
    /// transposed.
    pub right_column_pitch: u32,
    /// Where the right matrix starts.
    pub right_first: u32,
    /// Factor of the sums.
    pub scale: f32,
}

impl MatrixBlock {
    /// Number `inner` of a column of the right matrix.
    #[inline]
    pub fn right(&self, matrix: &(impl Fetch<f32> + ?Sized), inner: u32, column: u32) -> f32 {
        matrix.fetch((self.right_first + inner * self.right_row_pitch + column * self.right_column_pitch) as usize)
    }
}

/// The largest number of a row `scores[column]`, and the reciprocal of the sum of `e^(score - largest)`, at most 1:
/// what [`softmax_value`] needs. A row of minus infinity alone gives 0 for the second; a row with NaN or plus infinity
/// gives NaN, so that the fault is reported and not hidden.
#[inline]
pub fn softmax_scale(scores: &(impl Fetch<f32> + ?Sized), first: usize, column_count: u32) -> [f32; 2] {
    let mut largest = -f32::MAX;
    let mut column = 0;
    while column < column_count as usize {
        largest = max(scores.fetch(first + column), largest);
        column += 1;
    }
    let mut sum = 0.0;
    column = 0;
    while column < column_count as usize {
        sum += softmax_summand(scores.fetch(first + column), largest);
        column += 1;
    }
    [largest, softmax_factor(sum)]
}

/// `e^(score - largest)` for the sum of a row; NaN for NaN.
#[inline]
pub fn softmax_summand(score: f32, largest: f32) -> f32 {
    let below = score - largest;
    // The exponential of NaN is 0.
    if has_nan_bits(below) { below } else { exp(below) }
}

/// What the numbers of a row of this sum are multiplied by.
#[inline]
pub fn softmax_factor(sum: f32) -> f32 {
    if sum == 0.0 { 0.0 } else { 1.0 / sum }
}

/// Weight of a score in its row: `e^(score - largest)` times the row's factor.
#[inline]
pub fn softmax_value(score: f32, [largest, factor]: [f32; 2]) -> f32 {
    exp(score - largest) * factor
}
