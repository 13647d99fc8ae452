//! A matrix product by workgroups, each of which computes a tile of the outputs.
//!
//! The workgroup walks along the inner index in steps: it fetches the rows of the left matrix and the columns of the right
//! one that it needs into its own memory, each number once, and adds up the products from there.

use spirv_std::arch::{IndexUnchecked, control_barrier};
use spirv_std::glam::Vec4;
use spirv_std::memory::{Scope, Semantics};
use viewfuse_core::network::tile::{Sums, TILE};

/// Inner indices of a step.
const STEP: u32 = 16;
/// Fours of a tile's rows or columns.
const FOURS: u32 = TILE / 4;
/// Fours from an inner index to the next: odd, so that they begin in different banks of the workgroup's memory.
const STRIDE: u32 = FOURS + 1;

/// A step of either matrix, `[inner][row or column]` in fours.
pub(crate) type Shared = [Vec4; (STEP * STRIDE) as usize];

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

/// Computes the part of the outputs that belongs to an invocation: hands them out as `store(row, column, sum)`. All
/// invocations of a workgroup take part, whether they have outputs or not, and nothing here may panic.
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
    let (tile, own) = (invocation / TILE, invocation % TILE);
    let tile_columns = column_count.div_ceil(TILE);
    let (first_row, first_column) = (tile / tile_columns * TILE, tile % tile_columns * TILE);
    let (own_row, own_column) = (own / 8, own % 8);
    let left = move |row: u32, inner: u32| if row < row_count && inner < inner_count { left(row, inner) } else { 0.0 };
    let right =
        move |inner: u32, column: u32| if column < column_count && inner < inner_count { right(inner, column) } else { 0.0 };
    let mut sums = Sums::ZERO;
    let mut start = 0;
    while start < inner_count {
        let mut index = own;
        while index < STEP * FOURS {
            let (four, inner) = (index / STEP, index % STEP);
            let (row, at) = (first_row + 4 * four, start + inner);
            let value = Vec4::new(left(row, at), left(row + 1, at), left(row + 2, at), left(row + 3, at));
            unsafe { *rows.index_unchecked_mut((inner * STRIDE + four) as usize) = value };
            let (four, inner) = (index % FOURS, index / FOURS);
            let (column, at) = (first_column + 4 * four, start + inner);
            let value = Vec4::new(right(at, column), right(at, column + 1), right(at, column + 2), right(at, column + 3));
            unsafe { *columns.index_unchecked_mut((inner * STRIDE + four) as usize) = value };
            index += TILE;
        }
        wait_for_all();
        let mut inner = 0;
        while inner < STEP {
            let four = move |shared: &Shared, own: u32, index: u32| unsafe {
                *shared.index_unchecked((inner * STRIDE + Sums::place(own, index) / 4) as usize)
            };
            sums.add(
                [four(rows, own_row, 0), four(rows, own_row, 1)],
                [four(columns, own_column, 0), four(columns, own_column, 1)],
            );
            inner += 1;
        }
        wait_for_all();
        start += STEP;
    }
    sums.hand_out(own_row, own_column, move |row, column, sum| {
        let (row, column) = (first_row + row, first_column + column);
        if row < row_count && column < column_count {
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
