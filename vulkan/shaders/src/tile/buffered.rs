//! Two tiles beside each other, double-buffered ([`Form::Buffered`]).
//!
//! The workgroup's memory holds two steps. What an invocation fetches for the next step waits in its registers while it
//! multiplies the present one, and is then written into the half that nobody reads any more: all invocations have passed
//! the barrier behind the step before.

use super::{FOURS, InvocationTile, SHORT_STEP, Shared, read_fours, store_sums, wait_for_all, write};
use spirv_std::glam::Vec4;
use viewfuse_kernels::network::tile::{Shape, Sums, TILE, Tiles};
use viewfuse_kernels::rows::Form;

/// The workgroup memory of [`Form::Buffered`]: in each array two steps of [`SHORT_STEP`] inner indices.
pub(crate) struct Buffered<'a> {
    pub(crate) rows: &'a mut Shared,
    pub(crate) columns: &'a mut Shared,
    pub(crate) more_columns: &'a mut Shared,
}

/// An invocation's share of a step of a tile's rows or columns: two of 2 * 64 fours.
type Share = [Vec4; 2];

const _: () = assert!(SHORT_STEP * FOURS == 2 * TILE);

impl Tiles for Buffered<'_> {
    #[inline(always)]
    fn multiply(
        self,
        invocation: u32,
        shape: Shape,
        left: impl Fn(u32, u32) -> f32 + Copy,
        right: impl Fn(u32, u32) -> f32 + Copy,
        mut store: impl FnMut(u32, u32, f32),
    ) {
        let Buffered { rows, columns, more_columns } = self;
        let place = InvocationTile::new(invocation, shape, Form::Buffered);
        let second_column = place.first_column + TILE;
        let (mut sums, mut more) = (Sums::ZERO, Sums::ZERO);
        let (mut start, mut half) = (0, 0);
        // Each pass fetches a step and multiplies the one before: the first pass multiplies nothing, and the last one, behind
        // the matrices, fetches the last inner index again.
        while start < shape.inner_count + SHORT_STEP {
            let next_rows = fetch_rows(place, start, shape, left);
            let next_columns = fetch_columns(place.own, start, place.first_column, shape, right);
            let next_more = fetch_columns(place.own, start, second_column, shape, right);
            let before = start.max(SHORT_STEP) - SHORT_STEP;
            let mut inner = SHORT_STEP - half;
            let end = inner + (start - before).min(shape.inner_count - before);
            while inner < end {
                let own_rows = read_fours(rows, inner, place.own_row);
                sums.add(own_rows, read_fours(columns, inner, place.own_column));
                more.add(own_rows, read_fours(more_columns, inner, place.own_column));
                inner += 1;
            }
            write_rows(rows, place.own, half, next_rows);
            write_columns(columns, place.own, half, next_columns);
            write_columns(more_columns, place.own, half, next_more);
            wait_for_all();
            half = SHORT_STEP - half;
            start += SHORT_STEP;
        }
        store_sums(sums, place, place.first_row, place.first_column, shape, &mut store);
        store_sums(more, place, place.first_row, second_column, shape, &mut store);
    }
}

/// Neighbours fetch inner indices that lie next to one another in the buffers.
#[inline(always)]
fn fetch_rows(place: InvocationTile, start: u32, shape: Shape, left: impl Fn(u32, u32) -> f32 + Copy) -> Share {
    let left = move |row: u32, inner: u32| left(row.min(shape.row_count - 1), inner.min(shape.inner_count - 1));
    let at = start + place.own % SHORT_STEP;
    let fetch_four = move |row: u32| Vec4::new(left(row, at), left(row + 1, at), left(row + 2, at), left(row + 3, at));
    let row = place.first_row + place.own / SHORT_STEP * 4;
    [fetch_four(row), fetch_four(row + TILE / 2)]
}

#[inline(always)]
fn write_rows(rows: &mut Shared, own: u32, half: u32, share: Share) {
    write(rows, half + own % SHORT_STEP, own / SHORT_STEP, share[0]);
    write(rows, half + own % SHORT_STEP, own / SHORT_STEP + FOURS / 2, share[1]);
}

/// Neighbours fetch columns that lie next to one another in the buffers.
#[inline(always)]
fn fetch_columns(
    own: u32,
    start: u32,
    first_column: u32,
    shape: Shape,
    right: impl Fn(u32, u32) -> f32 + Copy,
) -> Share {
    let right =
        move |inner: u32, column: u32| right(inner.min(shape.inner_count - 1), column.min(shape.column_count - 1));
    let column = first_column + own % FOURS * 4;
    let fetch_four = move |at: u32| {
        Vec4::new(right(at, column), right(at, column + 1), right(at, column + 2), right(at, column + 3))
    };
    let at = start + own / FOURS;
    [fetch_four(at), fetch_four(at + SHORT_STEP / 2)]
}

#[inline(always)]
fn write_columns(columns: &mut Shared, own: u32, half: u32, share: Share) {
    write(columns, half + own / FOURS, own % FOURS, share[0]);
    write(columns, half + own / FOURS + SHORT_STEP / 2, own % FOURS, share[1]);
}
