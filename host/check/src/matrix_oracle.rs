//! Matrix products of two computed matrices, and softmax, in `f64` with bounds on the error of `f32`.

use super::bounded::Bounded;
use viewfuse_kernels::network::attend::MatrixBlock;

/// Number `[row, column]` of a product, summed in any order and scaled.
pub fn product(left: &[f32], right: &[f32], block: &MatrixBlock, row: usize, column: usize) -> Bounded {
    let left = &left[block.left_first as usize + row * block.left_pitch as usize..];
    let right = &right[block.right_first as usize + column * block.right_column_pitch as usize..];
    let right = right.iter().step_by(block.right_row_pitch as usize);
    let products = left.iter().zip(right).take(block.inner_count as usize);
    let sum = Bounded::sum(products.map(|(left, right)| f64::from(*left) * f64::from(*right)));
    sum * Bounded::from(block.scale)
}

/// A row's weights: exponentials of differences from the largest, divided by their sum in any order.
pub fn softmax(scores: &[f32]) -> Vec<Bounded> {
    let largest = scores.iter().fold(f32::MIN, |largest, score| largest.max(*score));
    let exponential = |score: &f32| (Bounded::from(*score) - Bounded::from(largest)).exp();
    let exponentials: Vec<Bounded> = scores.iter().map(exponential).collect();
    let summed = Bounded::sum(exponentials.iter().map(|exponential| exponential.value));
    let brought: f64 = exponentials.iter().map(|exponential| exponential.error).sum();
    let sum = Bounded { error: summed.error + brought, ..summed };
    let weight = |exponential: Bounded| {
        let weight = exponential * (Bounded::ONE / sum);
        // A device may flush it to 0.
        Bounded { error: weight.error + f64::from(f32::MIN_POSITIVE), ..weight }
    };
    exponentials.into_iter().map(weight).collect()
}
