//! Matrix products of two computed matrices.

use super::linear::{Ending, Panels};
use super::network::multiply;
use viewfuse_kernels::network::attend::MatrixBlock;

pub(super) fn matrix_product(block: &MatrixBlock, left: &[f32], right: &[f32], outputs: &mut [f32]) {
    let (inner, columns) = (block.inner_count as usize, block.column_count as usize);
    let panels = Panels::of(inner, columns, |inner, first, values| {
        for (column, value) in (first as u32..).zip(values) {
            *value = block.right(right, inner as u32, column);
        }
    });
    let ending = Ending { bias: &vec![0.0; columns], residual: None, scale: block.scale, relu: 0 };
    let outputs = &mut outputs[..block.row_count as usize * columns];
    multiply(&panels, &left[block.left_first as usize..], block.left_pitch as usize, 0, ending, outputs);
}
