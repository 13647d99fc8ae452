//! Layers of networks: blocked matrix products, convolutions as products of the image's patches, rows spread over the
//! cores.

use super::Cpu;
use super::product::{Panels, Rows};
use crate::device::kernels::network::{Layer, NetworkKernels};
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock, pooled_element, upsampled_element};

/// Most rows that a core takes at once: their inputs and outputs (512 columns) stay in its second-level cache, beside the
/// weights, and the last ones keep no core waiting for long.
const MOST_ROWS: usize = 96;
/// Rows of a product's tile (or a multiple): fewer at once are wasted.
const ROW_STEP: usize = 12;

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
        let columns = block.out_channels as usize;
        let panels = Panels::of(layer, patch_len, columns);
        let rows = chunk_rows(pixel_count);
        let chunks = outputs[..pixel_count * columns].par_chunks_mut(rows * columns).enumerate();
        chunks.for_each_init(Vec::new, |patches, (chunk, outputs)| {
            let first = chunk * rows;
            patches.clear();
            for pixel in first..first + outputs.len() / columns {
                push_patch(patches, block, inputs, pixel as u32);
            }
            panels.multiply(Rows {
                inputs: patches,
                relu_inputs: 0,
                bias: layer.bias(),
                addend: addend.map(|addend| &addend[first * columns..]),
                relu_outputs: block.relu_outputs,
                outputs,
            });
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
        let panels = Panels::of(layer, inner, columns);
        let rows = chunk_rows(row_count);
        let chunks = outputs[..row_count * columns].par_chunks_mut(rows * columns).enumerate();
        chunks.for_each(|(chunk, outputs)| {
            let first = chunk * rows;
            panels.multiply(Rows {
                inputs: &inputs[first * inner..],
                relu_inputs: block.relu_inputs,
                bias: layer.bias(),
                addend: addend.map(|addend| &addend[first * columns..]),
                relu_outputs: block.relu_outputs,
                outputs,
            });
        });
        Ok(())
    }
}

/// How many of these rows a core takes at once.
fn chunk_rows(row_count: usize) -> usize {
    let share = row_count.div_ceil(rayon::current_num_threads()).next_multiple_of(ROW_STEP);
    share.clamp(ROW_STEP, MOST_ROWS)
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
