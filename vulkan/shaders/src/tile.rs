//! A matrix product by workgroups, each of which computes a tile of the outputs.
//!
//! The workgroup walks along the inner index in steps: it fetches the rows of the left matrix and the columns of the right
//! one that it needs into its own memory, each number once, and adds up the products from there.

use spirv_std::arch::control_barrier;
use spirv_std::memory::{Scope, Semantics};
use viewfuse_core::network::tile::{SIDE, Sums, TILE};

/// Inner indices of a step.
pub(crate) const STEP: u32 = 16;
/// From a row of the left matrix to the next: odd, so that rows lie in different banks of the workgroup's memory.
const LEFT_STRIDE: u32 = STEP + 1;

/// A step of the left matrix, `[row][inner]`.
pub(crate) type Left = [f32; (TILE * LEFT_STRIDE) as usize];
/// A step of the right matrix, `[inner][column]`.
pub(crate) type Right = [f32; (STEP * TILE) as usize];

/// The memory of a workgroup.
pub(crate) struct Shared<'a> {
    pub(crate) left: &'a mut Left,
    pub(crate) right: &'a mut Right,
}

/// How large the matrices are.
#[derive(Clone, Copy)]
pub(crate) struct Shape {
    /// Rows of the left matrix and of the outputs.
    pub(crate) row_count: u32,
    /// Columns of the left matrix, rows of the right one.
    pub(crate) inner_count: u32,
    /// Columns of the right matrix and of the outputs.
    pub(crate) column_count: u32,
}

/// Computes the part of the outputs that belongs to an invocation: every sum begins with `first(row, column)`, and ends up
/// in `store(row, column, sum)`. All invocations of a workgroup take part, whether they have outputs or not.
#[inline(always)]
pub(crate) fn multiply(
    invocation: u32,
    shape: Shape,
    shared: Shared,
    left: impl Fn(u32, u32) -> f32,
    right: impl Fn(u32, u32) -> f32,
    first: impl Fn(u32, u32) -> f32,
    mut store: impl FnMut(u32, u32, f32),
) {
    let Shape { row_count, inner_count, column_count } = shape;
    let side = SIDE as u32;
    let (tile, own) = (invocation / TILE, invocation % TILE);
    let tile_columns = column_count.div_ceil(TILE);
    let (first_row, first_column) = (tile / tile_columns * TILE, tile % tile_columns * TILE);
    let (own_row, own_column) = (own / side, own % side);
    let (row, column) = (first_row + own_row, first_column + own_column);
    let exists = |row: u32, column: u32| row < row_count && column < column_count;
    let at = |index: usize| index as u32 * side;
    let mut sums = Sums::starting_with(|i, j| {
        let (row, column) = (row + at(i), column + at(j));
        if exists(row, column) { first(row, column) } else { 0.0 }
    });
    let mut start = 0;
    while start < inner_count {
        let mut index = own;
        while index < TILE * STEP {
            let (row, inner) = (index / STEP, index % STEP);
            let is_there = first_row + row < row_count && start + inner < inner_count;
            shared.left[(row * LEFT_STRIDE + inner) as usize] =
                if is_there { left(first_row + row, start + inner) } else { 0.0 };
            let (inner, column) = (index / TILE, index % TILE);
            let is_there = first_column + column < column_count && start + inner < inner_count;
            shared.right[index as usize] = if is_there { right(start + inner, first_column + column) } else { 0.0 };
            index += TILE;
        }
        wait_for_all();
        let mut inner = 0;
        while inner < STEP {
            sums.add(
                |i| shared.left[((own_row + at(i)) * LEFT_STRIDE + inner) as usize],
                |j| shared.right[(inner * TILE + own_column + at(j)) as usize],
            );
            inner += 1;
        }
        wait_for_all();
        start += STEP;
    }
    sums.hand_out(|i, j, sum| {
        let (row, column) = (row + at(i), column + at(j));
        if exists(row, column) {
            store(row, column, sum);
        }
    });
}

/// No invocation of the workgroup goes on before all are here, and each then sees what the others wrote.
fn wait_for_all() {
    const WORKGROUP: u32 = Scope::Workgroup as u32;
    const SHARED: u32 = Semantics::WORKGROUP_MEMORY.bits()
        | Semantics::ACQUIRE_RELEASE.bits()
        | Semantics::MAKE_AVAILABLE.bits()
        | Semantics::MAKE_VISIBLE.bits();
    control_barrier::<WORKGROUP, WORKGROUP, SHARED>();
}
