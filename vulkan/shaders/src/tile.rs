//! A matrix product by workgroups, each of which computes a tile of the outputs, or several ([`Form`]).
//!
//! The workgroup proceeds along the inner index in steps: it fetches its rows of the left matrix and its columns of the
//! right one into workgroup memory, each number once, and sums the products from there.
//!
//! This code must not panic, see [`crate::unchecked`]. Closures capture by value: a module with logical addressing cannot
//! hold references to references.

mod buffered;
mod subgroup;

pub(crate) use buffered::Buffered;
pub(crate) use subgroup::Subgroup;

use spirv_std::arch::{IndexUnchecked, control_barrier};
use spirv_std::glam::Vec4;
use spirv_std::memory::{Scope, Semantics};
use viewfuse_kernels::network::tile::{Shape, Sums, TILE, Tiles};
use viewfuse_kernels::rows::Form;

/// Inner indices of a step.
const STEP: u32 = 16;
/// The same where two tiles of rows and two of columns must fit into the memory of a workgroup, or two steps of three.
pub(crate) const SHORT_STEP: u32 = 8;
/// Fours of a tile's rows or columns.
pub(crate) const FOURS: u32 = TILE / 4;
/// Fours from an inner index to the next: odd, so that neighbouring indices lie in different banks of the memory.
const STRIDE: u32 = FOURS + 1;

/// A step of a tile's rows or columns in a workgroup's memory: `[inner][row or column]`, in fours.
pub(crate) type Shared = [Vec4; (STEP * STRIDE) as usize];
/// The same for [`Form::Quadruple`].
pub(crate) type ShortShared = [Vec4; (SHORT_STEP * STRIDE) as usize];

/// What an invocation computes of its workgroup's tiles.
#[derive(Clone, Copy)]
pub(crate) struct InvocationTile {
    /// Its number in the workgroup.
    pub(crate) own: u32,
    /// First row and column of the workgroup's first tile.
    pub(crate) first_row: u32,
    pub(crate) first_column: u32,
    /// Its own place in the rows and columns of a tile.
    pub(crate) own_row: u32,
    pub(crate) own_column: u32,
}

impl InvocationTile {
    #[inline(always)]
    fn new(invocation: u32, shape: Shape, form: Form) -> InvocationTile {
        InvocationTile::of(invocation / TILE, invocation % TILE, shape, form)
    }

    /// That of invocation `own` in a workgroup.
    #[inline(always)]
    pub(crate) fn of(group: u32, own: u32, shape: Shape, form: Form) -> InvocationTile {
        let [rows, columns] = form.tiles();
        let group_columns = shape.column_count.div_ceil(TILE * columns);
        InvocationTile {
            own,
            first_row: group / group_columns * (TILE * rows),
            first_column: group % group_columns * (TILE * columns),
            own_row: own / Sums::SIDE,
            own_column: own % Sums::SIDE,
        }
    }
}

/// The workgroup memory of [`Form::Single`].
pub(crate) struct Single<'a> {
    pub(crate) rows: &'a mut Shared,
    pub(crate) columns: &'a mut Shared,
}

/// That of [`Form::Double`]: a number of the rows is read once for the columns of two tiles.
pub(crate) struct Double<'a> {
    pub(crate) rows: &'a mut Shared,
    pub(crate) columns: &'a mut Shared,
    pub(crate) more_columns: &'a mut Shared,
}

/// That of [`Form::Quadruple`]: each number is read once for two tiles.
pub(crate) struct Quadruple<'a> {
    pub(crate) rows: &'a mut ShortShared,
    pub(crate) more_rows: &'a mut ShortShared,
    pub(crate) columns: &'a mut ShortShared,
    pub(crate) more_columns: &'a mut ShortShared,
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
        let place = InvocationTile::new(invocation, shape, Form::Single);
        let mut sums = Sums::ZERO;
        let mut start = 0;
        while start < shape.inner_count {
            fetch_rows(rows, place.own, start, place.first_row, shape, left);
            fetch_columns(columns, place.own, start, place.first_column, shape, right);
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
        store_sums(sums, place, place.first_row, place.first_column, shape, &mut store);
    }
}

impl Tiles for Double<'_> {
    #[inline(always)]
    fn multiply(
        self,
        invocation: u32,
        shape: Shape,
        left: impl Fn(u32, u32) -> f32 + Copy,
        right: impl Fn(u32, u32) -> f32 + Copy,
        mut store: impl FnMut(u32, u32, f32),
    ) {
        let Double { rows, columns, more_columns } = self;
        let place = InvocationTile::new(invocation, shape, Form::Double);
        let second_column = place.first_column + TILE;
        let (mut sums, mut more) = (Sums::ZERO, Sums::ZERO);
        let mut start = 0;
        while start < shape.inner_count {
            fetch_rows(rows, place.own, start, place.first_row, shape, left);
            fetch_columns(columns, place.own, start, place.first_column, shape, right);
            fetch_columns(more_columns, place.own, start, second_column, shape, right);
            wait_for_all();
            let count = STEP.min(shape.inner_count - start);
            let mut inner = 0;
            while inner < count {
                let own_rows = read_fours(rows, inner, place.own_row);
                sums.add(own_rows, read_fours(columns, inner, place.own_column));
                more.add(own_rows, read_fours(more_columns, inner, place.own_column));
                inner += 1;
            }
            wait_for_all();
            start += STEP;
        }
        store_sums(sums, place, place.first_row, place.first_column, shape, &mut store);
        store_sums(more, place, place.first_row, second_column, shape, &mut store);
    }
}

impl Tiles for Quadruple<'_> {
    #[inline(always)]
    fn multiply(
        self,
        invocation: u32,
        shape: Shape,
        left: impl Fn(u32, u32) -> f32 + Copy,
        right: impl Fn(u32, u32) -> f32 + Copy,
        mut store: impl FnMut(u32, u32, f32),
    ) {
        let Quadruple { rows, more_rows, columns, more_columns } = self;
        let place = InvocationTile::new(invocation, shape, Form::Quadruple);
        let (second_row, second_column) = (place.first_row + TILE, place.first_column + TILE);
        let (mut sums, mut beside, mut below, mut across) = (Sums::ZERO, Sums::ZERO, Sums::ZERO, Sums::ZERO);
        let mut start = 0;
        while start < shape.inner_count {
            fetch_rows(rows, place.own, start, place.first_row, shape, left);
            fetch_rows(more_rows, place.own, start, second_row, shape, left);
            fetch_columns(columns, place.own, start, place.first_column, shape, right);
            fetch_columns(more_columns, place.own, start, second_column, shape, right);
            wait_for_all();
            let count = SHORT_STEP.min(shape.inner_count - start);
            let mut inner = 0;
            while inner < count {
                let own_rows = read_fours(rows, inner, place.own_row);
                let own_more_rows = read_fours(more_rows, inner, place.own_row);
                let own_columns = read_fours(columns, inner, place.own_column);
                let own_more_columns = read_fours(more_columns, inner, place.own_column);
                sums.add(own_rows, own_columns);
                beside.add(own_rows, own_more_columns);
                below.add(own_more_rows, own_columns);
                across.add(own_more_rows, own_more_columns);
                inner += 1;
            }
            wait_for_all();
            start += SHORT_STEP;
        }
        store_sums(sums, place, place.first_row, place.first_column, shape, &mut store);
        store_sums(beside, place, place.first_row, second_column, shape, &mut store);
        store_sums(below, place, second_row, place.first_column, shape, &mut store);
        store_sums(across, place, second_row, second_column, shape, &mut store);
    }
}

/// Fetches a step of a tile's rows, `STEP` inner indices of a [`Shared`] or of a [`ShortShared`].
#[inline(always)]
fn fetch_rows<const N: usize>(
    rows: &mut [Vec4; N],
    own: u32,
    start: u32,
    first_row: u32,
    shape: Shape,
    left: impl Fn(u32, u32) -> f32,
) {
    let left = move |row: u32, inner: u32| left(row.min(shape.row_count - 1), inner.min(shape.inner_count - 1));
    let steps = N as u32 / STRIDE;
    let mut index = own;
    while index < steps * FOURS {
        // Neighbours fetch what lies next to one another in the buffers.
        let (inner, four) = (index % steps, index / steps);
        let (at, row) = (start + inner, first_row + 4 * four);
        let fetched = Vec4::new(left(row, at), left(row + 1, at), left(row + 2, at), left(row + 3, at));
        write(rows, inner, four, fetched);
        index += TILE;
    }
}

/// Fetches a step of a tile's columns.
#[inline(always)]
fn fetch_columns<const N: usize>(
    columns: &mut [Vec4; N],
    own: u32,
    start: u32,
    first_column: u32,
    shape: Shape,
    right: impl Fn(u32, u32) -> f32,
) {
    let right =
        move |inner: u32, column: u32| right(inner.min(shape.inner_count - 1), column.min(shape.column_count - 1));
    let steps = N as u32 / STRIDE;
    let mut index = own;
    while index < steps * FOURS {
        let (inner, four) = (index / FOURS, index % FOURS);
        let (at, column) = (start + inner, first_column + 4 * four);
        let fetched = Vec4::new(right(at, column), right(at, column + 1), right(at, column + 2), right(at, column + 3));
        write(columns, inner, four, fetched);
        index += TILE;
    }
}

/// Stores an invocation's sums of a tile, as far as the outputs go.
#[inline(always)]
pub(crate) fn store_sums(
    mut sums: Sums,
    place: InvocationTile,
    first_row: u32,
    first_column: u32,
    shape: Shape,
    store: &mut impl FnMut(u32, u32, f32),
) {
    let column = first_column + Sums::place(place.own_column, 0);
    let mut index = 0;
    while index < Sums::SIDE {
        let row = first_row + Sums::place(place.own_row, index);
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
fn place<const N: usize>(inner: u32, four: u32) -> usize {
    (inner % (N as u32 / STRIDE) * STRIDE + four % FOURS) as usize
}

/// The numbers of an inner index that invocation `own` needs.
#[inline(always)]
pub(crate) fn read_fours<const N: usize>(shared: &[Vec4; N], inner: u32, own: u32) -> [Vec4; 2] {
    [read(shared, inner, Sums::place(own, 0) / 4), read(shared, inner, Sums::place(own, 4) / 4)]
}

#[inline(always)]
#[allow(unsafe_code)]
fn read<const N: usize>(shared: &[Vec4; N], inner: u32, four: u32) -> Vec4 {
    // SAFETY: a place is within the array.
    unsafe { *shared.index_unchecked(place::<N>(inner, four)) }
}

#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn write<const N: usize>(shared: &mut [Vec4; N], inner: u32, four: u32, value: Vec4) {
    // SAFETY: a place is within the array.
    unsafe { *shared.index_unchecked_mut(place::<N>(inner, four)) = value };
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
