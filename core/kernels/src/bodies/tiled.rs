//! Layers that are products of matrices: a device computes them in tiles, in its own way.
//!
//! Arrays come by value: references to them would be references to references, which a module with logical addressing
//! cannot hold.

use crate::limits::{REPEATED, RepeatedBlock};
use crate::network::attend::MatrixBlock;
use crate::network::convolve::{ConvolveBlock, Patches, convolved, convolved_four};
use crate::network::linear::{LinearBlock, first_of_sum, first_of_sums, rectified, rectified_four};
use crate::network::tile::{Fours, Left, Loaded, Matrix, Outputs, Right, Shape, Tiles, Weights};
use crate::network::transpose::TransposedBlock;
use crate::store::{Store, StoreFours};
use glam::Vec4;

/// A convolution of pixels and output channels.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn convolve<A: Fours, W: Fours>(
    block: &ConvolveBlock,
    shape: Shape,
    inputs: A,
    weights: W,
    bias: A,
    residual: A,
    outputs: impl StoreFours,
    tiles: impl Tiles,
    invocation: u32,
) {
    let weights = Weights { numbers: weights, column_count: shape.column_count };
    tiles.multiply(invocation, shape, Patches { block, inputs }, weights, Convolved { block, bias, residual, outputs });
}

struct Convolved<'a, A, O> {
    block: &'a ConvolveBlock,
    bias: A,
    residual: A,
    outputs: O,
}

impl<A: Fours, O: StoreFours> Outputs for Convolved<'_, A, O> {
    #[inline(always)]
    fn put(&mut self, pixel: u32, channel: u32, sum: f32) {
        let value = convolved(&self.bias, &self.residual, self.block, pixel, channel, sum);
        self.outputs.store(self.block.place(pixel, channel), value);
    }

    #[inline(always)]
    fn put_four(&mut self, pixel: u32, channel: u32, sums: Vec4) {
        let values = convolved_four(&self.bias, &self.residual, self.block, pixel, channel, sums);
        self.outputs.store_four(self.block.place(pixel, channel), values);
    }
}

/// A transposed convolution of input pixels and what they become.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn convolve_transposed<A: Fours>(
    block: &TransposedBlock,
    shape: Shape,
    inputs: A,
    weights: A,
    bias: A,
    outputs: impl Store<f32>,
    tiles: impl Tiles,
    invocation: u32,
) {
    let left = Matrix { numbers: inputs, first: block.in_first, pitch: block.in_pitch, relu: 0 };
    let weights = Weights { numbers: weights, column_count: shape.column_count };
    tiles.multiply(invocation, shape, left, weights, Transposed { block, bias, outputs });
}

struct Transposed<'a, A, O> {
    block: &'a TransposedBlock,
    bias: A,
    outputs: O,
}

impl<A: Fours, O: Store<f32>> Outputs for Transposed<'_, A, O> {
    #[inline(always)]
    fn put(&mut self, pixel: u32, column: u32, sum: f32) {
        self.outputs.store(self.block.place(pixel, column), self.block.output(&self.bias, column, sum));
    }
}

/// A linear layer of rows and columns.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn linear<A: Fours, W: Fours>(
    block: &LinearBlock,
    shape: Shape,
    inputs: A,
    weights: W,
    bias: A,
    residual: A,
    outputs: impl StoreFours,
    tiles: impl Tiles,
    invocation: u32,
) {
    let left = Matrix { numbers: inputs, first: 0, pitch: block.inner_count, relu: block.relu_inputs };
    let weights = Weights { numbers: weights, column_count: shape.column_count };
    tiles.multiply(invocation, shape, left, weights, OfLayer { block, bias, residual, outputs });
}

struct OfLayer<'a, A, O> {
    block: &'a LinearBlock,
    bias: A,
    residual: A,
    outputs: O,
}

impl<A: Fours, O: StoreFours> Outputs for OfLayer<'_, A, O> {
    #[inline(always)]
    fn put(&mut self, row: u32, column: u32, sum: f32) {
        let element = (row * self.block.column_count + column) as usize;
        let first = first_of_sum(&self.bias, &self.residual, self.block.has_residual, element, column as usize);
        self.outputs.store(element, rectified(first + sum, self.block.relu_outputs));
    }

    #[inline(always)]
    fn put_four(&mut self, row: u32, column: u32, sums: Vec4) {
        let element = row * self.block.column_count + column;
        let first = first_of_sums(&self.bias, &self.residual, self.block.has_residual, element, column);
        self.outputs.store_four(element as usize, rectified_four(first + sums, self.block.relu_outputs));
    }
}

/// A product of two computed matrices.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn matrix_product<A: Fours>(
    block: &MatrixBlock,
    shape: Shape,
    left: A,
    right: A,
    outputs: impl Store<f32>,
    tiles: impl Tiles,
    invocation: u32,
) {
    let left = Matrix { numbers: left, first: block.left_first, pitch: block.left_pitch, relu: 0 };
    tiles.multiply(invocation, shape, left, Computed { block, numbers: right }, Scaled { block, outputs });
}

/// The right matrix of a product of two computed ones.
#[derive(Clone, Copy)]
struct Computed<'a, A> {
    block: &'a MatrixBlock,
    numbers: A,
}

impl<A: Fours> Right for Computed<'_, A> {
    #[inline(always)]
    fn number(self, inner: u32, column: u32) -> f32 {
        self.block.right(&self.numbers, inner, column)
    }
}

struct Scaled<'a, O> {
    block: &'a MatrixBlock,
    outputs: O,
}

impl<O: Store<f32>> Outputs for Scaled<'_, O> {
    #[inline(always)]
    fn put(&mut self, row: u32, column: u32, sum: f32) {
        self.outputs.store((row * self.block.column_count + column) as usize, sum * self.block.scale);
    }
}

/// A product that is added again and again.
#[inline(always)]
pub fn repeat_product<A: Fours>(
    block: &RepeatedBlock,
    shape: Shape,
    left: A,
    right: A,
    sums: impl StoreFours,
    tiles: impl Tiles,
    invocation: u32,
) {
    let right = RepeatedRight(Weights { numbers: right, column_count: shape.column_count });
    tiles.multiply(invocation, shape, RepeatedLeft(left), right, Sums { block, sums });
}

/// A matrix of which inner indices begin again.
#[derive(Clone, Copy)]
struct RepeatedLeft<A>(A);

impl<A: Fours> Left for RepeatedLeft<A> {
    /// The first number.
    type Row = u32;
    type Inner = u32;

    #[inline(always)]
    fn row(self, row: u32) -> u32 {
        row * REPEATED
    }

    #[inline(always)]
    fn inner(self, inner: u32) -> u32 {
        inner
    }

    #[inline(always)]
    fn moved(self, inner: u32, by: u32) -> u32 {
        inner + by
    }

    #[inline(always)]
    fn number(self, first: u32, inner: u32) -> f32 {
        self.0.fetch((first + inner % REPEATED) as usize)
    }

    #[inline(always)]
    fn four(self, first: u32, inner: u32) -> Loaded {
        Loaded { numbers: self.0.four(first + inner % REPEATED), is_inside: true }
    }

    #[inline(always)]
    fn finished(self, loaded: Loaded) -> Vec4 {
        loaded.or_zero()
    }
}

#[derive(Clone, Copy)]
struct RepeatedRight<A>(Weights<A>);

impl<A: Fours> Right for RepeatedRight<A> {
    #[inline(always)]
    fn number(self, inner: u32, column: u32) -> f32 {
        self.0.number(inner % REPEATED, column)
    }

    #[inline(always)]
    fn four(self, inner: u32, column: u32) -> Vec4 {
        self.0.four(inner % REPEATED, column)
    }
}

struct Sums<'a, O> {
    block: &'a RepeatedBlock,
    sums: O,
}

impl<O: StoreFours> Outputs for Sums<'_, O> {
    #[inline(always)]
    fn put(&mut self, row: u32, column: u32, sum: f32) {
        self.sums.store((row * self.block.column_count + column) as usize, sum);
    }

    #[inline(always)]
    fn put_four(&mut self, row: u32, column: u32, sums: Vec4) {
        self.sums.store_four((row * self.block.column_count + column) as usize, sums);
    }
}
