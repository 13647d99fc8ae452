//! A part of a matrix product that stays in registers, for devices that compute products in tiles.
//!
//! A tile is a square of the outputs. An invocation has a square of its sums: as many rows as columns, in fours. Fours
//! of neighbouring invocations lie next to one another, and each number that is fetched is used as often as the square
//! has rows.

use super::linear::{rectified, rectified_four};
use glam::Vec4;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::half_precision::f16_bits_or_nan;

/// Rows and columns of the tile that elements are counted in.
pub const TILE: u32 = 64;

/// The sizes of a matrix product.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Rows of the left matrix and of the outputs.
    pub row_count: u32,
    /// Columns of the left matrix, rows of the right one.
    pub inner_count: u32,
    /// Columns of the right matrix and of the outputs.
    pub column_count: u32,
}

/// Numbers that are read one by one, or four next to one another.
pub trait Fours: Fetch<f32> + Copy {
    /// Numbers `index` to `index + 3`; `index` is a multiple of four.
    #[inline(always)]
    fn four(&self, index: u32) -> Vec4 {
        let number = |more: u32| self.fetch((index + more) as usize);
        Vec4::new(number(0), number(1), number(2), number(3))
    }

    /// The same in half precision, two in a word, NaN for what is too large.
    #[inline(always)]
    fn four_halves(&self, index: u32) -> [u32; 2] {
        halves_of(self.four(index))
    }
}

#[inline(always)]
fn halves_of(four: Vec4) -> [u32; 2] {
    let pair = |lower: f32, upper: f32| f16_bits_or_nan(lower) | f16_bits_or_nan(upper) << 16;
    [pair(four.x, four.y), pair(four.z, four.w)]
}

/// The left matrix of a product. What many numbers have in common may take divisions: a device computes it once.
pub trait Left: Copy {
    /// What a row's numbers have in common.
    type Row: Copy;
    /// What the numbers of an inner index have in common.
    type Inner: Copy;

    /// That of a row.
    fn row(self, row: u32) -> Self::Row;

    /// That of an inner index.
    fn inner(self, inner: u32) -> Self::Inner;

    /// That of the inner index that lies `by` behind the one of `place`.
    fn moved(self, place: Self::Inner, by: u32) -> Self::Inner;

    /// The number there. A device may ask for inner indices beyond the matrix, and does not use what it gets.
    fn number(self, row: Self::Row, inner: Self::Inner) -> f32;

    /// Loads the numbers of four inner indices from that one on, a multiple of four, of a matrix that lies in fours.
    /// Nothing waits for what is loaded until it is [finished](Left::finished).
    fn four(self, row: Self::Row, inner: Self::Inner) -> Loaded;

    /// The numbers that were loaded.
    fn finished(self, loaded: Loaded) -> Vec4;
}

/// Four numbers of a matrix that are on their way.
#[derive(Clone, Copy, Debug)]
pub struct Loaded {
    /// What was loaded.
    pub numbers: Vec4,
    /// Whether they are the matrix's; otherwise they count as 0.
    pub is_inside: bool,
}

impl Loaded {
    /// Nothing.
    pub const NONE: Loaded = Loaded { numbers: Vec4::ZERO, is_inside: false };

    /// The numbers, or 0.
    #[inline(always)]
    pub fn or_zero(self) -> Vec4 {
        if self.is_inside { self.numbers } else { Vec4::ZERO }
    }
}

/// The right matrix of a product.
pub trait Right: Copy {
    /// The number there.
    fn number(self, inner: u32, column: u32) -> f32;

    /// The numbers of four columns from that one on, a multiple of four, in a matrix that lies in fours.
    fn four(self, inner: u32, column: u32) -> Vec4 {
        let number = |more: u32| self.number(inner, column + more);
        Vec4::new(number(0), number(1), number(2), number(3))
    }

    /// The same in half precision, two in a word, NaN for what is too large.
    #[inline(always)]
    fn four_halves(self, inner: u32, column: u32) -> [u32; 2] {
        halves_of(self.four(inner, column))
    }
}

/// What becomes of a product's sums.
pub trait Outputs {
    /// Takes the sum of an output.
    fn put(&mut self, row: u32, column: u32, sum: f32);

    /// Takes the sums of four columns from that one on, a multiple of four, where outputs lie in fours.
    fn put_four(&mut self, row: u32, column: u32, sums: Vec4) {
        self.put(row, column, sums.x);
        self.put(row, column + 1, sums.y);
        self.put(row, column + 2, sums.z);
        self.put(row, column + 3, sums.w);
    }
}

/// The right matrix whose rows lie one behind the other.
#[derive(Clone, Copy, Debug)]
pub struct Weights<A> {
    /// The numbers, `[inner][column]`.
    pub numbers: A,
    /// Columns of the matrix.
    pub column_count: u32,
}

impl<A: Fours> Right for Weights<A> {
    #[inline(always)]
    fn number(self, inner: u32, column: u32) -> f32 {
        self.numbers.fetch((inner * self.column_count + column) as usize)
    }

    #[inline(always)]
    fn four(self, inner: u32, column: u32) -> Vec4 {
        self.numbers.four(inner * self.column_count + column)
    }

    #[inline(always)]
    fn four_halves(self, inner: u32, column: u32) -> [u32; 2] {
        self.numbers.four_halves(inner * self.column_count + column)
    }
}

/// A matrix whose rows are some numbers that lie next to one another.
#[derive(Clone, Copy, Debug)]
pub struct Matrix<A> {
    /// Where the numbers are.
    pub numbers: A,
    /// Where the first row starts.
    pub first: u32,
    /// Numbers from a row to the next.
    pub pitch: u32,
    /// Negative numbers count as 0 if this is not 0.
    pub relu: u32,
}

impl<A: Fours> Left for Matrix<A> {
    type Row = u32;
    type Inner = u32;

    #[inline(always)]
    fn row(self, row: u32) -> u32 {
        self.first + row * self.pitch
    }

    #[inline(always)]
    fn inner(self, inner: u32) -> u32 {
        inner
    }

    #[inline(always)]
    fn moved(self, inner: u32, by: u32) -> u32 {
        inner + by
    }

    #[inline(always)]
    fn number(self, first: u32, inner: u32) -> f32 {
        rectified(self.numbers.fetch((first + inner) as usize), self.relu)
    }

    #[inline(always)]
    fn four(self, first: u32, inner: u32) -> Loaded {
        Loaded { numbers: self.numbers.four(first + inner), is_inside: true }
    }

    #[inline(always)]
    fn finished(self, loaded: Loaded) -> Vec4 {
        rectified_four(loaded.or_zero(), self.relu)
    }
}

/// How a device computes the tiles of a matrix product together.
pub trait Tiles {
    /// Computes an invocation's part of the matrix product of `left` and `right`. All invocations of a workgroup take
    /// part, with outputs or without: beyond the matrices, the last row or column is read and the sum is not stored.
    fn multiply<L: Left>(self, invocation: u32, shape: Shape, left: L, right: impl Right, outputs: impl Outputs);
}

/// The sums of an invocation, `[row][four of columns]`. Only constants are indices here: a device keeps an array in
/// registers only then.
pub trait Sums: Copy {
    /// How many rows there are.
    const ROWS: u32;
    /// How many columns there are.
    const COLUMNS: u32;
    /// Nothing added yet.
    const ZERO: Self;
    /// As many numbers as there are rows.
    type OfRows: Copy;
    /// As many numbers as there are columns.
    type OfColumns: Copy;

    /// The fours of rows that a function gives for their numbers.
    fn rows(four: impl Fn(u32) -> Vec4) -> Self::OfRows;

    /// The fours of columns that a function gives for their numbers.
    fn columns(four: impl Fn(u32) -> Vec4) -> Self::OfColumns;

    /// Adds the products of each row's number and each column's.
    fn add(&mut self, rows: Self::OfRows, columns: Self::OfColumns);

    /// Calls a function with the number of each four of the first row and its sums; all other rows move up, and the
    /// last one is 0.
    fn take_row(&mut self, each: impl FnMut(u32, Vec4));
}

/// Eight times eight sums.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EightSums([[Vec4; 2]; 8]);

impl Sums for EightSums {
    const ROWS: u32 = 8;
    const COLUMNS: u32 = 8;
    const ZERO: EightSums = EightSums([[Vec4::ZERO; 2]; 8]);
    type OfRows = [Vec4; 2];
    type OfColumns = [Vec4; 2];

    #[inline(always)]
    fn rows(four: impl Fn(u32) -> Vec4) -> [Vec4; 2] {
        [four(0), four(1)]
    }

    #[inline(always)]
    fn columns(four: impl Fn(u32) -> Vec4) -> [Vec4; 2] {
        [four(0), four(1)]
    }

    #[inline(always)]
    fn add(&mut self, rows: [Vec4; 2], columns: [Vec4; 2]) {
        self.add_row::<0>(rows[0].x, columns);
        self.add_row::<1>(rows[0].y, columns);
        self.add_row::<2>(rows[0].z, columns);
        self.add_row::<3>(rows[0].w, columns);
        self.add_row::<4>(rows[1].x, columns);
        self.add_row::<5>(rows[1].y, columns);
        self.add_row::<6>(rows[1].z, columns);
        self.add_row::<7>(rows[1].w, columns);
    }

    #[inline(always)]
    fn take_row(&mut self, mut each: impl FnMut(u32, Vec4)) {
        let [[near, far], a, b, c, d, e, f, g] = self.0;
        self.0 = [a, b, c, d, e, f, g, [Vec4::ZERO; 2]];
        each(0, near);
        each(1, far);
    }
}

impl EightSums {
    #[inline(always)]
    fn add_row<const ROW: usize>(&mut self, row: f32, columns: [Vec4; 2]) {
        self.0[ROW][0] += columns[0] * row;
        self.0[ROW][1] += columns[1] * row;
    }
}

/// Eight rows of four sums.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TallSums([Vec4; 8]);

impl Sums for TallSums {
    const ROWS: u32 = 8;
    const COLUMNS: u32 = 4;
    const ZERO: TallSums = TallSums([Vec4::ZERO; 8]);
    type OfRows = [Vec4; 2];
    type OfColumns = Vec4;

    #[inline(always)]
    fn rows(four: impl Fn(u32) -> Vec4) -> [Vec4; 2] {
        [four(0), four(1)]
    }

    #[inline(always)]
    fn columns(four: impl Fn(u32) -> Vec4) -> Vec4 {
        four(0)
    }

    #[inline(always)]
    fn add(&mut self, rows: [Vec4; 2], columns: Vec4) {
        self.0[0] += columns * rows[0].x;
        self.0[1] += columns * rows[0].y;
        self.0[2] += columns * rows[0].z;
        self.0[3] += columns * rows[0].w;
        self.0[4] += columns * rows[1].x;
        self.0[5] += columns * rows[1].y;
        self.0[6] += columns * rows[1].z;
        self.0[7] += columns * rows[1].w;
    }

    #[inline(always)]
    fn take_row(&mut self, mut each: impl FnMut(u32, Vec4)) {
        let [first, a, b, c, d, e, f, g] = self.0;
        self.0 = [a, b, c, d, e, f, g, Vec4::ZERO];
        each(0, first);
    }
}

/// Four times four sums.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FourSums([Vec4; 4]);

impl Sums for FourSums {
    const ROWS: u32 = 4;
    const COLUMNS: u32 = 4;
    const ZERO: FourSums = FourSums([Vec4::ZERO; 4]);
    type OfRows = Vec4;
    type OfColumns = Vec4;

    #[inline(always)]
    fn rows(four: impl Fn(u32) -> Vec4) -> Vec4 {
        four(0)
    }

    #[inline(always)]
    fn columns(four: impl Fn(u32) -> Vec4) -> Vec4 {
        four(0)
    }

    #[inline(always)]
    fn add(&mut self, rows: Vec4, columns: Vec4) {
        self.0[0] += columns * rows.x;
        self.0[1] += columns * rows.y;
        self.0[2] += columns * rows.z;
        self.0[3] += columns * rows.w;
    }

    #[inline(always)]
    fn take_row(&mut self, mut each: impl FnMut(u32, Vec4)) {
        let [first, a, b, c] = self.0;
        self.0 = [a, b, c, Vec4::ZERO];
        each(0, first);
    }
}

/// Four sums of a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineSums(Vec4);

impl Sums for LineSums {
    const ROWS: u32 = 1;
    const COLUMNS: u32 = 4;
    const ZERO: LineSums = LineSums(Vec4::ZERO);
    /// The first of the four counts.
    type OfRows = f32;
    type OfColumns = Vec4;

    #[inline(always)]
    fn rows(four: impl Fn(u32) -> Vec4) -> f32 {
        four(0).x
    }

    #[inline(always)]
    fn columns(four: impl Fn(u32) -> Vec4) -> Vec4 {
        four(0)
    }

    #[inline(always)]
    fn add(&mut self, row: f32, columns: Vec4) {
        self.0 += columns * row;
    }

    #[inline(always)]
    fn take_row(&mut self, mut each: impl FnMut(u32, Vec4)) {
        let first = self.0;
        self.0 = Vec4::ZERO;
        each(0, first);
    }
}
