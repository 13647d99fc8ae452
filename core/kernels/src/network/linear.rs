//! Linear layer: a matrix product with bias, residual and rectified input or output, for many points at once.

use super::tile::Fours;
use bytemuck::{Pod, Zeroable};
use glam::Vec4;
use viewfuse_core::fetch::Fetch;

/// A linear layer, as plain data: `outputs[row][column]` is `inputs[row][inner]` times `weights[inner][column]` plus
/// `bias[column]` plus `residual[row][column]`; bias and residual first, then the products in the order of the inner
/// index. The yes-or-no fields are 0 or 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct LinearBlock {
    /// Rows of inputs and outputs.
    pub row_count: u32,
    /// Columns of the inputs, rows of the weights.
    pub inner_count: u32,
    /// Columns of weights and outputs.
    pub column_count: u32,
    /// Negative inputs count as 0.
    pub relu_inputs: u32,
    /// Negative outputs become 0.
    pub relu_outputs: u32,
    /// Whether there is a residual.
    pub has_residual: u32,
}

impl LinearBlock {
    /// Whether all rows of all arrays are whole fours.
    pub const fn is_in_fours(&self) -> bool {
        self.inner_count.is_multiple_of(4) && self.column_count.is_multiple_of(4)
    }

    /// Numbers of inputs, weights, bias, residual and outputs that it uses.
    pub const fn used(&self) -> [u64; 5] {
        let [rows, inner, columns] = [self.row_count as u64, self.inner_count as u64, self.column_count as u64];
        let residual = if self.has_residual != 0 { rows * columns } else { 0 };
        [rows * inner, inner * columns, columns, residual, rows * columns]
    }
}

/// The start of the sum for output number `element`: `bias[column]` plus `residual[element]`, if there is a residual.
#[inline]
pub fn first_of_sum(
    bias: &(impl Fetch<f32> + ?Sized),
    residual: &(impl Fetch<f32> + ?Sized),
    has_residual: u32,
    element: usize,
    column: usize,
) -> f32 {
    let first = bias.fetch(column);
    if has_residual != 0 { first + residual.fetch(element) } else { first }
}

/// As [`first_of_sum`] for four elements in a row, from `element` and `column` on, which are multiples of four.
#[inline(always)]
pub fn first_of_sums(bias: &impl Fours, residual: &impl Fours, has_residual: u32, element: u32, column: u32) -> Vec4 {
    let first = bias.four(column);
    if has_residual != 0 { first + residual.four(element) } else { first }
}

/// `x`, or 0 instead of a negative one if `relu` is not 0. NaN stays NaN: an overflow in one layer is reported behind
/// the last. Negative numbers are told by their bits, from those of -0 to those of minus infinity: drivers make the
/// larger of `x` and 0 of a comparison, and that hides NaN.
#[inline]
pub fn rectified(x: f32, relu: u32) -> f32 {
    const MINUS: u32 = (-0.0_f32).to_bits();
    const MOST: u32 = f32::INFINITY.to_bits();
    if relu != 0 && x.to_bits().wrapping_sub(MINUS) <= MOST { 0.0 } else { x }
}

/// [`rectified`] of each of four numbers.
#[inline(always)]
pub fn rectified_four(four: Vec4, relu: u32) -> Vec4 {
    if relu == 0 {
        return four;
    }
    Vec4::new(rectified(four.x, relu), rectified(four.y, relu), rectified(four.z, relu), rectified(four.w, relu))
}
