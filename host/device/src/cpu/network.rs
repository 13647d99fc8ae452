//! Layers of networks: blocked matrix products, convolutions as matrix products of the image's patches or by Winograd's
//! algorithm, rows spread over the cores.

use super::linear::{Ending, Panels, Rows};
use super::scratch::with_scratch;
use super::winograd::Winograd;
use crate::kernels::LayerShape;
use crate::parallel::for_each_part;
use viewfuse_kernels::network::convolve::{ConvolveBlock, window_pixel};
use viewfuse_kernels::network::linear::LinearBlock;
use viewfuse_kernels::network::transpose::TransposedBlock;

/// The most rows that a core computes at once: their inputs and outputs (512 columns) stay in its second-level cache,
/// beside the weights, and the cores finish at about the same time.
const MAX_ROWS: usize = 96;
/// Rows of a product's tile (or a multiple): fewer at once are wasted.
const ROW_STEP: usize = 12;

/// A layer's weights, packed for its algorithm.
pub enum Weights {
    /// For products of matrices.
    Panels(Panels),
    /// For convolutions of large images.
    Winograd(Winograd),
}

impl Weights {
    /// Those of `weights[inner][column]`, which may be longer.
    pub(super) fn new(shape: &LayerShape, weights: &[f32]) -> Weights {
        let LayerShape { inner_count, column_count, has_wide_images } = *shape;
        match has_wide_images {
            true => Weights::Winograd(Winograd::new(weights, inner_count / 9, column_count)),
            false => Weights::Panels(Panels::new(weights, inner_count, column_count)),
        }
    }

    fn panels(&self, inner: usize, columns: usize) -> &Panels {
        match self {
            Weights::Panels(panels) => {
                assert_eq!(panels.size(), [inner, columns], "a layer has one size");
                panels
            }
            Weights::Winograd(_) => panic!("a layer for large images has no matrix form"),
        }
    }
}

pub(super) fn convolve(
    block: &ConvolveBlock,
    inputs: &[f32],
    weights: &Weights,
    bias: &[f32],
    residual: Option<&[f32]>,
    outputs: &mut [f32],
) {
    let (pixel_count, columns) = (block.pixel_count() as usize, block.out_channels as usize);
    let ending = Ending {
        bias: &bias[..columns],
        residual: residual.map(|residual| (&residual[block.residual_first as usize..], block.residual_pitch as usize)),
        scale: block.scale,
        relu: block.relu_outputs,
    };
    let out_pitch = block.out_pitch as usize;
    let outputs = window(outputs, block.out_first, pixel_count, out_pitch, columns);
    if let Weights::Winograd(winograd) = weights {
        winograd.convolve(block, inputs, ending, outputs);
        return;
    }
    let patch_len = block.patch_len() as usize;
    let panels = weights.panels(patch_len, columns);
    let rows = chunk_rows(pixel_count);
    // Patches of one pixel are the image itself.
    let is_plain = [block.size, block.stride, block.enlarge, block.padding] == [1, 1, 1, 0];
    let run = |patches: &mut [f32], chunk: usize, outputs: &mut [f32]| {
        let first = chunk * rows;
        let row_count = rows.min(pixel_count - first);
        let (inputs, in_pitch) = if is_plain {
            (&inputs[block.in_first as usize + first * block.in_pitch as usize..], block.in_pitch as usize)
        } else {
            for (pixel, patch) in (first..).zip(patches.chunks_exact_mut(patch_len).take(row_count)) {
                read_patch(block, inputs, pixel as u32, patch);
            }
            (&*patches, patch_len)
        };
        let ending = ending.rows_from(first);
        panels.multiply(Rows { row_count, inputs, in_pitch, relu_inputs: 0, ending, outputs, out_pitch });
    };
    let len = if is_plain { 0 } else { rows * patch_len };
    for_each_part(outputs, rows * out_pitch, &|chunk, outputs| {
        with_scratch(len, |patches| run(patches, chunk, outputs));
    });
}

pub(super) fn convolve_transposed(
    block: &TransposedBlock,
    inputs: &[f32],
    weights: &Weights,
    bias: &[f32],
    outputs: &mut [f32],
) {
    let (width, columns) = (block.in_width as usize, block.column_count() as usize);
    let panels = weights.panels(block.in_channels as usize, columns);
    let (size, channels, pitch) = (block.size as usize, block.out_channels as usize, block.out_pitch as usize);
    let pixels = block.pixel_count() as usize * size * size;
    let bias = bias[..channels].repeat(size * size);
    let ending = Ending { bias: &bias, residual: None, scale: 1.0, relu: block.relu_outputs };
    // A row of the input becomes some whole rows of the output.
    let outputs = window(outputs, block.out_first, pixels, pitch, channels);
    let run = |results: &mut [f32], row: usize, outputs: &mut [f32]| {
        let in_pitch = block.in_pitch as usize;
        let inputs = &inputs[block.in_first as usize + row * width * in_pitch..];
        let product =
            Rows { row_count: width, inputs, in_pitch, relu_inputs: 0, ending, outputs: results, out_pitch: columns };
        panels.multiply(product);
        for (column, result) in results.chunks_exact(columns).enumerate() {
            for (corner, result) in result.chunks_exact(channels).enumerate() {
                let place = (corner / size * width + column) * size + corner % size;
                outputs[place * pitch..place * pitch + channels].copy_from_slice(result);
            }
        }
    };
    for_each_part(outputs, width * size * size * pitch, &|row, outputs| {
        with_scratch(width * columns, |results| run(results, row, outputs));
    });
}

pub(super) fn linear(
    block: &LinearBlock,
    inputs: &[f32],
    weights: &Weights,
    bias: &[f32],
    residual: Option<&[f32]>,
    outputs: &mut [f32],
) {
    let inner = block.inner_count as usize;
    let (row_count, columns) = (block.row_count as usize, block.column_count as usize);
    let panels = weights.panels(inner, columns);
    let ending =
        Ending { bias, residual: residual.map(|residual| (residual, columns)), scale: 1.0, relu: block.relu_outputs };
    multiply(panels, inputs, inner, block.relu_inputs, ending, &mut outputs[..row_count * columns]);
}

/// A matrix product of contiguous rows, spread over the cores.
pub(super) fn multiply(
    panels: &Panels,
    inputs: &[f32],
    in_pitch: usize,
    relu_inputs: u32,
    ending: Ending<'_>,
    outputs: &mut [f32],
) {
    let [_, columns] = panels.size();
    let rows = chunk_rows(outputs.len() / columns);
    for_each_part(outputs, rows * columns, &|chunk, outputs| {
        let first = chunk * rows;
        panels.multiply(Rows {
            row_count: outputs.len() / columns,
            inputs: &inputs[first * in_pitch..],
            in_pitch,
            relu_inputs,
            ending: ending.rows_from(first),
            outputs,
            out_pitch: columns,
        });
    });
}

/// The part of a buffer that holds `count` rows of `columns` numbers.
fn window(outputs: &mut [f32], first: u32, count: usize, pitch: usize, columns: usize) -> &mut [f32] {
    let first = first as usize;
    &mut outputs[first..first + count.saturating_sub(1) * pitch + columns]
}

/// The rows that a core computes at once.
fn chunk_rows(row_count: usize) -> usize {
    let share = row_count.div_ceil(rayon::current_num_threads()).next_multiple_of(ROW_STEP);
    share.clamp(ROW_STEP, MAX_ROWS)
}

/// The patch of output pixel `pixel`, as [`viewfuse_kernels::network::convolve::patch_value`] defines it: whole pixels
/// at a time.
fn read_patch(block: &ConvolveBlock, inputs: &[f32], pixel: u32, patch: &mut [f32]) {
    let (out_row, out_column) = (pixel / block.out_width, pixel % block.out_width);
    for (place, values) in (0..).zip(patch.chunks_exact_mut(block.in_channels as usize)) {
        let row = out_row * block.stride + place / block.size * block.dilation;
        let column = out_column * block.stride + place % block.size * block.dilation;
        match window_pixel([block.in_height, block.in_width], block.enlarge, block.padding, row, column) {
            u32::MAX => values.fill(0.0),
            seen => {
                let first = (block.in_first + seen * block.in_pitch) as usize;
                values.copy_from_slice(&inputs[first..first + values.len()]);
            }
        }
    }
}
