//! The kernel distance of two sets of points, KID where the points are Inception's.
//!
//! The square of the maximum mean discrepancy with the kernel `k(x, y) = (x.y / d + 1)^3`, `d` the dimension, without
//! bias: the mean of `k` within each set (no point with itself), minus twice its mean between the sets (Binkowski,
//! Sutherland, Arbel, Gretton: "Demystifying MMD GANs", ICLR 2018). Unlike that of the Frechet distance, its
//! expectation does not depend on the number of points, so it is valid for few pictures; near 0 it may be negative.
//!
//! Published scores are means over 100 random subsets of at most 1000 points of each set. Where both sets are no larger
//! than that, all points are used at once, which estimates the same number with less variance ([`kernel_distance`]).
//! All arithmetic is `f64`.

use super::features::{Features, SetError};
use faer::Mat;
use viewfuse_core::random::threefry_2x32;

/// Number of subsets in published scores.
pub const SUBSET_COUNT: u32 = 100;
/// Points in a subset, if both sets have that many.
pub const SUBSET_SIZE: usize = 1000;

/// The distance of two sets; by subsets if one has more than [`SUBSET_SIZE`] points.
///
/// # Errors
/// [`SetError::Dimensions`], [`SetError::Few`].
pub fn kernel_distance(a: &Features, b: &Features, seed: u64) -> Result<f64, SetError> {
    if a.count().max(b.count()) > SUBSET_SIZE {
        return distance_of_subsets(a, b, SUBSET_COUNT, SUBSET_SIZE, seed);
    }
    a.comparable(b)?;
    let all = |points: &Features| matrix(points, &(0..points.count()).collect::<Vec<_>>());
    Ok(distance(&all(a), &all(b)))
}

/// The mean distance of random subsets of `size` points of each set (fewer if a set has fewer, at least 2), drawn
/// without replacement. The same seed draws the same subsets.
///
/// # Errors
/// [`SetError::Dimensions`], [`SetError::Few`].
pub fn distance_of_subsets(a: &Features, b: &Features, count: u32, size: usize, seed: u64) -> Result<f64, SetError> {
    a.comparable(b)?;
    let size = size.min(a.count()).min(b.count()).max(2);
    let subset = |points: &Features, draw: u32| matrix(points, &drawn(points.count(), size, seed, draw));
    let sum: f64 = (0..count).map(|index| distance(&subset(a, 2 * index), &subset(b, 2 * index + 1))).sum();
    Ok(sum / f64::from(count))
}

/// The points of these numbers, divided by the root of the dimension.
fn matrix(points: &Features, numbers: &[usize]) -> Mat<f64> {
    let scale = 1.0 / (points.dimension() as f64).sqrt();
    Mat::from_fn(numbers.len(), points.dimension(), |row, column| points.row(numbers[row])[column] * scale)
}

fn distance(a: &Mat<f64>, b: &Mat<f64>) -> f64 {
    let kernels = |x: &Mat<f64>, y: &Mat<f64>| {
        let mut products = x * y.transpose();
        products
            .col_iter_mut()
            .for_each(|column| column.iter_mut().for_each(|product| *product = (*product + 1.0).powi(3)));
        products
    };
    let within = |x: &Mat<f64>| {
        let kernels = kernels(x, x);
        let trace: f64 = kernels.diagonal().column_vector().iter().sum();
        let count = x.nrows() as f64;
        (kernels.sum() - trace) / (count * (count - 1.0))
    };
    within(a) + within(b) - 2.0 * kernels(a, b).sum() / (a.nrows() * b.nrows()) as f64
}

/// `size` different numbers below `count`: the beginning of a shuffled list (Fisher and Yates).
fn drawn(count: usize, size: usize, seed: u64, draw: u32) -> Vec<usize> {
    let mut numbers: Vec<usize> = (0..count).collect();
    for place in 0..size {
        let [low, high] = threefry_2x32([seed as u32, (seed >> 32) as u32], [place as u32, draw]);
        // 64 random bits: the modulo bias is at most `count / 2^64`.
        let word = u64::from(high) << 32 | u64::from(low);
        numbers.swap(place, place + (word % (count - place) as u64) as usize);
    }
    numbers.truncate(size);
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(count: usize, shift: f64) -> Features {
        let value = |at: usize| ((at * 37 % 101) as f64 / 50.0 - 1.0) * (1.0 + shift) + shift;
        Features::new(5, (0..count * 5).map(value).collect()).expect("rows of finite numbers")
    }

    /// The definition, pair by pair.
    fn plainly(a: &Features, b: &Features) -> f64 {
        let kernel =
            |x: &[f64], y: &[f64]| (x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>() / x.len() as f64 + 1.0).powi(3);
        let mean = |a: &Features, b: &Features, is_own: bool| {
            let mut kernels = Vec::new();
            for (i, x) in a.rows().enumerate() {
                kernels.extend(b.rows().enumerate().filter(|(j, _)| !is_own || *j != i).map(|(_, y)| kernel(x, y)));
            }
            kernels.iter().sum::<f64>() / kernels.len() as f64
        };
        mean(a, a, true) + mean(b, b, true) - 2.0 * mean(a, b, false)
    }

    #[test]
    fn agrees_with_the_definition() {
        for (count_a, count_b, shift) in [(2, 2, 0.5), (7, 4, 0.5), (20, 31, 2.0)] {
            let (a, b) = (set(count_a, 0.0), set(count_b, shift));
            let (ours, expected) = (kernel_distance(&a, &b, 0).expect("a distance"), plainly(&a, &b));
            assert!((ours - expected).abs() <= 1.0e-12 * expected.abs().max(1.0), "{ours} is not {expected}");
        }
    }

    #[test]
    fn subsets_as_large_as_the_sets_are_the_sets() {
        let (a, b) = (set(12, 0.0), set(12, 0.7));
        let whole = kernel_distance(&a, &b, 0).expect("a distance");
        let subsets = distance_of_subsets(&a, &b, 5, 100, 3).expect("a distance");
        assert!((whole - subsets).abs() <= 1.0e-12, "{whole} and {subsets}");
        // Smaller ones vary around it, by the seed.
        let draws = [1, 2].map(|seed| distance_of_subsets(&a, &b, 400, 6, seed).expect("a distance"));
        assert!(draws[0] != draws[1] && draws.iter().all(|draw| (draw / whole - 1.0).abs() < 0.2), "{draws:?} {whole}");
    }

    #[test]
    fn draws_are_different_numbers() {
        for draw in 0..20 {
            let mut numbers = drawn(9, 6, 4, draw);
            assert!(numbers.iter().all(|number| *number < 9));
            numbers.sort_unstable();
            numbers.dedup();
            assert_eq!(numbers.len(), 6);
        }
        assert_ne!(drawn(9, 6, 4, 0), drawn(9, 6, 4, 1));
        let mut whole = drawn(9, 9, 4, 0);
        whole.sort_unstable();
        assert_eq!(whole, (0..9).collect::<Vec<_>>());
    }

    #[test]
    fn what_has_no_distance() {
        assert_eq!(kernel_distance(&set(1, 0.0), &set(3, 0.0), 0), Err(SetError::Few(1, 3)));
    }
}
