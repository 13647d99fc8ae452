//! The Frechet distance of two sets of points, FID where the points are Inception's.
//!
//! Both sets are modelled as normal distributions with their means `m` and sample covariances `S` (divided by the count
//! less one): `|m1 - m2|^2 + Tr S1 + Tr S2 - 2 Tr (S1^(1/2) S2 S1^(1/2))^(1/2)` (Heusel et al.: "GANs trained by a two
//! time-scale update rule converge to a local Nash equilibrium", NeurIPS 2017).
//!
//! With `S1 = A' A` and `S2 = B' B`, `A` and `B` the centred points divided by the root of the count less one, the last
//! trace is the sum of the singular values of `A B'`: the eigenvalues of the symmetric `S1^(1/2) S2 S1^(1/2)` are their
//! squares. They are real and not negative by construction, no covariance and no root of one is ever formed, and sets
//! with fewer points than dimensions are only smaller matrices: the imaginary parts of the published code, and its
//! offset for singular products, do not arise. All arithmetic is `f64`.
//!
//! A warning: few points underestimate spreads. FID of fewer pictures than its 2048 dimensions says little; report
//! [`super::kernel`] next to it.

use super::features::{Features, SetError};
use faer::Mat;

/// The distance: 0 for equal sets, symmetric, never negative. Two sets of 2048 dimensions and 3000 points take
/// seconds; of fewer than 100 points, milliseconds.
///
/// # Errors
/// [`SetError::Dimensions`], [`SetError::Few`], [`SetError::NotConverged`].
pub fn frechet_distance(a: &Features, b: &Features) -> Result<f64, SetError> {
    a.comparable(b)?;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let between: f64 = mean_a.iter().zip(&mean_b).map(|(a, b)| (a - b) * (a - b)).sum();
    let (spread_a, spread_b) = (spread(a, &mean_a), spread(b, &mean_b));
    let traces = spread_a.squared_norm_l2() + spread_b.squared_norm_l2();
    let common = reduced(spread_a) * reduced(spread_b).transpose();
    let singular_values = common.singular_values().map_err(|_| SetError::NotConverged)?;
    // For equal sets the result is rounding error, of either sign.
    Ok((between + traces - 2.0 * singular_values.iter().sum::<f64>()).max(0.0))
}

/// The mean point.
fn mean(points: &Features) -> Vec<f64> {
    let mut sum = vec![0.0; points.dimension()];
    for row in points.rows() {
        sum.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
    }
    let count = points.count() as f64;
    sum.into_iter().map(|sum| sum / count).collect()
}

/// A matrix whose product with itself is the covariance: the points less their mean, divided by the root of the count
/// less one.
fn spread(points: &Features, mean: &[f64]) -> Mat<f64> {
    let scale = 1.0 / ((points.count() - 1) as f64).sqrt();
    Mat::from_fn(points.count(), points.dimension(), |row, column| (points.row(row)[column] - mean[column]) * scale)
}

/// The same covariance from no more rows than columns: a rotation of the rows changes no singular value.
fn reduced(matrix: Mat<f64>) -> Mat<f64> {
    if matrix.nrows() > matrix.ncols() { matrix.qr().thin_R().to_owned() } else { matrix }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(dimension: usize, values: &[f64]) -> Features {
        Features::new(dimension, values.to_vec()).expect("rows of finite numbers")
    }

    /// Points `mean +- spread` on each axis: the covariance is diagonal.
    fn cross(mean: &[f64], spreads: &[f64]) -> Features {
        let dimension = mean.len();
        let point = |axis: usize, sign: f64| {
            let mut point = mean.to_vec();
            point[axis] += sign * spreads[axis];
            point
        };
        let points: Vec<f64> = (0..dimension).flat_map(|axis| [point(axis, 1.0), point(axis, -1.0)].concat()).collect();
        set(dimension, &points)
    }

    #[test]
    fn equal_sets_are_0_apart_whatever_their_rank() {
        // Three points on a line in five dimensions, and two equal ones.
        let line: Vec<f64> = (0..15).map(|at| f64::from((at / 5) * (at % 5 + 1))).collect();
        for points in [set(5, &line), set(5, &[7.0; 10]), cross(&[1.0e4, 2.0], &[3.0, 1.0e-3])] {
            let distance = frechet_distance(&points, &points).expect("a distance");
            assert!((0.0..=1.0e-12).contains(&distance), "{distance}");
        }
    }

    #[test]
    fn sets_on_lines_at_right_angles() {
        // Rank 1 each, product of the covariances 0: the traces stay.
        let (a, b) = (set(3, &[1.0, 0.0, 0.0, -1.0, 0.0, 0.0]), set(3, &[0.0, 2.0, 0.0, 0.0, -2.0, 0.0]));
        let distance = frechet_distance(&a, &b).expect("a distance");
        assert!((distance - (2.0 + 8.0)).abs() <= 1.0e-12, "{distance}");
        assert_eq!(frechet_distance(&a, &b), frechet_distance(&b, &a));
    }

    #[test]
    fn what_has_no_distance() {
        let (one, two) = (set(2, &[1.0, 2.0]), set(2, &[1.0, 2.0, 3.0, 4.0]));
        assert_eq!(frechet_distance(&one, &two), Err(SetError::Few(1, 2)));
        assert_eq!(frechet_distance(&two, &set(1, &[1.0, 2.0])), Err(SetError::Dimensions(2, 1)));
    }
}
