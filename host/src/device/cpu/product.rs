//! A matrix product for a core: a tile of the outputs stays in registers while a panel of the weights streams by.
//!
//! With 32 vector registers a tile is 12 rows of two vectors (24 sums, two vectors of weights, one input in every lane),
//! with 16 it is 6 rows: per step of the inner index the arithmetic takes longer than the loads. Rows are copied into a
//! small array first, so that their places are constants and they stay in the first-level cache; weights are put in order
//! once and for all ([`Panels`]): a panel is read from front to back. Bias, addend and rectification are part of
//! writing a tile. Sums run along the inner index, [`DEPTH`] products at a time; a multiplication is fused with its
//! addition where the core can.
//!
//! The crate `pulp` picks the widest instructions of the machine; nothing here is written for one of them.

use super::Cpu;
use crate::device::Layer;
use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use viewfuse_core::network::product::rectified;

/// Products that are summed before outputs are written: most of the layers in one go.
const DEPTH: usize = 512;
/// Space behind a row, so that rows do not fall on the same places of the cache.
const GAP: usize = 16;

/// A line of the cache: panels begin at one.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([f32; 16]);

/// Weights in the order in which they are needed: `[panel][inner][column of the panel]`, two vectors wide, zeros behind
/// the last column.
pub struct Panels {
    lines: Vec<Line>,
    inner: usize,
    columns: usize,
}

impl Panels {
    /// Those of a layer, put in order when they are first asked for. Both counts are at least 1.
    pub(super) fn of(layer: &Layer<Cpu>, inner: usize, columns: usize) -> &Panels {
        let panels = layer.rearranged().get_or_init(|| Panels::new(layer.weights(), inner, columns));
        assert_eq!((panels.inner, panels.columns), (inner, columns), "a layer has one size");
        panels
    }

    fn new(weights: &[f32], inner: usize, columns: usize) -> Panels {
        let width = Arch::new().dispatch(PanelWidth);
        let panel_lines = (inner * width).div_ceil(16);
        let mut lines = vec![Line::zeroed(); columns.div_ceil(width) * panel_lines];
        lines.par_chunks_exact_mut(panel_lines).enumerate().for_each(|(panel, lines)| {
            let first = panel * width;
            let count = width.min(columns - first);
            let rows = cast_slice_mut::<Line, f32>(lines).chunks_exact_mut(width);
            for (row, weights) in rows.zip(weights.chunks_exact(columns).take(inner)) {
                row[..count].copy_from_slice(&weights[first..first + count]);
            }
        });
        Panels { lines, inner, columns }
    }

    /// Computes some rows.
    pub(super) fn multiply(&self, rows: Rows<'_>) {
        Arch::new().dispatch(Multiply { panels: self, rows });
    }
}

/// Rows of a layer's inputs and outputs.
pub(super) struct Rows<'a> {
    /// `[row][inner]`.
    pub(super) inputs: &'a [f32],
    /// Whether negative inputs count as 0.
    pub(super) relu_inputs: u32,
    /// `[column]`.
    pub(super) bias: &'a [f32],
    /// `[row][column]`.
    pub(super) addend: Option<&'a [f32]>,
    /// Whether negative outputs become 0.
    pub(super) relu_outputs: u32,
    /// `[row][column]`.
    pub(super) outputs: &'a mut [f32],
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
        let row_count = rows.outputs.len() / columns;
        let mut inputs = [[0.0; DEPTH + GAP]; R];
        for first_row in (0..row_count).step_by(R) {
            for first in (0..inner).step_by(DEPTH) {
                let depth = DEPTH.min(inner - first);
                for (row, inputs) in inputs.iter_mut().enumerate() {
                    // Behind the last row it is computed once more.
                    let start = (first_row + row).min(row_count - 1) * inner + first;
                    let given = &rows.inputs[start..start + depth];
                    for (input, given) in inputs.iter_mut().zip(given) {
                        *input = rectified(*given, rows.relu_inputs);
                    }
                }
                for (panel, lines) in lines.chunks_exact(panel_lines).enumerate() {
                    let (vectors, _) = S::as_simd_f32s(cast_slice(lines));
                    let weights = &vectors.as_chunks::<2>().0[first..first + depth];
                    let sums = tile(simd, &inputs, weights);
                    let place = Place { first_row, first_column: panel * width, columns, first, inner };
                    write(simd, &sums, &mut rows, &place);
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

/// Where a tile belongs.
struct Place {
    first_row: usize,
    first_column: usize,
    columns: usize,
    /// Of the inner index.
    first: usize,
    inner: usize,
}

/// Adds a tile's sums to bias and addend, or to what the outputs hold already; rectifies them with the last sums.
#[inline(always)]
fn write<S: Simd, const R: usize>(simd: S, sums: &[[S::f32s; 2]; R], rows: &mut Rows<'_>, place: &Place) {
    let Place { first_row, first_column, columns, first, inner } = *place;
    let is_last = first + DEPTH >= inner;
    let row_count = rows.outputs.len() / columns;
    for (row, sums) in (first_row..row_count).zip(sums) {
        for (half, sum) in sums.iter().enumerate() {
            let start = first_column + half * S::F32_LANES;
            let end = columns.min(start + S::F32_LANES);
            if start >= end {
                continue;
            }
            let range = row * columns + start..row * columns + end;
            let mut value = if first > 0 {
                simd.add_f32s(load(simd, &rows.outputs[range.clone()]), *sum)
            } else {
                let bias = simd.add_f32s(load(simd, &rows.bias[start..end]), *sum);
                match rows.addend {
                    Some(addend) => simd.add_f32s(load(simd, &addend[range.clone()]), bias),
                    None => bias,
                }
            };
            if is_last && rows.relu_outputs != 0 {
                let zero = simd.splat_f32s(0.0);
                // NaN becomes 0, as in `rectified`.
                value = simd.select_f32s(simd.greater_than_f32s(value, zero), value, zero);
            }
            store(simd, &mut rows.outputs[range], value);
        }
    }
}

/// A vector from as many numbers or fewer.
#[inline(always)]
fn load<S: Simd>(simd: S, values: &[f32]) -> S::f32s {
    match S::as_simd_f32s(values).0.first() {
        Some(vector) => *vector,
        None => simd.partial_load_f32s(values),
    }
}

/// As many numbers of a vector as there is room for.
#[inline(always)]
fn store<S: Simd>(simd: S, values: &mut [f32], vector: S::f32s) {
    match S::as_mut_simd_f32s(values).0.first_mut() {
        Some(whole) => *whole = vector,
        None => simd.partial_store_f32s(values, vector),
    }
}
