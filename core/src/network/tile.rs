//! A part of a matrix product that stays in registers, for devices that compute products in tiles.
//!
//! A tile is [`TILE`] rows times [`TILE`] columns of the outputs. Its 64 invocations have [`SIDE`] rows times [`SIDE`]
//! columns each: sums of a row of invocations lie `SIDE` apart, so that neighbours read and write neighbouring numbers.
//! Each number that is fetched is then used `SIDE` times.

/// Rows and columns of a tile.
pub const TILE: u32 = 64;

/// Rows and columns of an invocation's sums, and of invocations in a tile.
pub const SIDE: usize = 8;

/// Once for every index below [`SIDE`], which is a constant in each: a device keeps an array in registers only if all its
/// indices are constants.
macro_rules! unrolled {
    ($index:ident => $body:expr) => {
        unrolled!($index => $body; 0 1 2 3 4 5 6 7)
    };
    ($index:ident => $body:expr; $($value:literal)*) => {
        {$({
            const $index: usize = $value;
            $body;
        })*}
    };
}

/// `SIDE` rows times `SIDE` columns of sums.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sums([[f32; SIDE]; SIDE]);

impl Sums {
    /// Each starts with what `value(row, column)` says.
    #[inline(always)]
    pub fn starting_with(value: impl Fn(usize, usize) -> f32) -> Sums {
        let mut sums = [[0.0; SIDE]; SIDE];
        unrolled!(ROW => unrolled!(COLUMN => sums[ROW][COLUMN] = value(ROW, COLUMN)));
        Sums(sums)
    }

    /// Adds `left(row)` times `right(column)` to each.
    #[inline(always)]
    pub fn add(&mut self, left: impl Fn(usize) -> f32, right: impl Fn(usize) -> f32) {
        let mut columns = [0.0; SIDE];
        unrolled!(COLUMN => columns[COLUMN] = right(COLUMN));
        unrolled!(ROW => {
            let value = left(ROW);
            unrolled!(COLUMN => self.0[ROW][COLUMN] += value * columns[COLUMN])
        });
    }

    /// Hands out each as `take(row, column, sum)`.
    #[inline(always)]
    pub fn hand_out(&self, mut take: impl FnMut(usize, usize, f32)) {
        unrolled!(ROW => unrolled!(COLUMN => take(ROW, COLUMN, self.0[ROW][COLUMN])));
    }
}
