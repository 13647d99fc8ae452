//! A matrix product in tiles of several sizes, for matrices that lie in fours: what is loaded and stored are vectors.
//!
//! As the scalar one of [`super`]: two steps in the workgroup's memory, sums in registers, the same order. An
//! invocation fetches a square of 4 by 4 numbers a step, of the left matrix or of the right one or of each, or none. It
//! turns the left one, so that four rows lie next to one another, where it sums as many; otherwise four inner indices do.
//!
//! What a step takes beside its products, above all for numbers to come, is the same in all tiles: small ones, of which
//! a device has too few to do something else meanwhile, have longer steps.

use super::{InvocationTile, read, row_place, wait_for_all, write};
use core::marker::PhantomData;
use spirv_std::glam::Vec4;
use viewfuse_kernels::network::tile::{FourSums, Left, LineSums, Loaded, Outputs, Right, Shape, Sums, TallSums, Tiles};
use viewfuse_kernels::rows::Form;

/// The sizes of a tile.
pub(crate) trait Tile: Copy {
    /// What an invocation sums.
    type Sums: Sums;
    const FORM: Form;
    /// Inner indices of a step.
    const STEP: u32;

    /// Whether fours of rows lie next to one another in the workgroup's memory, not fours of inner indices.
    const IS_TURNED: bool = Self::Sums::ROWS >= 4;
    /// Invocations beside one another, and below.
    const ACROSS: u32 = Self::FORM.columns() / Self::Sums::COLUMNS;
    const DOWN: u32 = Self::FORM.rows() / Self::Sums::ROWS;
    /// Fours of the tile's rows and columns, and of a step.
    const ROW_FOURS: u32 = Self::FORM.rows() / 4;
    const COLUMN_FOURS: u32 = Self::FORM.columns() / 4;
    const STEP_FOURS: u32 = Self::STEP / 4;
    /// Fours from an inner index to the next in the workgroup's memory, or from a row to the next: odd, so that
    /// neighbouring ones lie in different banks.
    const ROW_STRIDE: u32 = if Self::IS_TURNED { Self::ROW_FOURS } else { Self::STEP_FOURS } + 1;
    const COLUMN_STRIDE: u32 = Self::COLUMN_FOURS + 1;
    /// Fours of a step.
    const STEP_OF_ROWS: u32 = if Self::IS_TURNED { Self::STEP } else { Self::FORM.rows() } * Self::ROW_STRIDE;
    const STEP_OF_COLUMNS: u32 = Self::STEP * Self::COLUMN_STRIDE;
    /// Squares of a step.
    const ROW_SQUARES: u32 = Self::ROW_FOURS * Self::STEP_FOURS;
    const SQUARES: u32 = Self::ROW_SQUARES + Self::COLUMN_FOURS * Self::STEP_FOURS;
    /// Whether each invocation fetches a square of both matrices.
    const FETCHES_BOTH: bool = Self::SQUARES > Self::FORM.invocations();
}

macro_rules! tile {
    ($Tile:ident, $Sums:ident, $step:literal) => {
        #[derive(Clone, Copy)]
        pub(crate) struct $Tile;

        impl Tile for $Tile {
            type Sums = $Sums;
            const FORM: Form = Form::$Tile;
            const STEP: u32 = $step;
        }
    };
}

tile!(Large, TallSums, 16);
tile!(Small, FourSums, 16);
tile!(Tiny, FourSums, 32);
tile!(Least, LineSums, 32);

const fn checked<T: Tile>(step: u32) -> usize {
    let invocations = T::FORM.invocations();
    assert!(T::ACROSS * T::DOWN == invocations);
    assert!(!T::FETCHES_BOTH || (T::ROW_SQUARES == invocations && T::SQUARES == 2 * invocations));
    let bytes = 2 * (T::STEP_OF_ROWS + T::STEP_OF_COLUMNS) * size_of::<Vec4>() as u32;
    assert!(bytes as usize <= T::FORM.shared_bytes());
    (2 * step) as usize
}

pub(crate) const fn row_fours<T: Tile>() -> usize {
    checked::<T>(T::STEP_OF_ROWS)
}

pub(crate) const fn column_fours<T: Tile>() -> usize {
    checked::<T>(T::STEP_OF_COLUMNS)
}

/// The left matrix in a workgroup's memory, `[step][inner][row]` in fours of rows or `[step][row][inner]` in fours of
/// inner indices, and the right one, `[step][inner][column]` in fours of columns.
pub(crate) mod shared {
    use super::*;

    pub(crate) type LargeRows = [Vec4; row_fours::<Large>()];
    pub(crate) type LargeColumns = [Vec4; column_fours::<Large>()];
    pub(crate) type SmallRows = [Vec4; row_fours::<Small>()];
    pub(crate) type SmallColumns = [Vec4; column_fours::<Small>()];
    pub(crate) type TinyRows = [Vec4; row_fours::<Tiny>()];
    pub(crate) type TinyColumns = [Vec4; column_fours::<Tiny>()];
    pub(crate) type LeastRows = [Vec4; row_fours::<Least>()];
    pub(crate) type LeastColumns = [Vec4; column_fours::<Least>()];
}

/// A tile that goes through the workgroup's memory.
pub(crate) struct InFours<'a, T, const R: usize, const C: usize> {
    pub(crate) tile: PhantomData<T>,
    pub(crate) rows: &'a mut [Vec4; R],
    pub(crate) columns: &'a mut [Vec4; C],
}

/// Four rows or inner indices of four numbers that are on their way.
type Square = [Loaded; 4];
const NOTHING: Square = [Loaded::NONE; 4];

impl<T: Tile, const R: usize, const C: usize> Tiles for InFours<'_, T, R, C> {
    #[inline(always)]
    fn multiply<L: Left>(self, invocation: u32, shape: Shape, left: L, right: impl Right, mut outputs: impl Outputs) {
        let InFours { tile: _, rows, columns } = self;
        let (group, local) = (invocation / T::FORM.invocations(), invocation % T::FORM.invocations());
        let tile = [T::FORM.rows(), T::FORM.columns()];
        let place = InvocationTile::new(group, local, tile, T::ACROSS, shape);
        let (is_row, is_column) = (local < T::ROW_SQUARES, local < T::SQUARES);

        // Neighbours fetch what lies next to one another: numbers of a row, and columns.
        let (row_inner, row_four) = (local % T::STEP_FOURS * 4, local / T::STEP_FOURS);
        let square = if T::FETCHES_BOTH { local } else { local.wrapping_sub(T::ROW_SQUARES) };
        let (column_inner, column_four) = (square / T::COLUMN_FOURS * 4, square % T::COLUMN_FOURS);
        let row = move |index: u32| left.row((place.first_row + row_four * 4 + index).min(shape.row_count - 1));
        let own_rows = [row(0), row(1), row(2), row(3)];
        let column = (place.first_column + column_four * 4).min(shape.column_count - 4);
        let fetch_rows = move |inner_place: L::Inner| -> Square {
            let [a, b, c, d] = own_rows;
            [left.four(a, inner_place), left.four(b, inner_place), left.four(c, inner_place), left.four(d, inner_place)]
        };
        let fetch_columns = move |start: u32| -> Square {
            let inner = start + column_inner;
            let four = move |more: u32| Loaded { numbers: right.four(inner + more, column), is_inside: true };
            [four(0), four(1), four(2), four(3)]
        };
        let fetch = move |start: u32, inner_place: L::Inner| -> Square {
            if T::FETCHES_BOTH || is_row {
                fetch_rows(inner_place)
            } else if is_column {
                fetch_columns(start)
            } else {
                NOTHING
            }
        };
        // Beyond the inner index all are 0. That is asked once a step, by all alike.
        let rows_of = move |start: u32, [a, b, c, d]: Square| {
            let finished = move |loaded: Loaded| left.finished(loaded);
            let (a, b, c, d) = (finished(a), finished(b), finished(c), finished(d));
            if start + T::STEP > shape.inner_count && start + row_inner >= shape.inner_count {
                return [Vec4::ZERO; 4];
            }
            if !T::IS_TURNED {
                return [a, b, c, d];
            }
            [
                Vec4::new(a.x, b.x, c.x, d.x),
                Vec4::new(a.y, b.y, c.y, d.y),
                Vec4::new(a.z, b.z, c.z, d.z),
                Vec4::new(a.w, b.w, c.w, d.w),
            ]
        };
        let columns_of = move |start: u32, [a, b, c, d]: Square| {
            if start + T::STEP > shape.inner_count && start + column_inner >= shape.inner_count {
                return [Vec4::ZERO; 4];
            }
            [a.numbers, b.numbers, c.numbers, d.numbers]
        };
        let row_square = match T::IS_TURNED {
            true => row_inner * T::ROW_STRIDE + row_four,
            false => row_four * 4 * T::ROW_STRIDE + row_inner / 4,
        };
        let column_square = column_inner * T::COLUMN_STRIDE + column_four;
        let row_place_of = move |half: u32| half * T::STEP_OF_ROWS + row_square;
        let column_place_of = move |half: u32| half * T::STEP_OF_COLUMNS + column_square;
        let mut inner_place = left.inner(row_inner);
        // The second one is of the right matrix, where an invocation fetches of both.
        let (mut next, mut beside) = (fetch(0, inner_place), NOTHING);
        if T::FETCHES_BOTH {
            beside = fetch_columns(0);
            put(rows, row_place_of(0), T::ROW_STRIDE, rows_of(0, next));
            put(columns, column_place_of(0), T::COLUMN_STRIDE, columns_of(0, beside));
        } else if is_row {
            put(rows, row_place_of(0), T::ROW_STRIDE, rows_of(0, next));
        } else if is_column {
            put(columns, column_place_of(0), T::COLUMN_STRIDE, columns_of(0, next));
        }
        wait_for_all();
        let mut sums = T::Sums::ZERO;
        let (mut start, mut half) = (0, 0);
        while start < shape.inner_count {
            let has_next = start + T::STEP < shape.inner_count;
            if has_next {
                inner_place = left.moved(inner_place, T::STEP);
                next = fetch(start + T::STEP, inner_place);
                if T::FETCHES_BOTH {
                    beside = fetch_columns(start + T::STEP);
                }
            }
            let row_at = half * T::STEP_OF_ROWS + place.own_row * if T::IS_TURNED { 1 } else { T::ROW_STRIDE };
            let column_at = half * T::STEP_OF_COLUMNS + place.own_column;
            let (lent_rows, lent_columns) = (&*rows, &*columns);
            if T::IS_TURNED {
                let mut inner = 0;
                while inner < T::STEP {
                    let (row_at, column_at) = (row_at + inner * T::ROW_STRIDE, column_at + inner * T::COLUMN_STRIDE);
                    let row_fours = T::Sums::rows(move |four| read(lent_rows, row_at + four * T::DOWN));
                    let column_fours = T::Sums::columns(move |four| read(lent_columns, column_at + four * T::ACROSS));
                    sums.add(row_fours, column_fours);
                    inner += 1;
                }
            } else {
                let mut four = 0;
                while four < T::STEP_FOURS {
                    let numbers = read(lent_rows, row_at + four);
                    let column_at = column_at + four * 4 * T::COLUMN_STRIDE;
                    let columns_at = move |more: u32| {
                        T::Sums::columns(move |_| read(lent_columns, column_at + more * T::COLUMN_STRIDE))
                    };
                    sums.add(T::Sums::rows(move |_| Vec4::splat(numbers.x)), columns_at(0));
                    sums.add(T::Sums::rows(move |_| Vec4::splat(numbers.y)), columns_at(1));
                    sums.add(T::Sums::rows(move |_| Vec4::splat(numbers.z)), columns_at(2));
                    sums.add(T::Sums::rows(move |_| Vec4::splat(numbers.w)), columns_at(3));
                    four += 1;
                }
            }
            half = 1 - half;
            if has_next {
                let following = start + T::STEP;
                if T::FETCHES_BOTH {
                    put(rows, row_place_of(half), T::ROW_STRIDE, rows_of(following, next));
                    put(columns, column_place_of(half), T::COLUMN_STRIDE, columns_of(following, beside));
                } else if is_row {
                    put(rows, row_place_of(half), T::ROW_STRIDE, rows_of(following, next));
                } else if is_column {
                    put(columns, column_place_of(half), T::COLUMN_STRIDE, columns_of(following, next));
                }
            }
            wait_for_all();
            start += T::STEP;
        }
        let mut index = 0;
        while index < T::Sums::ROWS {
            let own_row = if T::IS_TURNED { row_place(T::DOWN, place.own_row, index) } else { place.own_row };
            let row = place.first_row + own_row;
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
