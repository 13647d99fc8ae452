//! A matrix product by workgroups, each of which computes a tile of the outputs.
//!
//! The workgroup proceeds along the inner index in steps: it fetches its rows of the left matrix and its columns of the
//! right one into workgroup memory, each number once, and sums the products from there, in registers. The memory holds
//! two steps: while one is multiplied, the next is fetched, and a step takes one barrier.
//!
//! Beyond the inner index both matrices are 0, so that a step has a constant number of products, which drivers unroll.
//! That changes no bit: a sum begins with 0, so it is never -0, and adding 0 leaves it.
//!
//! This code must not panic, see [`crate::unchecked`]. Closures capture by value: a module with logical addressing
//! cannot hold references to references.

mod fours;
mod halves;
mod subgroup;

pub(crate) use fours::{InFours, Large, Least, Small, Tiny, shared};
#[cfg(target_arch = "spirv")]
pub(crate) use halves::Matrices;
pub(crate) use halves::{Half, HalfSmall, HalfTiny, StandIns, TwoHalves, TwoHalvesSmall, TwoHalvesTiny};
pub(crate) use halves::{Repeated, SharedOfRepeated};
pub(crate) use halves::{SharedOfHalf, SharedOfHalfSmall, SharedOfHalfTiny};
pub(crate) use halves::{SharedOfTwoHalves, SharedOfTwoHalvesSmall, SharedOfTwoHalvesTiny};
pub(crate) use subgroup::Subgroup;

use spirv_std::arch::{IndexUnchecked, control_barrier};
use spirv_std::glam::Vec4;
use spirv_std::memory::{Scope, Semantics};
use viewfuse_kernels::network::tile::{EightSums, Left, Outputs, Right, Shape, Sums, Tiles};
use viewfuse_kernels::rows::Form;

/// Rows and columns of a tile of [`Form::Single`], and invocations of its workgroup.
const SIDE: u32 = Form::Single.rows();
const INVOCATIONS: u32 = Form::Single.invocations();
/// Inner indices of a step.
const STEP: u32 = 8;
/// Invocations beside one another, and below.
const LINE: u32 = SIDE / EightSums::ROWS;
/// Fours of a tile's rows or columns.
const FOURS: u32 = SIDE / 4;
/// Fours of an inner index in the workgroup's memory: odd, so that neighbouring indices lie in different banks.
const STRIDE: u32 = FOURS + 1;
/// Inner indices from an invocation's first four of columns to its second, and fours from its first of rows to its
/// second.
const NEXT_INNER: u32 = INVOCATIONS / FOURS;
const NEXT_FOUR: u32 = INVOCATIONS / STEP;

const _: () = assert!(LINE * LINE == INVOCATIONS && STEP * FOURS == 2 * INVOCATIONS);

/// A matrix in a workgroup's memory: `[step][inner][row or column]`, in fours, of two steps.
pub(crate) type SharedOfSingle = [Vec4; (2 * STEP * STRIDE) as usize];

/// What an invocation computes of its workgroup's tile.
#[derive(Clone, Copy)]
pub(crate) struct InvocationTile {
    /// First row and column of the tile.
    pub(crate) first_row: u32,
    pub(crate) first_column: u32,
    /// Its own place in the rows and columns of the tile.
    pub(crate) own_row: u32,
    pub(crate) own_column: u32,
}

impl InvocationTile {
    /// That of an invocation in a workgroup, whose tile has `rows` and `columns`, with `line` invocations beside one
    /// another.
    #[inline(always)]
    pub(crate) fn new(
        group: u32,
        invocation: u32,
        [rows, columns]: [u32; 2],
        line: u32,
        shape: Shape,
    ) -> InvocationTile {
        let group_columns = shape.column_count.div_ceil(columns);
        InvocationTile {
            first_row: group / group_columns * rows,
            first_column: group % group_columns * columns,
            own_row: invocation / line,
            own_column: invocation % line,
        }
    }
}

/// What an invocation fetches of its workgroup's tile.
#[derive(Clone, Copy)]
struct Share<R> {
    /// Its inner index in a step, and the four, of the left and of the right matrix.
    left: [u32; 2],
    right: [u32; 2],
    /// The rows of its two fours, and its columns.
    near_rows: [R; 4],
    far_rows: [R; 4],
    columns: [u32; 4],
}

/// A step of an invocation's share: a four of rows and one of columns, twice.
type Step = [[Vec4; 2]; 2];

impl<R: Copy> Share<R> {
    /// Neighbours fetch what lies next to one another: numbers of a row, and columns.
    #[inline(always)]
    fn new<L: Left<Row = R>>(local: u32, place: InvocationTile, shape: Shape, left: L) -> Share<R> {
        let (left_four, right_four) = (local / STEP, local % FOURS);
        let near_rows = four_rows(left, place.first_row + left_four * 4, shape);
        let far_rows = four_rows(left, place.first_row + (left_four + NEXT_FOUR) * 4, shape);
        let (first, last) = (place.first_column + right_four, shape.column_count - 1);
        let columns =
            [first.min(last), (first + FOURS).min(last), (first + 2 * FOURS).min(last), (first + 3 * FOURS).min(last)];
        Share { left: [local % STEP, left_four], right: [local / FOURS, right_four], near_rows, far_rows, columns }
    }

    #[inline(always)]
    fn fetch<L: Left<Row = R>>(self, start: u32, shape: Shape, left: L, right: impl Right) -> Step {
        let (row_inner, column_inner) = (start + self.left[0], start + self.right[0]);
        let near = [
            fetch_rows(left, row_inner, self.near_rows, shape),
            fetch_columns(right, column_inner, self.columns, shape),
        ];
        let far_inner = column_inner + NEXT_INNER;
        [
            near,
            [fetch_rows(left, row_inner, self.far_rows, shape), fetch_columns(right, far_inner, self.columns, shape)],
        ]
    }

    /// Writes a step behind the first `half` inner indices of the workgroup's memory.
    #[inline(always)]
    fn write<const N: usize>(self, rows: &mut [Vec4; N], columns: &mut [Vec4; N], half: u32, [near, far]: Step) {
        let row_place = (half + self.left[0]) * STRIDE + self.left[1];
        let column_place = (half + self.right[0]) * STRIDE + self.right[1];
        write(rows, row_place, near[0]);
        write(columns, column_place, near[1]);
        write(rows, row_place + NEXT_FOUR, far[0]);
        write(columns, column_place + NEXT_INNER * STRIDE, far[1]);
    }
}

#[inline(always)]
fn four_rows<L: Left>(left: L, first: u32, shape: Shape) -> [L::Row; 4] {
    let last = shape.row_count - 1;
    [
        left.row(first.min(last)),
        left.row((first + 1).min(last)),
        left.row((first + 2).min(last)),
        left.row((first + 3).min(last)),
    ]
}

/// The numbers of an inner index in four rows, 0 beyond the matrix.
#[inline(always)]
fn fetch_rows<L: Left>(left: L, inner: u32, [a, b, c, d]: [L::Row; 4], shape: Shape) -> Vec4 {
    let exists = inner < shape.inner_count;
    let inner = left.inner(inner);
    let four = Vec4::new(left.number(a, inner), left.number(b, inner), left.number(c, inner), left.number(d, inner));
    if exists { four } else { Vec4::ZERO }
}

/// The numbers of an inner index in four columns, 0 beyond the matrix.
#[inline(always)]
fn fetch_columns(right: impl Right, inner: u32, [a, b, c, d]: [u32; 4], shape: Shape) -> Vec4 {
    let number = |column: u32| right.number(inner, column);
    let four = Vec4::new(number(a), number(b), number(c), number(d));
    if inner < shape.inner_count { four } else { Vec4::ZERO }
}

/// A tile that goes through the workgroup's memory.
pub(crate) struct Staged<'a> {
    pub(crate) rows: &'a mut SharedOfSingle,
    pub(crate) columns: &'a mut SharedOfSingle,
}

impl Tiles for Staged<'_> {
    #[inline(always)]
    fn multiply<L: Left>(self, invocation: u32, shape: Shape, left: L, right: impl Right, mut outputs: impl Outputs) {
        let Staged { rows, columns } = self;
        let (group, local) = (invocation / INVOCATIONS, invocation % INVOCATIONS);
        let place = InvocationTile::new(group, local, [SIDE; 2], LINE, shape);
        let share = Share::new(local, place, shape, left);
        let mut next = share.fetch(0, shape, left, right);
        share.write(rows, columns, 0, next);
        wait_for_all();
        let mut sums = EightSums::ZERO;
        let (mut start, mut half) = (0, 0);
        while start < shape.inner_count {
            let has_next = start + STEP < shape.inner_count;
            if has_next {
                next = share.fetch(start + STEP, shape, left, right);
            }
            let (row_place, column_place) = (half * STRIDE + place.own_row, half * STRIDE + place.own_column);
            let (lent_rows, lent_columns) = (&*rows, &*columns);
            let mut inner = 0;
            while inner < STEP {
                let at = inner * STRIDE;
                let row_fours = EightSums::rows(move |four| read(lent_rows, row_place + at + four * LINE));
                let column_fours = EightSums::columns(move |four| read(lent_columns, column_place + at + four * LINE));
                sums.add(row_fours, column_fours);
                inner += 1;
            }
            half = STEP - half;
            if has_next {
                share.write(rows, columns, half, next);
            }
            wait_for_all();
            start += STEP;
        }
        let column = move |four: u32, index: u32| place.first_column + four * LINE + place.own_column + index * FOURS;
        store_sums(sums, place, LINE, shape, column, &mut outputs);
    }
}

/// Stores an invocation's sums of a tile, as far as the outputs go. `column` is that of a four and an index in it.
#[inline(always)]
pub(crate) fn store_sums<S: Sums>(
    mut sums: S,
    place: InvocationTile,
    line: u32,
    shape: Shape,
    column: impl Fn(u32, u32) -> u32 + Copy,
    outputs: &mut impl Outputs,
) {
    let mut index = 0;
    while index < S::ROWS {
        let row = place.first_row + row_place(line, place.own_row, index);
        sums.take_row(|four, sums| {
            let mut store_one = |column: u32, sum: f32| {
                if row < shape.row_count && column < shape.column_count {
                    outputs.put(row, column, sum);
                }
            };
            store_one(column(four, 0), sums.x);
            store_one(column(four, 1), sums.y);
            store_one(column(four, 2), sums.z);
            store_one(column(four, 3), sums.w);
        });
        index += 1;
    }
}

/// Where in a tile the row number `index` of the invocation lies that is number `own` of `line` below one another.
#[inline(always)]
pub(crate) fn row_place(line: u32, local: u32, index: u32) -> u32 {
    (index / 4 * line + local) * 4 + index % 4
}

#[inline(always)]
#[allow(unsafe_code)]
fn read<const N: usize>(shared: &[Vec4; N], place: u32) -> Vec4 {
    // SAFETY: halves, inner indices and fours are below those that the array was made for.
    unsafe { *shared.index_unchecked(place as usize) }
}

#[inline(always)]
#[allow(unsafe_code)]
fn write<const N: usize>(shared: &mut [Vec4; N], place: u32, value: Vec4) {
    // SAFETY: as in `read`.
    unsafe { *shared.index_unchecked_mut(place as usize) = value };
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
