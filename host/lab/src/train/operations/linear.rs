//! Fully connected layers on rows of numbers: a layer is its weights `[output][input]`, then its biases.

use super::Real;
use super::convolve::{add_product, matrix, matrix_mut, product};

/// `rows x weights^T + biases`.
pub(super) fn linear<T: Real>(rows: &[T], layer: &[T], inner: usize, outer: usize) -> Vec<T> {
    let (weights, biases) = layer.split_at(inner * outer);
    let count = rows.len() / inner;
    let mut output = Vec::with_capacity(count * outer);
    (0..count).for_each(|_| output.extend_from_slice(biases));
    add_product(matrix(rows, count, inner), matrix(weights, outer, inner).t(), matrix_mut(&mut output, count, outer));
    output
}

/// Backward pass through a rectification and the layer behind it: adds to the gradients of the input and of the
/// layer.
pub(super) fn linear_back<T: Real>(
    before: &[T],
    layer: &[T],
    gradient: &[T],
    inner: usize,
    outer: usize,
    of_before: &mut [T],
    of_layer: Option<&mut [T]>,
) {
    let count = before.len() / inner;
    if let Some(of_layer) = of_layer {
        layer_gradient(&rectified(before), gradient, inner, outer, of_layer);
    }
    let mut added = vec![T::zero(); before.len()];
    let weights = matrix(&layer[..inner * outer], outer, inner);
    product(matrix(gradient, count, outer), weights, matrix_mut(&mut added, count, inner));
    for ((to, added), before) in of_before.iter_mut().zip(added).zip(before) {
        // Without a branch, so that it takes several numbers at once.
        *to += if *before > T::zero() { added } else { T::zero() };
    }
}

/// Adds to a layer's gradient.
pub(super) fn layer_gradient<T: Real>(rows: &[T], gradient: &[T], inner: usize, outer: usize, of_layer: &mut [T]) {
    let count = rows.len() / inner;
    let (of_weights, of_biases) = of_layer.split_at_mut(inner * outer);
    let gradient = matrix(gradient, count, outer);
    add_product(gradient.t(), matrix(rows, count, inner), matrix_mut(of_weights, outer, inner));
    for row in gradient.rows() {
        of_biases.iter_mut().zip(row).for_each(|(to, value)| *to += *value);
    }
}

/// Negative numbers become 0.
pub(super) fn rectified<T: Real>(values: &[T]) -> Vec<T> {
    // NaN stays NaN, so that the loss shows it.
    values.iter().map(|value| if *value < T::zero() { T::zero() } else { *value }).collect()
}

/// Adds to the gradient of a layer's input, without rectification.
pub(super) fn input_gradient<T: Real>(layer: &[T], gradient: &[T], inner: usize, outer: usize, of_rows: &mut [T]) {
    let count = gradient.len() / outer;
    let weights = matrix(&layer[..inner * outer], outer, inner);
    add_product(matrix(gradient, count, outer), weights, matrix_mut(of_rows, count, inner));
}
