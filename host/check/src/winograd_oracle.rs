//! The error bound of a convolution by Winograd's algorithm, F(4x4, 3x3), against the sum of its products.
//!
//! Of `A^T ((G g G^T) * (B^T d B)) A`, summed over the channels, each number is a sum of products of entries of the
//! five matrices, of inputs and of weights. Each product is rounded at most as often as there are operations on its
//! way, so that the error is at most that many roundings of the same expression with everything replaced by its
//! magnitude: `|A^T| ((|G| |g| |G^T|) * (|B^T| |d| |B|)) |A|`. Multiplications by 2, 4 and 8 are exact; counted are one
//! rounding of the transformed weights, 3 in each direction of the inputs' transform, as many as channels and one more
//! in the sum over them, 3 in each direction of the outputs' transform.

use super::bounded::roundings;

/// Outputs of a tile in each direction. Tiles begin at the first output.
pub const SIDE: usize = 4;
/// Inputs of a tile in each direction.
const REACH: usize = 6;
/// Roundings beside those of the sum over the channels.
const STEPS: usize = 1 + 2 * 3 + 1 + 2 * 3;

/// `|B^T|`.
const INPUTS: [[f64; REACH]; REACH] = [
    [4.0, 0.0, 5.0, 0.0, 1.0, 0.0],
    [0.0, 4.0, 4.0, 1.0, 1.0, 0.0],
    [0.0, 4.0, 4.0, 1.0, 1.0, 0.0],
    [0.0, 2.0, 1.0, 2.0, 1.0, 0.0],
    [0.0, 2.0, 1.0, 2.0, 1.0, 0.0],
    [0.0, 4.0, 0.0, 5.0, 0.0, 1.0],
];

/// `|G|`.
const WEIGHTS: [[f64; 3]; REACH] = [
    [1.0 / 4.0, 0.0, 0.0],
    [1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 24.0, 1.0 / 12.0, 1.0 / 6.0],
    [1.0 / 24.0, 1.0 / 12.0, 1.0 / 6.0],
    [0.0, 0.0, 1.0],
];

/// `|A^T|`.
const OUTPUTS: [[f64; REACH]; SIDE] = [
    [1.0, 1.0, 1.0, 1.0, 1.0, 0.0],
    [0.0, 1.0, 1.0, 2.0, 2.0, 0.0],
    [0.0, 1.0, 1.0, 4.0, 4.0, 0.0],
    [0.0, 1.0, 1.0, 8.0, 8.0, 1.0],
];

/// An output number of a tile, with the inputs and weights that it depends on.
pub struct Tile<I, W> {
    /// Row and column in the tile.
    pub place: [usize; 2],
    /// Input channels.
    pub channels: usize,
    /// The input at a row and column of the tile, and a channel.
    pub input: I,
    /// The weight at a row and column of the window, and an input channel.
    pub weight: W,
}

impl<I: Fn([usize; 2], usize) -> f64, W: Fn([usize; 2], usize) -> f64> Tile<I, W> {
    /// The bound on the output's error, without that of bias and residual.
    pub fn error(&self) -> f64 {
        let mut magnitudes = 0.0;
        for channel in 0..self.channels {
            let inputs = spread(&INPUTS, |row, column| (self.input)([row, column], channel).abs());
            let weights = spread(&WEIGHTS, |row, column| (self.weight)([row, column], channel).abs());
            for row in 0..REACH {
                for column in 0..REACH {
                    let output = OUTPUTS[self.place[0]][row] * OUTPUTS[self.place[1]][column];
                    magnitudes += output * inputs[row][column] * weights[row][column];
                }
            }
        }
        let largest: f64 = OUTPUTS[3].iter().sum();
        let flushed = (self.channels * REACH * REACH) as f64 * largest * largest * f64::from(f32::MIN_POSITIVE);
        magnitudes * roundings(self.channels + STEPS) + flushed
    }
}

/// `matrix values matrix^T`.
fn spread<const N: usize>(matrix: &[[f64; N]; REACH], values: impl Fn(usize, usize) -> f64) -> [[f64; REACH]; REACH] {
    let mut along = [[0.0; REACH]; N];
    for (inner, along) in along.iter_mut().enumerate() {
        for (column, along) in along.iter_mut().enumerate() {
            *along = (0..N).map(|place| values(inner, place) * matrix[column][place]).sum();
        }
    }
    std::array::from_fn(|row| {
        std::array::from_fn(|column| (0..N).map(|inner| matrix[row][inner] * along[inner][column]).sum())
    })
}
