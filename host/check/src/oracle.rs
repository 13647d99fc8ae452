//! The formulas of weighting, evaluated in `f64` on the same `f32` poses, each with a bound on the error of `f32`.
//!
//! Bounds count roundings to first order in units of `u = 2^-24`. An error `e` with a relative error of `k` units
//! (`k + 1` once the offset is added) gives weights with at most `2 (k + 1) + S + 2` units: the numerator and the sum
//! inherit `k + 1` each, the quotient of the smallest
//! and each error is rounded (1 in the numerator, 1 in the sum), the sum has `S - 1` additions, and the last division
//! 1.
//!
//! This holds for correctly rounded divisions and square roots, as CPUs have them.

use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::{AngleKind, ERROR_OFFSET, Formula, Scheme};

/// `[row][column]`.
pub type Matrix = [[f64; 3]; 3];

/// Scalar product.
pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Euclidean norm.
pub fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

/// Difference.
pub fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// The direction of a vector that is not zero.
pub fn normalised(a: [f64; 3]) -> [f64; 3] {
    let length = norm(a);
    [a[0] / length, a[1] / length, a[2] / length]
}

/// A pose's numbers in `f64`: right, down, forward, centre.
#[derive(Clone, Copy, Debug)]
pub struct WidePose {
    /// Right, down and forward in world coordinates.
    pub axes: Matrix,
    /// Centre in world coordinates.
    pub centre: [f64; 3],
}

impl WidePose {
    /// The same numbers, exactly.
    pub fn new(pose: &Pose) -> WidePose {
        let wide = |v: viewfuse_core::Vec3| [f64::from(v.x), f64::from(v.y), f64::from(v.z)];
        WidePose {
            axes: [wide(pose.right_world()), wide(pose.down_world()), wide(pose.forward_world())],
            centre: wide(pose.centre_world()),
        }
    }

    /// Distance of the centres.
    pub fn distance(&self, other: &WidePose) -> f64 {
        norm(minus(self.centre, other.centre))
    }

    /// Angle between the forward axes by the arc tangent of the difference and the sum of their directions.
    pub fn axis_angle(&self, other: &WidePose) -> f64 {
        let (a, b) = (normalised(self.axes[2]), normalised(other.axes[2]));
        let sum = [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
        2.0 * norm(minus(a, b)).atan2(norm(sum))
    }

    /// Angle of the relative rotation: from the Frobenius norm of the difference of the axes' directions below a right
    /// angle, from the antisymmetric part above it.
    pub fn rotation_angle(&self, other: &WidePose) -> f64 {
        let (a, b) = (&self.axes, &other.axes);
        let twice_cosine = dot(a[0], b[0]) + dot(a[1], b[1]) + dot(a[2], b[2]) - 1.0;
        if twice_cosine > 0.0 {
            let directions = |pose: &WidePose| WidePose { axes: pose.axes.map(normalised), ..*pose };
            let sine_squared = directions(self).rotation_difference_squared(&directions(other)) / 8.0;
            return 2.0 * sine_squared.sqrt().atan2((1.0 - sine_squared).max(0.0).sqrt());
        }
        let antisymmetric =
            [dot(a[2], b[1]) - dot(a[1], b[2]), dot(a[0], b[2]) - dot(a[2], b[0]), dot(a[1], b[0]) - dot(a[0], b[1])];
        norm(antisymmetric).atan2(twice_cosine)
    }

    /// The greatest difference of two axes' lengths.
    pub fn length_difference(&self, other: &WidePose) -> f64 {
        self.axes.iter().zip(other.axes).map(|(a, b)| (norm(*a) - norm(b)).abs()).fold(0.0, f64::max)
    }

    fn rotation_difference_squared(&self, other: &WidePose) -> f64 {
        (0..3).map(|axis| minus(self.axes[axis], other.axes[axis])).map(|d| dot(d, d)).sum()
    }

    /// `R_self R_other^T v`.
    fn carried(&self, other: &WidePose, v: [f64; 3]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for axis in 0..3 {
            let component = dot(other.axes[axis], v);
            for (total, part) in sum.iter_mut().zip(self.axes[axis]) {
                *total += part * component;
            }
        }
        sum
    }
}

/// Every formula with a spread of parameters: choice and parameter of each.
const SPREAD: [(Formula, u32, f32); 17] = [
    (Formula::Mean, 0, 0.0),
    (Formula::L1, 0, 0.0),
    (Formula::Frobenius, 0, 0.0),
    (Formula::RelativeFrobenius, 0, 0.0),
    (Formula::Gaussian, 0, 0.0),
    (Formula::Gaussian, 0, 0.3),
    (Formula::Gaussian, 0, 1.0),
    (Formula::Gaussian, 0, 3.0),
    (Formula::Error, AngleKind::PrincipalAxis as u32, 0.0),
    (Formula::Error, AngleKind::PrincipalAxis as u32, 0.3),
    (Formula::Error, AngleKind::PrincipalAxis as u32, 1.0),
    (Formula::Error, AngleKind::FullRotation as u32, 0.0),
    (Formula::Error, AngleKind::FullRotation as u32, 0.5),
    (Formula::Error, AngleKind::FullRotation as u32, 1.0),
    (Formula::Distance, 1, 0.0),
    (Formula::Distance, 2, 0.0),
    (Formula::Distance, 3, 0.0),
];

/// Every scheme, with a spread of parameters: what is checked and tested.
///
/// # Panics
/// If a parameter of the list is refused.
pub fn schemes() -> Vec<Scheme> {
    let scheme = |(formula, choice, parameter)| {
        Scheme::new(formula, choice, parameter).unwrap_or_else(|error| panic!("{formula:?}: {error}"))
    };
    SPREAD.into_iter().map(scheme).collect()
}

/// The weights in `f64` and the bound on each one's relative error, in units of `2^-24`.
pub fn evaluate(scheme: Scheme, sources: &[Pose], target: &Pose) -> (Vec<f64>, Vec<f64>) {
    let target = WidePose::new(target);
    let sources: Vec<WidePose> = sources.iter().map(WidePose::new).collect();
    let distances: Vec<f64> = sources.iter().map(|s| s.distance(&target)).collect();
    let largest = distances.iter().copied().fold(0.0, f64::max);
    if scheme.formula() == Formula::Gaussian {
        return gaussian(&distances, f64::from(scheme.parameter()));
    }
    // Roundings of a distance: 1 a component, squares, two additions, halved by the root, the root; with the
    // scaling of very small or large components one product more.
    let unscaled = |d: f64| d == 0.0 || (1.0e-14..1.0e14).contains(&d);
    let distance_units = if distances.iter().all(|d| unscaled(*d)) { 3.5 } else { 5.5 };
    let (errors, units): (Vec<f64>, Vec<f64>) = sources
        .iter()
        .zip(&distances)
        .map(|(source, &distance)| match scheme.formula() {
            Formula::Mean | Formula::Gaussian => (1.0, 0.0),
            Formula::L1 => (l1(source, &target), 12.0),
            Formula::Frobenius => {
                (source.rotation_difference_squared(&target).sqrt().hypot(distance), distance_units + 4.0)
            }
            Formula::RelativeFrobenius => relative_frobenius(source, &target),
            Formula::Distance => {
                let power = scheme.choice();
                (distance.powi(power as i32), f64::from(power) * (distance_units + 2.0))
            }
            Formula::Error => {
                let is_of_axes = scheme.choice() == AngleKind::PrincipalAxis as u32;
                let angle = if is_of_axes { source.axis_angle(&target) } else { source.rotation_angle(&target) };
                let alpha = f64::from(scheme.parameter());
                let translation = if largest > 0.0 { distance / largest } else { 0.0 };
                // Angle 18.5, division by pi 1.5, factor 1, two additions; the distance term has less. What is parallel
                // to the sum of two axes, half the difference of their lengths, goes from each with some 6 roundings.
                let error = alpha * angle / std::f64::consts::PI + (1.0 - alpha) * translation;
                let of_lengths = 2.0 * alpha * source.length_difference(&target) / (error + f64::from(ERROR_OFFSET));
                (error, 23.0 + of_lengths)
            }
        })
        .unzip();
    let offset = if scheme == Scheme::MEAN { 0.0 } else { f64::from(ERROR_OFFSET) };
    let scores: Vec<f64> = errors.iter().map(|e| 1.0 / (e + offset)).collect();
    let sum: f64 = scores.iter().sum();
    let weights: Vec<f64> = scores.iter().map(|s| s / sum).collect();
    let mean_units: f64 = weights.iter().zip(&units).map(|(w, u)| w * (u + 1.0)).sum();
    let bounds = units.iter().map(|u| u + 1.0 + mean_units + sources.len() as f64 + 3.0).collect();
    (weights, bounds)
}

fn l1(source: &WidePose, target: &WidePose) -> f64 {
    let sum = |v: [f64; 3]| v[0].abs() + v[1].abs() + v[2].abs();
    let axes: f64 = (0..3).map(|axis| sum(minus(source.axes[axis], target.axes[axis]))).sum();
    axes + sum(minus(source.centre, target.centre))
}

/// The error, and its units: the translation is a difference that may cancel, so its roundings count in units of the
/// centres.
fn relative_frobenius(source: &WidePose, target: &WidePose) -> (f64, f64) {
    let translation = minus(source.centre, source.carried(target, target.centre));
    let rotation: f64 = (0..3)
        .map(|axis| {
            let unit = [f64::from(axis == 0), f64::from(axis == 1), f64::from(axis == 2)];
            let column = source.carried(target, unit);
            dot(column, column)
        })
        .sum();
    let error = (rotation + 1.0 + dot(translation, translation)).sqrt();
    // The two products with a rotation: 3 roundings a sum each, entries of up to 1 in 1-norms of up to sqrt 3.
    let carried_units = (6.0 * 3.0 * norm(target.centre) + norm(source.centre)) / error;
    (error, 12.0 + carried_units)
}

/// The logit of a source is `-beta (d^2 - n^2)` with the nearest distance `n`. Up to distances and a beta of 1e6 it is
/// kept with its rounding error: `exp` has 4 units, the correction 3, and 1 is left for what is of second order in the
/// exponent. Of second order in the squares, of which an exponent is a small difference, are the roundings of what
/// squares have lost: at most 22 of `2^-48 d^2` of a square's, and 18 of the difference's and of the product with beta.
/// Beyond, each square inherits 7 units of its distance (11 if scaled), the difference, sum and products are rounded 4
/// times, and `exp` adds its own 4 units.
fn gaussian(distances: &[f64], beta: f64) -> (Vec<f64>, Vec<f64>) {
    let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    let logits: Vec<f64> = distances.iter().map(|d| -beta * (d - nearest) * (d + nearest)).collect();
    let sum: f64 = logits.iter().map(|l| l.exp()).sum();
    let weights: Vec<f64> = logits.iter().map(|l| l.exp() / sum).collect();
    let is_exact = beta <= 1.0e6 && distances.iter().all(|d| *d <= 1.0e6);
    let units: Vec<f64> = distances
        .iter()
        .zip(&logits)
        .map(|(d, logit)| {
            let squares = beta * (d * d + nearest * nearest);
            if is_exact {
                8.0 + 40.0 * squares * f64::from(f32::EPSILON) / 2.0
            } else {
                11.0 * squares + 4.0 * logit.abs() + 4.0
            }
        })
        .collect();
    let mean_units: f64 = weights.iter().zip(&units).map(|(w, u)| if *w > 0.0 { w * u } else { 0.0 }).sum();
    let bounds = units.iter().map(|u| u + mean_units + distances.len() as f64 + 3.0).collect();
    (weights, bounds)
}
