//! A matrix product by workgroups, each of which computes a tile of the outputs.
//!
//! The workgroup proceeds along the inner index in steps: it fetches its rows of the left matrix and its columns of the
//! right one into workgroup memory, each number once, and sums the products from there.
//!
//! This code must not panic, see [`crate::unchecked`]. Closures capture by value: a module with logical addressing
//! cannot hold references to references.

mod subgroup;

pub(crate) use subgroup::Subgroup;

use spirv_std::arch::{IndexUnchecked, control_barrier};
use spirv_std::glam::Vec4;
use spirv_std::memory::{Scope, Semantics};
use viewfuse_kernels::network::tile::{Shape, Sums, TILE, Tiles};

/// Inner indices of a step.
const STEP: u32 = 16;
/// Fours of a tile's rows or columns.
const FOURS: u32 = TILE / 4;
/// Fours from an inner index to the next: odd, so that neighbouring indices lie in different banks of the memory.
const STRIDE: u32 = FOURS + 1;

/// A step of a tile's rows or columns in a workgroup's memory: `[inner][row or column]`, in fours.
pub(crate) type Shared = [Vec4; (STEP * STRIDE) as usize];

/// What an invocation computes of its workgroup's tile.
#[derive(Clone, Copy)]
pub(crate) struct InvocationTile {
    /// Its number in the workgroup.
    pub(crate) invocation: u32,
    /// First row and column of the tile.
    pub(crate) first_row: u32,
    pub(crate) first_column: u32,
    /// Its own place in the rows and columns of the tile.
    pub(crate) own_row: u32,
    pub(crate) own_column: u32,
}

impl InvocationTile {
    /// That of invocation `own` in a workgroup.
    #[inline(always)]
    pub(crate) fn of(group: u32, invocation: u32, shape: Shape) -> InvocationTile {
        let group_columns = shape.column_count.div_ceil(TILE);
        InvocationTile {
            invocation,
            first_row: group / group_columns * TILE,
            first_column: group % group_columns * TILE,
            own_row: invocation / Sums::SIDE,
            own_column: invocation % Sums::SIDE,
        }
    }
}

/// The workgroup memory of [`Form::Single`](viewfuse_kernels::rows::Form::Single).
pub(crate) struct Single<'a> {
    pub(crate) rows: &'a mut Shared,
    pub(crate) columns: &'a mut Shared,
}

impl Tiles for Single<'_> {
    #[inline(always)]
    fn multiply(
        self,
        invocation: u32,
        shape: Shape,
        left: impl Fn(u32, u32) -> f32 + Copy,
        right: impl Fn(u32, u32) -> f32 + Copy,
        mut store: impl FnMut(u32, u32, f32),
    ) {
        let Single { rows, columns } = self;
        let place = InvocationTile::of(invocation / TILE, invocation % TILE, shape);
        let mut sums = Sums::ZERO;
        let mut start = 0;
        while start < shape.inner_count {
            fetch_rows(rows, place.invocation, start, place.first_row, shape, left);
            fetch_columns(columns, place.invocation, start, place.first_column, shape, right);
            wait_for_all();
            let count = STEP.min(shape.inner_count - start);
            let mut inner = 0;
            while inner < count {
                sums.add(read_fours(rows, inner, place.own_row), read_fours(columns, inner, place.own_column));
                inner += 1;
            }
            wait_for_all();
            start += STEP;
        }
        store_sums(sums, place, shape, &mut store);
    }
}

/// Fetches a step of a tile's rows.
#[inline(always)]
fn fetch_rows(
    rows: &mut Shared,
    invocation: u32,
    start: u32,
    first_row: u32,
    shape: Shape,
    left: impl Fn(u32, u32) -> f32,
) {
    let left = move |row: u32, inner: u32| left(row.min(shape.row_count - 1), inner.min(shape.inner_count - 1));
    let mut index = invocation;
    while index < STEP * FOURS {
        // Neighbours fetch what lies next to one another in the buffers.
        let (inner, four) = (index % STEP, index / STEP);
        let (at, row) = (start + inner, first_row + 4 * four);
        let fetched = Vec4::new(left(row, at), left(row + 1, at), left(row + 2, at), left(row + 3, at));
        write(rows, inner, four, fetched);
        index += TILE;
    }
}

/// Fetches a step of a tile's columns.
#[inline(always)]
fn fetch_columns(
    columns: &mut Shared,
    invocation: u32,
    start: u32,
    first_column: u32,
    shape: Shape,
    right: impl Fn(u32, u32) -> f32,
) {
    let right =
        move |inner: u32, column: u32| right(inner.min(shape.inner_count - 1), column.min(shape.column_count - 1));
    let mut index = invocation;
    while index < STEP * FOURS {
        let (inner, four) = (index / FOURS, index % FOURS);
        let (at, column) = (start + inner, first_column + 4 * four);
        let fetched = Vec4::new(right(at, column), right(at, column + 1), right(at, column + 2), right(at, column + 3));
        write(columns, inner, four, fetched);
        index += TILE;
    }
}

/// Stores an invocation's sums of a tile, as far as the outputs go.
#[inline(always)]
pub(crate) fn store_sums(mut sums: Sums, place: InvocationTile, shape: Shape, store: &mut impl FnMut(u32, u32, f32)) {
    let column = place.first_column + Sums::place(place.own_column, 0);
    let mut index = 0;
    while index < Sums::SIDE {
        let row = place.first_row + Sums::place(place.own_row, index);
        let [near, far] = sums.take_row();
        let mut store_one = |column: u32, sum: f32| {
            if row < shape.row_count && column < shape.column_count {
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
fn read_fours(shared: &Shared, inner: u32, invocation: u32) -> [Vec4; 2] {
    [read(shared, inner, Sums::place(invocation, 0) / 4), read(shared, inner, Sums::place(invocation, 4) / 4)]
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
pub(crate) fn wait_for_all() {
    const WORKGROUP: u32 = Scope::Workgroup as u32;
    const SHARED: u32 = Semantics::WORKGROUP_MEMORY.bits()
        | Semantics::ACQUIRE_RELEASE.bits()
        | Semantics::MAKE_AVAILABLE.bits()
        | Semantics::MAKE_VISIBLE.bits();
    control_barrier::<WORKGROUP, WORKGROUP, SHARED>();
}
