//! Convolution with windows of 3x3 by Winograd's algorithm: tiles of 4x4 outputs from 6x6 inputs with 36 products a
//! channel instead of 144.
//!
//! Source: Lavin and Gray, "Fast algorithms for convolutional neural networks" (2016), F(4x4, 3x3). With the matrices
//! `B`, `G`, `A` below, inputs `d` and weights `g`: `A^T ((G g G^T) * (B^T d B)) A`, where `*` is the element-wise
//! product, summed over the input channels: 36 matrix products, one for each place of a tile. In `f32` its error is
//! about five times that of the sum it replaces, at worst ten times (the transforms multiply by up to 8 and subtract);
//! parity cases hold it to a bound that is derived in [`viewfuse_check::winograd_oracle`].

// Indices are as in the formulas; iterators over several arrays at once would hide them.
#![allow(clippy::needless_range_loop)]

use super::linear::{Ending, Panels, Rows, load, store};
use super::scratch::with_scratch;
use crate::parallel::for_each_part;
use pulp::{Arch, Simd, WithSimd};
use viewfuse_kernels::network::convolve::{ConvolveBlock, window_pixel};

/// Outputs of a tile in each direction.
const SIDE: usize = 4;
/// Inputs of a tile in each direction.
const REACH: usize = 6;
/// Products of a tile.
const PLACES: usize = REACH * REACH;
/// Rows of a product's tile.
const ROW_STEP: usize = 12;
/// The most tiles that a core computes at once.
const MAX_TILES: usize = 48;

/// Weights of a layer, transformed.
pub struct Winograd {
    /// `[place]`, each `[input channel][output channel]`.
    places: Vec<Panels>,
    channels: usize,
    columns: usize,
}

impl Winograd {
    /// Those of `weights[row][column][input channel][output channel]`.
    pub(super) fn new(weights: &[f32], channels: usize, columns: usize) -> Winograd {
        // In f64: it is done once.
        const G: [[f64; 3]; REACH] = [
            [0.25, 0.0, 0.0],
            [-1.0 / 6.0, -1.0 / 6.0, -1.0 / 6.0],
            [-1.0 / 6.0, 1.0 / 6.0, -1.0 / 6.0],
            [1.0 / 24.0, 1.0 / 12.0, 1.0 / 6.0],
            [1.0 / 24.0, -1.0 / 12.0, 1.0 / 6.0],
            [0.0, 0.0, 1.0],
        ];
        let transformed = |place: usize| {
            let mut factors = [0.0; 9];
            for (window, factor) in factors.iter_mut().enumerate() {
                *factor = G[place / REACH][window / 3] * G[place % REACH][window % 3];
            }
            Panels::of(channels, columns, |channel, first, values| {
                for (column, value) in values.iter_mut().enumerate() {
                    let at =
                        |window: usize| f64::from(weights[(window * channels + channel) * columns + first + column]);
                    *value = factors.iter().enumerate().map(|(window, factor)| factor * at(window)).sum::<f64>() as f32;
                }
            })
        };
        Winograd { places: (0..PLACES).map(transformed).collect(), channels, columns }
    }

    /// The whole convolution. `outputs` starts at the first output and ends behind the last.
    pub(super) fn convolve(&self, block: &ConvolveBlock, inputs: &[f32], ending: Ending<'_>, outputs: &mut [f32]) {
        let way = [block.size, block.stride, block.dilation];
        assert_eq!(way, [3, 1, 1], "a layer for large images has windows of 3x3 at every pixel");
        assert_eq!([self.channels, self.columns], [block.in_channels as usize, block.out_channels as usize]);
        let (width, pitch) = (block.out_width as usize, block.out_pitch as usize);
        let tiles_across = width.div_ceil(SIDE);
        let rows = tile_rows_at_once((block.out_height as usize).div_ceil(SIDE), tiles_across);
        let (tiles, per_row) = (rows * tiles_across, SIDE * width);
        let zeros = vec![0.0; self.columns];
        let run = |space: &mut [f32], chunk: usize, outputs: &mut [f32]| {
            let (transformed, products) = space.split_at_mut(PLACES * tiles * self.channels);
            let first_row = chunk * rows * SIDE;
            let row_count = (rows * SIDE).min(block.out_height as usize - first_row);
            let count = row_count.div_ceil(SIDE) * tiles_across;
            let tile = |index: usize| [first_row + index / tiles_across * SIDE, index % tiles_across * SIDE];
            Arch::new().dispatch(InputTransform {
                block,
                inputs,
                tiles: (0..count).map(tile),
                stride: tiles,
                transformed,
            });
            for (place, panels) in self.places.iter().enumerate() {
                let offset = place * tiles;
                panels.multiply(Rows {
                    row_count: count,
                    inputs: &transformed[offset * self.channels..],
                    in_pitch: self.channels,
                    relu_inputs: 0,
                    ending: Ending { bias: &zeros, residual: None, scale: 1.0, relu: 0 },
                    outputs: &mut products[offset * self.columns..][..count * self.columns],
                    out_pitch: self.columns,
                });
            }
            let ending = ending.rows_from(first_row * width);
            let tile = |index: usize| [index / tiles_across * SIDE, index % tiles_across * SIDE];
            let size = [row_count, width];
            Arch::new().dispatch(OutputTransform {
                products,
                tiles: (0..count).map(tile),
                stride: tiles,
                size,
                ending,
                outputs,
                pitch,
            });
        };
        let len = PLACES * tiles * (self.channels + self.columns);
        for_each_part(outputs, rows * per_row * pitch, &|chunk, outputs| {
            with_scratch(len, |space| run(space, chunk, outputs));
        });
    }
}

/// Rows of tiles that a core computes at once: the number that leaves the least of the cores and of the products' rows
/// unused.
fn tile_rows_at_once(row_count: usize, tiles_across: usize) -> usize {
    let cost = |rows: &usize| {
        let rounds = row_count.div_ceil(*rows).div_ceil(rayon::current_num_threads());
        rounds * (*rows * tiles_across).div_ceil(ROW_STEP)
    };
    let most = (MAX_TILES / tiles_across).clamp(1, row_count);
    (1..=most).min_by_key(cost).unwrap_or(1)
}

/// `B^T d B` for tiles of the input: `transformed[place][tile][channel]`.
struct InputTransform<'a, T: Iterator<Item = [usize; 2]>> {
    block: &'a ConvolveBlock,
    inputs: &'a [f32],
    /// First output row and column of each.
    tiles: T,
    /// Tiles from a place to the next.
    stride: usize,
    transformed: &'a mut [f32],
}

impl<T: Iterator<Item = [usize; 2]>> WithSimd for InputTransform<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let InputTransform { block, inputs, tiles, stride, transformed } = self;
        let channels = block.in_channels as usize;
        let zero = simd.splat_f32s(0.0);
        for (tile, [first_row, first_column]) in tiles.enumerate() {
            let mut pixels = [[None; REACH]; REACH];
            for (row, pixels) in pixels.iter_mut().enumerate() {
                for (column, pixel) in pixels.iter_mut().enumerate() {
                    let (row, column) = ((first_row + row) as u32, (first_column + column) as u32);
                    let size = [block.in_height, block.in_width];
                    let at = window_pixel(size, block.enlarge, block.padding, row, column);
                    let first = block.in_first as usize + at as usize * block.in_pitch as usize;
                    *pixel = (at != u32::MAX).then(|| &inputs[first..first + channels]);
                }
            }
            for start in (0..channels).step_by(S::F32_LANES) {
                let end = channels.min(start + S::F32_LANES);
                let mut values = [[zero; REACH]; REACH];
                for (values, pixels) in values.iter_mut().zip(&pixels) {
                    for (value, pixel) in values.iter_mut().zip(pixels) {
                        if let Some(pixel) = pixel {
                            *value = load(simd, &pixel[start..end]);
                        }
                    }
                    *values = input_transform_along(simd, *values);
                }
                for column in 0..REACH {
                    let mut down = [zero; REACH];
                    for row in 0..REACH {
                        down[row] = values[row][column];
                    }
                    let along = input_transform_along(simd, down);
                    for row in 0..REACH {
                        let place = ((row * REACH + column) * stride + tile) * channels;
                        store(simd, &mut transformed[place + start..place + end], along[row]);
                    }
                }
            }
        }
    }
}

/// `B^T` times six numbers. No closures here and in what calls it: they would be functions of their own, without the
/// wide instructions of the one around them.
#[inline(always)]
fn input_transform_along<S: Simd>(simd: S, d: [S::f32s; REACH]) -> [S::f32s; REACH] {
    let [d0, d1, d2, d3, d4, d5] = d;
    let far = times(simd, -4.0, d2, d4);
    let near = times(simd, -4.0, d1, d3);
    let even = simd.sub_f32s(d4, d2);
    let odd = simd.sub_f32s(d3, d1);
    [
        times(simd, 4.0, d0, times(simd, -5.0, d2, d4)),
        simd.add_f32s(far, near),
        simd.sub_f32s(far, near),
        times(simd, 2.0, odd, even),
        times(simd, -2.0, odd, even),
        times(simd, 4.0, d1, times(simd, -5.0, d3, d5)),
    ]
}

/// `factor * x + y`.
#[inline(always)]
fn times<S: Simd>(simd: S, factor: f32, x: S::f32s, y: S::f32s) -> S::f32s {
    simd.mul_add_f32s(simd.splat_f32s(factor), x, y)
}

/// `A^T m A` for tiles of the products, with bias, residual, scale and rectification.
struct OutputTransform<'a, T: Iterator<Item = [usize; 2]>> {
    /// `[place][tile][channel]`.
    products: &'a [f32],
    /// First row and column of each, counted from the first output.
    tiles: T,
    stride: usize,
    /// Rows and columns of the outputs.
    size: [usize; 2],
    ending: Ending<'a>,
    outputs: &'a mut [f32],
    pitch: usize,
}

impl<T: Iterator<Item = [usize; 2]>> WithSimd for OutputTransform<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let OutputTransform { products, tiles, stride, size: [height, width], ending, outputs, pitch } = self;
        let channels = ending.bias.len();
        for (tile, [first_row, first_column]) in tiles.enumerate() {
            for start in (0..channels).step_by(S::F32_LANES) {
                let end = channels.min(start + S::F32_LANES);
                let zero = simd.splat_f32s(0.0);
                let mut rows = [[zero; SIDE]; REACH];
                for row in 0..REACH {
                    let mut across = [zero; REACH];
                    for column in 0..REACH {
                        let place = ((row * REACH + column) * stride + tile) * channels;
                        across[column] = load(simd, &products[place + start..place + end]);
                    }
                    rows[row] = output_transform_along(simd, across);
                }
                for column in 0..SIDE.min(width - first_column) {
                    let mut down = [zero; REACH];
                    for row in 0..REACH {
                        down[row] = rows[row][column];
                    }
                    let along = output_transform_along(simd, down);
                    for row in 0..SIDE.min(height - first_row) {
                        let pixel = (first_row + row) * width + first_column + column;
                        let value = ending.finish(simd, along[row], pixel, start, end);
                        store(simd, &mut outputs[pixel * pitch + start..pixel * pitch + end], value);
                    }
                }
            }
        }
    }
}

/// `A^T` times six numbers.
#[inline(always)]
fn output_transform_along<S: Simd>(simd: S, m: [S::f32s; REACH]) -> [S::f32s; SIDE] {
    let [m0, m1, m2, m3, m4, m5] = m;
    let near = simd.add_f32s(m1, m2);
    let near_odd = simd.sub_f32s(m1, m2);
    let far = simd.add_f32s(m3, m4);
    let far_odd = simd.sub_f32s(m3, m4);
    [
        simd.add_f32s(simd.add_f32s(m0, near), far),
        times(simd, 2.0, far_odd, near_odd),
        times(simd, 4.0, far, near),
        simd.add_f32s(times(simd, 8.0, far_odd, near_odd), m5),
    ]
}
