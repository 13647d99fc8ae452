//! A matrix product by workgroups, each of which computes a tile of the outputs.
//!
//! The workgroup proceeds along the inner index in steps: it fetches its rows of the left matrix and its columns of the
//! right one into workgroup memory, each number once, and sums the products from there.
//!
//! This code must not panic, see [`crate::unchecked`]. Closures capture by value: a module with logical addressing cannot
//! hold references to references.

use spirv_std::arch::{IndexUnchecked, control_barrier};
use spirv_std::glam::Vec4;
use spirv_std::memory::{Scope, Semantics};
use viewfuse_core::network::tile::{Sums, TILE};

/// Inner indices of a step.
const STEP: u32 = 16;
/// Fours of a tile's rows or columns.
const FOURS: u32 = TILE / 4;
/// Fours from an inner index to the next: odd, so that neighbouring indices lie in different banks of the memory.
const STRIDE: u32 = FOURS + 1;

/// A step of either matrix in a workgroup's memory: `[inner][row or column]`, in fours.
pub(crate) type Shared = [Vec4; (STEP * STRIDE) as usize];

/// The sizes of the matrices.
#[derive(Clone, Copy)]
pub(crate) struct Shape {
    /// Rows of the left matrix and of the outputs.
    pub(crate) row_count: u32,
    /// Columns of the left matrix, rows of the right one.
    pub(crate) inner_count: u32,
    /// Columns of the right matrix and of the outputs.
    pub(crate) column_count: u32,
}

/// Computes an invocation's part of the matrix product of `left(row, inner)` and `right(inner, column)`, and calls
/// `store(row, column, sum)`. All invocations of a workgroup take part, with outputs or without: beyond the matrices, the
/// last row or column is read and the sum is not stored.
#[inline(always)]
pub(crate) fn multiply(
    invocation: u32,
    shape: Shape,
    rows: &mut Shared,
    columns: &mut Shared,
    left: impl Fn(u32, u32) -> f32,
    right: impl Fn(u32, u32) -> f32,
    mut store: impl FnMut(u32, u32, f32),
) {
    let Shape { row_count, inner_count, column_count } = shape;
    let left = move |row: u32, inner: u32| left(row.min(row_count - 1), inner.min(inner_count - 1));
    let right = move |inner: u32, column: u32| right(inner.min(inner_count - 1), column.min(column_count - 1));
    let (tile, own) = (invocation / TILE, invocation % TILE);
    let tile_columns = column_count.div_ceil(TILE);
    let (first_row, first_column) = (tile / tile_columns * TILE, tile % tile_columns * TILE);
    let (own_row, own_column) = (own / Sums::SIDE, own % Sums::SIDE);
    let mut sums = Sums::ZERO;
    let mut start = 0;
    while start < inner_count {
        let mut index = own;
        while index < STEP * FOURS {
            // Neighbours fetch what lies next to one another in the buffers.
            let (inner, four) = (index % STEP, index / STEP);
            let (at, row) = (start + inner, first_row + 4 * four);
            let fetched = Vec4::new(left(row, at), left(row + 1, at), left(row + 2, at), left(row + 3, at));
            write(rows, inner, four, fetched);
            let (inner, four) = (index / FOURS, index % FOURS);
            let (at, column) = (start + inner, first_column + 4 * four);
            let fetched =
                Vec4::new(right(at, column), right(at, column + 1), right(at, column + 2), right(at, column + 3));
            write(columns, inner, four, fetched);
            index += TILE;
        }
        wait_for_all();
        let count = STEP.min(inner_count - start);
        let mut inner = 0;
        while inner < count {
            sums.add(read_fours(rows, inner, own_row), read_fours(columns, inner, own_column));
            inner += 1;
        }
        wait_for_all();
        start += STEP;
    }
    let column = first_column + Sums::place(own_column, 0);
    let mut index = 0;
    while index < Sums::SIDE {
        let row = first_row + Sums::place(own_row, index);
        let [near, far] = sums.take_row();
        let mut store_one = |column: u32, sum: f32| {
            if row < row_count && column < column_count {
                store(row, column, sum);
            }
        };
        let mut store_four = |column: u32, four: Vec4| {
            store_one(column, four.x);
            store_one(column + 1, four.y);
            store_one(column + 2, four.z);
            store_one(column + 3, four.w);
        };
        store_four(column, near);
        store_four(column + Sums::place(0, 4), far);
        index += 1;
    }
}

/// The place of a four of a step: within its array for all indices.
#[inline(always)]
fn place(inner: u32, four: u32) -> usize {
    (inner % STEP * STRIDE + four % FOURS) as usize
}

/// The numbers of an inner index that invocation `own` needs.
#[inline(always)]
fn read_fours(shared: &Shared, inner: u32, own: u32) -> [Vec4; 2] {
    [read(shared, inner, Sums::place(own, 0) / 4), read(shared, inner, Sums::place(own, 4) / 4)]
}

#[inline(always)]
#[allow(unsafe_code)]
fn read(shared: &Shared, inner: u32, four: u32) -> Vec4 {
    // SAFETY: a place is within the array.
    unsafe { *shared.index_unchecked(place(inner, four)) }
}

#[inline(always)]
#[allow(unsafe_code)]
fn write(shared: &mut Shared, inner: u32, four: u32, value: Vec4) {
    // SAFETY: a place is within the array.
    unsafe { *shared.index_unchecked_mut(place(inner, four)) = value };
}

/// A workgroup barrier: each invocation waits for all, and then sees the others' writes.
#[inline(always)]
fn wait_for_all() {
    const WORKGROUP: u32 = Scope::Workgroup as u32;
    const SHARED: u32 = Semantics::WORKGROUP_MEMORY.bits()
        | Semantics::ACQUIRE_RELEASE.bits()
        | Semantics::MAKE_AVAILABLE.bits()
        | Semantics::MAKE_VISIBLE.bits();
    control_barrier::<WORKGROUP, WORKGROUP, SHARED>();
}
