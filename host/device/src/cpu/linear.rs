//! A matrix product on one core: a tile of the outputs stays in registers while a panel of the weights is read.
//!
//! With 32 vector registers a tile is 12 rows of two vectors (24 sums, two vectors of weights, one input in every
//! lane), with 16 it is 6 rows: per step of the inner index the arithmetic takes longer than the loads. Rows are copied
//! into a small array first, so that their offsets are constants and they stay in the first-level cache. Weights are
//! packed once ([`Panels`]): a panel is read from front to back. Bias, residual and rectification are part of writing a
//! tile. Sums run along the inner index, [`DEPTH`] products at a time; a multiplication is fused with its addition
//! where the core can.
//!
//! The crate `pulp` chooses the widest vector instructions of the machine; no code here is specific to one of them.

use crate::parallel::for_each_part;
use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use pulp::{Arch, Simd, WithSimd};
use viewfuse_kernels::network::linear::rectified;

/// Products that are summed before outputs are written: most layers need one pass.
const DEPTH: usize = 512;
/// Padding behind a row, so that rows do not map to the same cache lines.
const GAP: usize = 16;

/// A cache line: panels are aligned to it.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([f32; 16]);

/// Packed weights, in the order in which they are read: `[panel][inner][column of the panel]`, two vectors wide, zeros
/// behind the last column.
pub struct Panels {
    lines: Vec<Line>,
    inner: usize,
    columns: usize,
}

impl Panels {
    /// Those of `weights[inner][column]`; both counts are at least 1.
    pub(super) fn new(weights: &[f32], inner: usize, columns: usize) -> Panels {
        Panels::of(inner, columns, |row, first, panel| {
            let start = row * columns + first;
            panel.copy_from_slice(&weights[start..start + panel.len()]);
        })
    }

    /// The panels of a matrix that is read in pieces: `read(inner, first column, values)`.
    pub(super) fn of(inner: usize, columns: usize, read: impl Fn(usize, usize, &mut [f32]) + Sync) -> Panels {
        let width = Arch::new().dispatch(PanelWidth);
        let panel_lines = (inner * width).div_ceil(16);
        let mut lines = vec![Line::zeroed(); columns.div_ceil(width) * panel_lines];
        for_each_part(&mut lines, panel_lines, &|panel, lines| {
            let first = panel * width;
            let count = width.min(columns - first);
            let rows = cast_slice_mut::<Line, f32>(lines).chunks_exact_mut(width);
            for (row, values) in rows.take(inner).enumerate() {
                read(row, first, &mut values[..count]);
            }
        });
        Panels { lines, inner, columns }
    }

    /// Rows and columns of the matrix.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.inner, self.columns]
    }

    /// Computes some rows.
    pub(super) fn multiply(&self, rows: Rows<'_>) {
        Arch::new().dispatch(Multiply { panels: self, rows });
    }
}

/// Rows of a layer's inputs and outputs, with their pitches.
pub(super) struct Rows<'a> {
    /// How many there are.
    pub(super) row_count: usize,
    /// `[row][inner]`.
    pub(super) inputs: &'a [f32],
    /// From a row of the inputs to the next.
    pub(super) in_pitch: usize,
    /// Whether negative inputs count as 0.
    pub(super) relu_inputs: u32,
    /// The operations on the sums.
    pub(super) ending: Ending<'a>,
    /// `[row][column]`.
    pub(super) outputs: &'a mut [f32],
    /// From a row of the outputs to the next.
    pub(super) out_pitch: usize,
}

/// The operations on sums before they are written: bias, residual, scale, rectification.
#[derive(Clone, Copy)]
pub(super) struct Ending<'a> {
    /// `[column]`.
    pub(super) bias: &'a [f32],
    /// `[row][column]` and its pitch: 0 if all rows have the same residual.
    pub(super) residual: Option<(&'a [f32], usize)>,
    /// Factor of the sums with bias and residual.
    pub(super) scale: f32,
    /// Whether negative outputs become 0.
    pub(super) relu: u32,
}

impl<'a> Ending<'a> {
    /// The ending of the rows from `row` on.
    pub(super) fn rows_from(self, row: usize) -> Ending<'a> {
        Ending { residual: self.residual.map(|(residual, pitch)| (&residual[row * pitch..], pitch)), ..self }
    }

    /// The outputs for columns `start..end` of a row, from their sums.
    #[inline(always)]
    pub(super) fn finish<S: Simd>(&self, simd: S, sum: S::f32s, row: usize, start: usize, end: usize) -> S::f32s {
        self.close(simd, self.open(simd, sum, row, start, end))
    }

    #[inline(always)]
    fn open<S: Simd>(&self, simd: S, sum: S::f32s, row: usize, start: usize, end: usize) -> S::f32s {
        let value = simd.add_f32s(load(simd, &self.bias[start..end]), sum);
        match self.residual {
            Some((residual, pitch)) => {
                simd.add_f32s(load(simd, &residual[row * pitch + start..row * pitch + end]), value)
            }
            None => value,
        }
    }

    #[inline(always)]
    fn close<S: Simd>(&self, simd: S, value: S::f32s) -> S::f32s {
        let value = simd.mul_f32s(value, simd.splat_f32s(self.scale));
        if self.relu == 0 {
            return value;
        }
        let zero = simd.splat_f32s(0.0);
        // NaN stays, as in `rectified`.
        simd.select_f32s(simd.less_than_or_equal_f32s(value, zero), zero, value)
    }
}

/// How many columns a panel has on this machine.
struct PanelWidth;

impl WithSimd for PanelWidth {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        2 * S::F32_LANES
    }
}

/// See [`Panels::multiply`].
struct Multiply<'a> {
    panels: &'a Panels,
    rows: Rows<'a>,
}

impl WithSimd for Multiply<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        if S::REGISTER_COUNT >= 32 {
            self.run::<S, 12>(simd);
        } else {
            self.run::<S, 6>(simd);
        }
    }
}

impl Multiply<'_> {
    /// Tile by tile, `R` rows at a time.
    #[inline(always)]
    fn run<S: Simd, const R: usize>(self, simd: S) {
        let Multiply { panels: Panels { lines, inner, columns }, mut rows } = self;
        let (inner, columns, width) = (*inner, *columns, 2 * S::F32_LANES);
        let panel_lines = (inner * width).div_ceil(16);
        let row_count = rows.row_count;
        let mut inputs = [[0.0; DEPTH + GAP]; R];
        for first_row in (0..row_count).step_by(R) {
            for first in (0..inner).step_by(DEPTH) {
                let depth = DEPTH.min(inner - first);
                for (row, inputs) in inputs.iter_mut().enumerate() {
                    // Behind the last row it is computed once more.
                    let start = (first_row + row).min(row_count - 1) * rows.in_pitch + first;
                    let given = &rows.inputs[start..start + depth];
                    for (input, given) in inputs.iter_mut().zip(given) {
                        *input = rectified(*given, rows.relu_inputs);
                    }
                }
                for (panel, lines) in lines.chunks_exact(panel_lines).enumerate() {
                    let (vectors, _) = S::as_simd_f32s(cast_slice(lines));
                    let weights = &vectors.as_chunks::<2>().0[first..first + depth];
                    let sums = tile(simd, &inputs, weights);
                    let position = TilePosition { first_row, first_column: panel * width, columns, first, inner };
                    write(simd, &sums, &mut rows, &position);
                }
            }
        }
    }
}

/// Sums of `inputs[row][k] * weights[k][column]`.
#[inline(always)]
fn tile<S: Simd, const R: usize>(
    simd: S,
    inputs: &[[f32; DEPTH + GAP]; R],
    weights: &[[S::f32s; 2]],
) -> [[S::f32s; 2]; R] {
    let mut sums = [[simd.splat_f32s(0.0); 2]; R];
    // The bound is known to hold; said here, it is not checked at every step.
    for k in 0..weights.len().min(DEPTH) {
        let [left, right] = weights[k];
        for row in 0..R {
            let input = simd.splat_f32s(inputs[row][k]);
            sums[row][0] = simd.mul_add_f32s(input, left, sums[row][0]);
            sums[row][1] = simd.mul_add_f32s(input, right, sums[row][1]);
        }
    }
    sums
}

/// The position of a tile.
struct TilePosition {
    first_row: usize,
    first_column: usize,
    columns: usize,
    /// Of the inner index.
    first: usize,
    inner: usize,
}

/// Adds a tile's sums to bias and residual, or to the outputs so far; the last sums are scaled and rectified.
#[inline(always)]
fn write<S: Simd, const R: usize>(simd: S, sums: &[[S::f32s; 2]; R], rows: &mut Rows<'_>, position: &TilePosition) {
    let TilePosition { first_row, first_column, columns, first, inner } = *position;
    let is_last = first + DEPTH >= inner;
    for (row, sums) in (first_row..rows.row_count).zip(sums) {
        for (half, sum) in sums.iter().enumerate() {
            let start = first_column + half * S::F32_LANES;
            let end = columns.min(start + S::F32_LANES);
            if start >= end {
                continue;
            }
            let output = &mut rows.outputs[row * rows.out_pitch + start..row * rows.out_pitch + end];
            let mut value = match first {
                0 => rows.ending.open(simd, *sum, row, start, end),
                _ => simd.add_f32s(load(simd, output), *sum),
            };
            if is_last {
                value = rows.ending.close(simd, value);
            }
            store(simd, output, value);
        }
    }
}

/// A vector from at most as many numbers as it has lanes.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, values: &[f32]) -> S::f32s {
    match S::as_simd_f32s(values).0.first() {
        Some(vector) => *vector,
        None => simd.partial_load_f32s(values),
    }
}

/// Stores the first lanes of a vector: as many as `values` has elements.
#[inline(always)]
pub(super) fn store<S: Simd>(simd: S, values: &mut [f32], vector: S::f32s) {
    match S::as_mut_simd_f32s(values).0.first_mut() {
        Some(whole) => *whole = vector,
        None => simd.partial_store_f32s(values, vector),
    }
}
