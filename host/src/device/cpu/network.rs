//! Layers of networks: blocked matrix products (the crate `matrixmultiply`, by way of `ndarray`), convolutions as
//! products of the image's patches, rows spread over the cores. Sums run in the blocks' order.

use super::Cpu;
use crate::device::kernels::network::{Layer, NetworkKernels};
use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2};
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::{ProductBlock, rectified};
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock, pooled_element, upsampled_element};

/// Most rows that a core takes at once: their inputs and outputs (512 columns) stay in its second-level cache.
const MOST_ROWS: usize = 512;
/// Rows of a blocked product's smallest part: fewer at once are wasted.
const ROW_STEP: usize = 16;

impl NetworkKernels for Cpu {
    fn convolve(
        &self,
        block: &ConvolveBlock,
        inputs: &Vec<f32>,
        layer: &Layer<Self>,
        addend: Option<&Vec<f32>>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let (pixel_count, patch_len) = (block.pixel_count() as usize, block.patch_len() as usize);
        let chunk = Chunk { row_count: pixel_count, columns: block.out_channels as usize, relu: block.relu_outputs };
        chunk.for_each(layer, addend, outputs, |first, rows, outputs| {
            let mut patches = Vec::with_capacity(rows * patch_len);
            for pixel in first..first + rows {
                push_patch(&mut patches, block, inputs, pixel as u32);
            }
            add_product(&patches, patch_len, &layer.weights, outputs);
        });
        Ok(())
    }

    fn max_pool(&self, block: &PoolBlock, inputs: &Vec<f32>, outputs: &mut Vec<f32>) -> Result<(), Infallible> {
        let count = (block.out_height * block.out_width * block.channels) as usize;
        outputs[..count]
            .par_iter_mut()
            .enumerate()
            .with_min_len(1024)
            .for_each(|(element, output)| *output = pooled_element(&inputs[..], block, element));
        Ok(())
    }

    fn upsample(&self, block: &UpsampleBlock, inputs: &Vec<f32>, outputs: &mut Vec<f32>) -> Result<(), Infallible> {
        let (in_channels, out_channels) = (block.in_channels as usize, block.out_channels as usize);
        let pixel_count = (block.out_height * block.out_width) as usize;
        outputs[..pixel_count * out_channels].par_chunks_mut(out_channels).enumerate().for_each(|(pixel, outputs)| {
            let first = block.first_channel as usize;
            for (channel, output) in outputs[first..first + in_channels].iter_mut().enumerate() {
                *output = upsampled_element(&inputs[..], block, pixel * in_channels + channel);
            }
        });
        Ok(())
    }

    fn product(
        &self,
        block: &ProductBlock,
        inputs: &Vec<f32>,
        layer: &Layer<Self>,
        addend: Option<&Vec<f32>>,
        outputs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let inner = block.inner_count as usize;
        let (row_count, columns) = (block.row_count as usize, block.column_count as usize);
        let chunk = Chunk { row_count, columns, relu: block.relu_outputs };
        chunk.for_each(layer, addend, outputs, |first, rows, outputs| {
            let inputs = &inputs[first * inner..(first + rows) * inner];
            if block.relu_inputs == 0 {
                add_product(inputs, inner, &layer.weights, outputs);
            } else {
                let inputs: Vec<f32> = inputs.iter().map(|input| rectified(*input, 1)).collect();
                add_product(&inputs, inner, &layer.weights, outputs);
            }
        });
        Ok(())
    }
}

/// Rows of outputs, to be computed some at a time.
struct Chunk {
    row_count: usize,
    columns: usize,
    relu: u32,
}

impl Chunk {
    /// For some rows at a time on every core: bias and addend, then `add(first row, rows, outputs)`, then rectified.
    fn for_each(
        &self,
        layer: &Layer<Cpu>,
        addend: Option<&Vec<f32>>,
        outputs: &mut [f32],
        add: impl Fn(usize, usize, &mut [f32]) + Sync,
    ) {
        let Chunk { row_count, columns, relu } = *self;
        let share = row_count.div_ceil(rayon::current_num_threads()).next_multiple_of(ROW_STEP);
        let rows = share.clamp(ROW_STEP, MOST_ROWS);
        outputs[..row_count * columns].par_chunks_mut(rows * columns).enumerate().for_each(|(chunk, outputs)| {
            let first = chunk * rows;
            for (row, outputs) in outputs.chunks_exact_mut(columns).enumerate() {
                let start = (first + row) * columns;
                match addend {
                    None => outputs.copy_from_slice(&layer.bias[..columns]),
                    Some(addend) => {
                        let addend = &addend[start..start + columns];
                        for ((output, bias), addend) in outputs.iter_mut().zip(&layer.bias).zip(addend) {
                            *output = bias + addend;
                        }
                    }
                }
            }
            add(first, outputs.len() / columns, outputs);
            if relu != 0 {
                outputs.iter_mut().for_each(|output| *output = rectified(*output, relu));
            }
        });
    }
}

/// Adds `inputs[row][inner]` times `weights[inner][column]` to `outputs[row][column]`.
fn add_product(inputs: &[f32], inner: usize, weights: &[f32], outputs: &mut [f32]) {
    let rows = inputs.len() / inner;
    let columns = outputs.len() / rows;
    let matrices = (
        ArrayView2::from_shape((rows, inner), inputs),
        ArrayView2::from_shape((inner, columns), &weights[..inner * columns]),
        ArrayViewMut2::from_shape((rows, columns), outputs),
    );
    let (Ok(inputs), Ok(weights), Ok(mut outputs)) = matrices else {
        unreachable!("{rows} rows of {inner} and of {columns} numbers")
    };
    general_mat_mul(1.0, &inputs, &weights, 1.0, &mut outputs);
}

/// Appends what output pixel `pixel` sees, as [`viewfuse_core::network::convolve::patch_value`] defines it: whole pixels
/// at a time.
fn push_patch(patches: &mut Vec<f32>, block: &ConvolveBlock, inputs: &[f32], pixel: u32) {
    let channels = block.in_channels as usize;
    let (out_row, out_column) = (pixel / block.out_width, pixel % block.out_width);
    for window_row in 0..block.size {
        let row = (out_row * block.stride + window_row).wrapping_sub(block.padding);
        for window_column in 0..block.size {
            let column = (out_column * block.stride + window_column).wrapping_sub(block.padding);
            if row < block.in_height && column < block.in_width {
                let first = (row * block.in_width + column) as usize * channels;
                patches.extend_from_slice(&inputs[first..first + channels]);
            } else {
                patches.resize(patches.len() + channels, 0.0);
            }
        }
    }
}
