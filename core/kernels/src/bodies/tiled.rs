//! Layers that are products of matrices: a device computes them in tiles, in its own way.
//!
//! Arrays come by value: closures over references to them would hold references to references, which a module with
//! logical addressing cannot.

use crate::network::attend::MatrixBlock;
use crate::network::convolve::{ConvolveBlock, Patches, convolved};
use crate::network::linear::{LinearBlock, first_of_sum, rectified};
use crate::network::tile::{Matrix, Shape, Tiles};
use crate::network::transpose::TransposedBlock;
use crate::store::Store;
use viewfuse_core::fetch::Fetch;

/// A convolution of pixels and output channels.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn convolve<A: Fetch<f32> + Copy>(
    block: &ConvolveBlock,
    shape: Shape,
    inputs: A,
    weights: A,
    bias: A,
    residual: A,
    mut outputs: impl Store<f32>,
    tiles: impl Tiles,
    invocation: u32,
) {
    let channels = shape.column_count;
    tiles.multiply(
        invocation,
        shape,
        Patches { block, inputs },
        move |inner, channel| weights.fetch((inner * channels + channel) as usize),
        move |pixel, channel, sum| {
            let value = convolved(&bias, &residual, block, pixel, channel, sum);
            outputs.store(block.place(pixel, channel), value);
        },
    );
}

/// A transposed convolution of input pixels and what they become.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn convolve_transposed<A: Fetch<f32> + Copy>(
    block: &TransposedBlock,
    shape: Shape,
    inputs: A,
    weights: A,
    bias: A,
    mut outputs: impl Store<f32>,
    tiles: impl Tiles,
    invocation: u32,
) {
    let column_count = shape.column_count;
    tiles.multiply(
        invocation,
        shape,
        Matrix { numbers: inputs, first: block.in_first, pitch: block.in_pitch, relu: 0 },
        move |inner, column| weights.fetch((inner * column_count + column) as usize),
        move |pixel, column, sum| outputs.store(block.place(pixel, column), block.output(&bias, column, sum)),
    );
}

/// A linear layer of rows and columns.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn linear<A: Fetch<f32> + Copy>(
    block: &LinearBlock,
    shape: Shape,
    inputs: A,
    weights: A,
    bias: A,
    residual: A,
    mut outputs: impl Store<f32>,
    tiles: impl Tiles,
    invocation: u32,
) {
    let column_count = shape.column_count;
    tiles.multiply(
        invocation,
        shape,
        Matrix { numbers: inputs, first: 0, pitch: block.inner_count, relu: block.relu_inputs },
        move |inner, column| weights.fetch((inner * column_count + column) as usize),
        move |row, column, sum| {
            let element = (row * column_count + column) as usize;
            let first = first_of_sum(&bias, &residual, block.has_residual, element, column as usize);
            outputs.store(element, rectified(first + sum, block.relu_outputs));
        },
    );
}

/// A product of two computed matrices.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn matrix_product<A: Fetch<f32> + Copy>(
    block: &MatrixBlock,
    shape: Shape,
    left: A,
    right: A,
    mut outputs: impl Store<f32>,
    tiles: impl Tiles,
    invocation: u32,
) {
    let column_count = shape.column_count;
    tiles.multiply(
        invocation,
        shape,
        Matrix { numbers: left, first: block.left_first, pitch: block.left_pitch, relu: 0 },
        move |inner, column| block.right(&right, inner, column),
        move |row, column, sum| outputs.store((row * column_count + column) as usize, sum * block.scale),
    );
}
