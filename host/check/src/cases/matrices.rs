//! [`Kernel::MatrixProduct`] and [`Kernel::SoftmaxRows`]: matrices of awkward sizes, some of them columns of one wider
//! matrix, on the right as they are or transposed; rows of scores from nearly equal weights to a single weight of 1.

use super::*;
use crate::matrix_oracle;

impl Case for MatrixProduct {
    const SEED_COUNT: u64 = 8;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "n units (2^-24) of the sum of magnitudes of n products, in whatever order they are \
        summed, and one more product";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("left", |case| increase(&mut case.left)),
        ("right", |case| increase(&mut case.right)),
        ("parameters", |case| case.block.scale *= 1.01),
    ];

    /// Of some the right matrix is empty: it is in the left one's buffer.
    fn inputs(seed: u64, size: u32) -> Vec<MatrixProduct> {
        let random = &mut random(27, seed, size);
        let awkward = 1 + random.below(100) as u32;
        let shapes = [
            [1, 1, 1],
            [size, awkward, 1 + awkward / 3],
            [65, 3, 7],
            [63, 600, 65],
            [64, 64, 64],
            [size.div_ceil(5), 17, 129],
            [3, 130, 70],
            [7, size, 5],
        ];
        let dispatch = |(index, [row_count, inner_count, column_count]): (usize, [u32; 3])| {
            let flags = index as u64 + seed;
            let (is_transposed, is_one_buffer) = (flags & 1 == 1, flags >> 1 & 1 == 1);
            let left_gap = random.below(3) as u32;
            let [right_rows, right_columns] =
                if is_transposed { [column_count, inner_count] } else { [inner_count, column_count] };
            let right_gap = random.below(3) as u32;
            // In one buffer they lie side by side.
            let (left_pitch, right_pitch, right_first) = if is_one_buffer {
                let pitch = left_gap + inner_count + right_columns + right_gap;
                (pitch, pitch, left_gap + inner_count)
            } else {
                (left_gap + inner_count, right_gap + right_columns, right_gap)
            };
            let block = MatrixBlock {
                row_count,
                inner_count,
                column_count,
                left_pitch,
                left_first: left_gap,
                right_row_pitch: if is_transposed { 1 } else { right_pitch },
                right_column_pitch: if is_transposed { right_pitch } else { 1 },
                right_first,
                scale: (1.0 / f64::from(inner_count).sqrt()) as f32,
            };
            let left_len = left_gap + row_count * left_pitch;
            let right_len = right_first + right_rows * right_pitch;
            let mut matrix = |count: u32| numbers(count as usize, || random.normal());
            let (left, right) = match is_one_buffer {
                true => (matrix(left_len.max(right_len)), Vec::new()),
                false => (matrix(left_len), matrix(right_len)),
            };
            let outputs = Output::Zeros((row_count * column_count) as usize + 1);
            MatrixProduct { block, left, right, outputs }
        };
        shapes.into_iter().enumerate().map(dispatch).collect()
    }

    fn run_one<D: Device>(
        &self,
        device: &D,
        (left, right, outputs): &mut Self::Loaded<D>,
        index: usize,
    ) -> Result<(), DeviceError> {
        let right = if self.right.is_empty() { &left[index] } else { &right[index] };
        device.matrix_product(&self.block, &left[index], right, current(&mut outputs[..=index]))
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let MatrixProduct { block, left, right, .. } = self;
        let columns = block.column_count as usize;
        let right = if right.is_empty() { left } else { right };
        let output = |index| matrix_oracle::product(left, right, block, index / columns, index % columns);
        decided(map(block.row_count as usize * columns, 16, output), 1)
    }
}

impl Case for SoftmaxRows {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-5, least: 1.0e-30 };
    const REASON: &'static str = "a difference from the largest score, of up to some 10^2, is an error of the \
        exponent; two exponentials, n units (2^-24) of their sum, a division and a product";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[("scores", |case| increase(&mut case.scores))];

    fn inputs(seed: u64, size: u32) -> Vec<SoftmaxRows> {
        let random = &mut random(28, seed, size);
        let dispatch = |(column_count, deviation): (u32, f64)| {
            let count = size.div_ceil(column_count) * column_count;
            let offset = deviation * random.normal();
            // Some take no part.
            let score = |random: &mut Random| match random.below(16) {
                0 => -1.0e30,
                _ => offset + deviation * random.normal(),
            };
            let mut scores = numbers(count as usize, || score(random));
            // All of a row the same.
            scores[..column_count as usize].fill(offset as f32);
            let weights = Output::Zeros(scores.len() + 1);
            SoftmaxRows { column_count, row_count: count / column_count, scores, weights }
        };
        [(1, 1.0), (7, 0.1), (64, 1.0), (65, 30.0), (400, 3.0)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let columns = self.column_count as usize;
        let row = |row: usize| matrix_oracle::softmax(&self.scores[row * columns..][..columns]);
        decided(map(self.row_count as usize, 1, row).into_iter().flatten(), 1)
    }
}
