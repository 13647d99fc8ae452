//! Products of matrices that are both computed, and softmax.

use super::Cpu;
use super::network::multiply;
use super::product::{Ending, Panels};
use crate::kernels::matrices::MatrixKernels;
use pulp::Arch;
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::network::attend::{MatrixBlock, softmax_scale, softmax_value};

impl MatrixKernels for Cpu {
    fn multiply_matrices(
        &self,
        block: &MatrixBlock,
        left: &Vec<f32>,
        right: &Vec<f32>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let (inner, columns) = (block.inner_count as usize, block.column_count as usize);
        let panels = Panels::of(inner, columns, |inner, first, values| {
            for (column, value) in (first as u32..).zip(values) {
                *value = block.right(&right[..], inner as u32, column);
            }
        });
        let ending = Ending { bias: &vec![0.0; columns], addend: None, scale: block.scale, relu: 0 };
        let outputs = &mut outputs[..block.row_count as usize * columns];
        multiply(&panels, &left[block.left_first as usize..], block.left_pitch as usize, 0, ending, outputs);
        Ok(())
    }

    fn softmax_rows(
        &self,
        row_count: u32,
        column_count: u32,
        scores: &Vec<f32>,
        weights: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let columns = column_count as usize;
        let weights = &mut weights[..row_count as usize * columns];
        weights.par_chunks_mut(columns).zip(scores.par_chunks(columns)).for_each(|(weights, scores)| {
            let scale = softmax_scale(scores, 0, column_count);
            Arch::new().dispatch(
                #[inline(always)]
                || weights.iter_mut().zip(scores).for_each(|(weight, score)| *weight = softmax_value(*score, scale)),
            );
        });
        Ok(())
    }
}
