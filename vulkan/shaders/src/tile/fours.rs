//! A matrix product in tiles of several sizes, for matrices that lie in fours: what is loaded and stored are vectors.
//!
//! As the scalar one of [`super`]: two steps in the workgroup's memory, sums in registers, the same order. An
//! invocation fetches a square of 4 by 4 numbers a step, of the left matrix, which it turns, or of the right one, or
//! none.

use super::{InvocationTile, read, row_place, wait_for_all, write};
use core::marker::PhantomData;
use spirv_std::glam::Vec4;
use viewfuse_kernels::network::tile::{FourSums, Left, Loaded, Outputs, Right, Shape, Sums, TallSums, Tiles};
use viewfuse_kernels::rows::Form;

/// Inner indices of a step.
const STEP: u32 = 16;
/// Squares of a step, along the inner index.
const STEP_FOURS: u32 = STEP / 4;

/// The sizes of a tile.
pub(crate) trait Tile: Copy {
    /// What an invocation sums.
    type Sums: Sums;
    const FORM: Form;

    /// Invocations beside one another, and below.
    const ACROSS: u32 = Self::FORM.columns() / Self::Sums::COLUMNS;
    const DOWN: u32 = Self::FORM.rows() / Self::Sums::ROWS;
    /// Fours of the tile's rows and columns.
    const ROW_FOURS: u32 = Self::FORM.rows() / 4;
    const COLUMN_FOURS: u32 = Self::FORM.columns() / 4;
    /// Fours of an inner index in the workgroup's memory: odd, so that neighbouring indices lie in different banks.
    const ROW_STRIDE: u32 = Self::ROW_FOURS + 1;
    const COLUMN_STRIDE: u32 = Self::COLUMN_FOURS + 1;
    /// Squares of a step.
    const ROW_SQUARES: u32 = Self::ROW_FOURS * STEP_FOURS;
    const SQUARES: u32 = Self::ROW_SQUARES + Self::COLUMN_FOURS * STEP_FOURS;
}

macro_rules! tile {
    ($Tile:ident, $Sums:ident) => {
        #[derive(Clone, Copy)]
        pub(crate) struct $Tile;

        impl Tile for $Tile {
            type Sums = $Sums;
            const FORM: Form = Form::$Tile;
        }
    };
}

tile!(Large, TallSums);
tile!(Small, FourSums);
tile!(Tiny, FourSums);

const fn checked<T: Tile>(fours: u32) -> usize {
    assert!(T::ACROSS * T::DOWN == T::FORM.invocations() && T::SQUARES <= T::FORM.invocations());
    let bytes = 2 * STEP * (T::ROW_STRIDE + T::COLUMN_STRIDE) * size_of::<Vec4>() as u32;
    assert!(bytes as usize <= T::FORM.shared_bytes());
    (2 * STEP * fours) as usize
}

pub(crate) const fn row_fours<T: Tile>() -> usize {
    checked::<T>(T::ROW_STRIDE)
}

pub(crate) const fn column_fours<T: Tile>() -> usize {
    checked::<T>(T::COLUMN_STRIDE)
}

/// The left matrix in a workgroup's memory, `[step][inner][row]`, and the right one, `[step][inner][column]`, in fours.
pub(crate) mod shared {
    use super::*;

    pub(crate) type LargeRows = [Vec4; row_fours::<Large>()];
    pub(crate) type LargeColumns = [Vec4; column_fours::<Large>()];
    pub(crate) type SmallRows = [Vec4; row_fours::<Small>()];
    pub(crate) type SmallColumns = [Vec4; column_fours::<Small>()];
    pub(crate) type TinyRows = [Vec4; row_fours::<Tiny>()];
    pub(crate) type TinyColumns = [Vec4; column_fours::<Tiny>()];
}

/// A tile that goes through the workgroup's memory.
pub(crate) struct InFours<'a, T, const R: usize, const C: usize> {
    pub(crate) tile: PhantomData<T>,
    pub(crate) rows: &'a mut [Vec4; R],
    pub(crate) columns: &'a mut [Vec4; C],
}

/// Four rows or inner indices of four numbers that are on their way.
type Square = [Loaded; 4];

impl<T: Tile, const R: usize, const C: usize> Tiles for InFours<'_, T, R, C> {
    #[inline(always)]
    fn multiply<L: Left>(self, invocation: u32, shape: Shape, left: L, right: impl Right, mut outputs: impl Outputs) {
        let InFours { tile: _, rows, columns } = self;
        let (group, local) = (invocation / T::FORM.invocations(), invocation % T::FORM.invocations());
        let tile = [T::FORM.rows(), T::FORM.columns()];
        let place = InvocationTile::new(group, local, tile, T::ACROSS, shape);
        let (is_row, is_column) = (local < T::ROW_SQUARES, local < T::SQUARES);

        // Neighbours fetch what lies next to one another: numbers of a row, and columns.
        let (row_inner, row_four) = (local % STEP_FOURS * 4, local / STEP_FOURS);
        let square = local.wrapping_sub(T::ROW_SQUARES);
        let (column_inner, column_four) = (square / T::COLUMN_FOURS * 4, square % T::COLUMN_FOURS);
        let row = move |index: u32| left.row((place.first_row + row_four * 4 + index).min(shape.row_count - 1));
        let own_rows = [row(0), row(1), row(2), row(3)];
        let column = (place.first_column + column_four * 4).min(shape.column_count - 4);
        let fetch = move |start: u32, inner_place: L::Inner| -> Square {
            if is_row {
                let [a, b, c, d] = own_rows;
                [
                    left.four(a, inner_place),
                    left.four(b, inner_place),
                    left.four(c, inner_place),
                    left.four(d, inner_place),
                ]
            } else if is_column {
                let inner = start + column_inner;
                let four = move |more: u32| Loaded { numbers: right.four(inner + more, column), is_inside: true };
                [four(0), four(1), four(2), four(3)]
            } else {
                [Loaded::NONE; 4]
            }
        };
        // Beyond the inner index all are 0. That is asked once a step, by all alike.
        let rows_of = move |start: u32, [a, b, c, d]: Square| {
            let finished = move |loaded: Loaded| left.finished(loaded);
            let (a, b, c, d) = (finished(a), finished(b), finished(c), finished(d));
            if start + STEP > shape.inner_count && start + row_inner >= shape.inner_count {
                return [Vec4::ZERO; 4];
            }
            [
                Vec4::new(a.x, b.x, c.x, d.x),
                Vec4::new(a.y, b.y, c.y, d.y),
                Vec4::new(a.z, b.z, c.z, d.z),
                Vec4::new(a.w, b.w, c.w, d.w),
            ]
        };
        let columns_of = move |start: u32, [a, b, c, d]: Square| {
            if start + STEP > shape.inner_count && start + column_inner >= shape.inner_count {
                return [Vec4::ZERO; 4];
            }
            [a.numbers, b.numbers, c.numbers, d.numbers]
        };
        let row_place_of = move |half: u32| (half + row_inner) * T::ROW_STRIDE + row_four;
        let column_place_of = move |half: u32| (half + column_inner) * T::COLUMN_STRIDE + column_four;
        let mut inner_place = left.inner(row_inner);
        let mut next = fetch(0, inner_place);
        if is_row {
            put(rows, row_place_of(0), T::ROW_STRIDE, rows_of(0, next));
        } else if is_column {
            put(columns, column_place_of(0), T::COLUMN_STRIDE, columns_of(0, next));
        }
        wait_for_all();
        let mut sums = T::Sums::ZERO;
        let (mut start, mut half) = (0, 0);
        while start < shape.inner_count {
            let has_next = start + STEP < shape.inner_count;
            if has_next {
                inner_place = left.moved(inner_place, STEP);
                next = fetch(start + STEP, inner_place);
            }
            let row_at = half * T::ROW_STRIDE + place.own_row;
            let column_at = half * T::COLUMN_STRIDE + place.own_column;
            let (lent_rows, lent_columns) = (&*rows, &*columns);
            let mut inner = 0;
            while inner < STEP {
                let (row_at, column_at) = (row_at + inner * T::ROW_STRIDE, column_at + inner * T::COLUMN_STRIDE);
                let row_fours = T::Sums::rows(move |four| read(lent_rows, row_at + four * T::DOWN));
                let column_fours = T::Sums::columns(move |four| read(lent_columns, column_at + four * T::ACROSS));
                sums.add(row_fours, column_fours);
                inner += 1;
            }
            half = STEP - half;
            if has_next {
                if is_row {
                    put(rows, row_place_of(half), T::ROW_STRIDE, rows_of(start + STEP, next));
                } else if is_column {
                    put(columns, column_place_of(half), T::COLUMN_STRIDE, columns_of(start + STEP, next));
                }
            }
            wait_for_all();
            start += STEP;
        }
        let mut index = 0;
        while index < T::Sums::ROWS {
            let row = place.first_row + row_place(T::DOWN, place.own_row, index);
            sums.take_row(|four, sums| {
                let column = place.first_column + (four * T::ACROSS + place.own_column) * 4;
                if row < shape.row_count && column < shape.column_count {
                    outputs.put_four(row, column, sums);
                }
            });
            index += 1;
        }
    }
}

/// Writes four fours, each `stride` behind the one before it.
#[inline(always)]
fn put<const N: usize>(shared: &mut [Vec4; N], at: u32, stride: u32, [a, b, c, d]: [Vec4; 4]) {
    write(shared, at, a);
    write(shared, at + stride, b);
    write(shared, at + 2 * stride, c);
    write(shared, at + 3 * stride, d);
}
