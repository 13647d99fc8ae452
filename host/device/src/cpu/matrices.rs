//! Matrix products of two computed matrices, and softmax.

use super::linear::{Ending, Panels};
use super::network::multiply;
use crate::parallel::for_each_row;
use pulp::Arch;
use viewfuse_kernels::network::attend::{MatrixBlock, softmax_scale, softmax_value};

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

pub(super) fn softmax_rows(column_count: &u32, row_count: u32, scores: &[f32], weights: &mut [f32]) {
    let columns = *column_count as usize;
    for_each_row(&mut weights[..row_count as usize * columns], columns, 4096, |row, weights| {
        let scores = &scores[row * columns..][..columns];
        let scale = softmax_scale(scores, 0, *column_count);
        Arch::new().dispatch(
            #[inline(always)]
            || weights.iter_mut().zip(scores).for_each(|(weight, score)| *weight = softmax_value(*score, scale)),
        );
    });
}
