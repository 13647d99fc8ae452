//! A part of a matrix product that stays in registers, for devices that compute products in tiles.
//!
//! A tile is [`TILE`] rows times [`TILE`] columns of the outputs. Each of its 64 invocations has 8 rows times 8 columns of
//! them, in fours: rows `4 own_row + 32 i + (0..4)` and columns `4 own_column + 32 j + (0..4)` with `own_row` and
//! `own_column` below 8 and `i` and `j` below 2. Four numbers are fetched together, neighbouring invocations fetch
//! neighbouring ones, and each is used eight times.

use glam::Vec4;

/// Rows and columns of a tile.
pub const TILE: u32 = 64;

/// Eight times eight sums. All indices are constants: a device keeps an array in registers only then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sums([[Vec4; 2]; 8]);

impl Sums {
    /// Where the first one of an invocation's fours number `index` lies in the tile, in rows or columns: `own` is which
    /// invocation it is in that direction.
    #[inline(always)]
    pub fn place(own: u32, index: u32) -> u32 {
        4 * own + 32 * index
    }

    /// Each starts with 0.
    pub const ZERO: Sums = Sums([[Vec4::ZERO; 2]; 8]);

    /// Adds the products of eight rows' and eight columns' numbers.
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

    /// Hands out each as `take(row, column, sum)`: where it lies in the tile, and the sum.
    #[inline(always)]
    pub fn hand_out(&self, own_row: u32, own_column: u32, mut take: impl FnMut(u32, u32, f32)) {
        let (upper, lower) = (Sums::place(own_row, 0), Sums::place(own_row, 1));
        let columns = [Sums::place(own_column, 0), Sums::place(own_column, 1)];
        hand_out_row(&self.0[0], upper, columns, &mut take);
        hand_out_row(&self.0[1], upper + 1, columns, &mut take);
        hand_out_row(&self.0[2], upper + 2, columns, &mut take);
        hand_out_row(&self.0[3], upper + 3, columns, &mut take);
        hand_out_row(&self.0[4], lower, columns, &mut take);
        hand_out_row(&self.0[5], lower + 1, columns, &mut take);
        hand_out_row(&self.0[6], lower + 2, columns, &mut take);
        hand_out_row(&self.0[7], lower + 3, columns, &mut take);
    }
}

#[inline(always)]
fn hand_out_row(sums: &[Vec4; 2], row: u32, columns: [u32; 2], take: &mut impl FnMut(u32, u32, f32)) {
    take(row, columns[0], sums[0].x);
    take(row, columns[0] + 1, sums[0].y);
    take(row, columns[0] + 2, sums[0].z);
    take(row, columns[0] + 3, sums[0].w);
    take(row, columns[1], sums[1].x);
    take(row, columns[1] + 1, sums[1].y);
    take(row, columns[1] + 2, sums[1].z);
    take(row, columns[1] + 3, sums[1].w);
}
