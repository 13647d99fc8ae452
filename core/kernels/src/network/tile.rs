//! A part of a matrix product that stays in registers, for devices that compute products in tiles.
//!
//! A tile is [`TILE`] rows times [`TILE`] columns of the outputs. It has 8 rows of 8 invocations, and each invocation
//! has 8 rows and 8 columns of sums. Both come in fours that lie next to one another ([`Sums::place`]): four numbers
//! are fetched together, neighbouring invocations fetch neighbouring fours, and each number is used eight times.

use glam::Vec4;

/// Rows and columns of a tile.
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

/// How a device computes the tiles of a matrix product together.
pub trait Tiles {
    /// Computes an invocation's part of the matrix product of `left(row, inner)` and `right(inner, column)`, and calls
    /// `store(row, column, sum)`. All invocations of a workgroup take part, with outputs or without: beyond the
    /// matrices, the last row or column is read and the sum is not stored.
    fn multiply(
        self,
        invocation: u32,
        shape: Shape,
        left: impl Fn(u32, u32) -> f32 + Copy,
        right: impl Fn(u32, u32) -> f32 + Copy,
        store: impl FnMut(u32, u32, f32),
    );
}

/// Eight times eight sums, `[row][four of columns]`. Only constants are indices here: a device keeps an array in
/// registers only then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sums([[Vec4; 2]; 8]);

impl Sums {
    /// Nothing added yet.
    pub const ZERO: Sums = Sums([[Vec4::ZERO; 2]; 8]);
    /// How many rows and columns there are.
    pub const SIDE: u32 = 8;

    /// Where in a tile row (or column) number `index` of the invocation lies that is number `own` in that direction.
    #[inline(always)]
    pub fn place(line: u32, index: u32) -> u32 {
        index / 4 * (TILE / 2) + line * 4 + index % 4
    }

    /// Adds the products of each row's number and each column's.
    #[inline(always)]
    pub fn add(&mut self, rows: [Vec4; 2], columns: [Vec4; 2]) {
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
    fn add_row<const ROW: usize>(&mut self, row: f32, columns: [Vec4; 2]) {
        self.0[ROW][0] += columns[0] * row;
        self.0[ROW][1] += columns[1] * row;
    }

    /// The sums of the first row; all others move up, and the last one is 0.
    #[inline(always)]
    pub fn take_row(&mut self) -> [Vec4; 2] {
        let [first, a, b, c, d, e, f, g] = self.0;
        self.0 = [a, b, c, d, e, f, g, [Vec4::ZERO; 2]];
        first
    }
}
