//! Camera weighting by formula: how relevant each source pose is to the target pose.
//!
//! The schemes are those of "Pay Attention to Where You Looked" (section 3, deterministic weighting) and of its
//! published code (`cam_weighting.py`). Each turns a source and the target into an error `e >= 0`; the weights are
//! proportional to `1 / (e + 1e-6)`, except for the Gaussian. Where the published code gives NaN (coinciding centres,
//! underflow of every Gaussian, overflow of squares) these give the limit.
//!
//! Accuracy, relative to an `f64` evaluation on the same `f32` poses, in units of `2^-24`. An error `e` with `k`
//! roundings gives a weight with at most `2 (k + 1) + S + 3`: `k + 1` in the numerator (the offset adds one), as many in
//! the sum, two quotients, `S - 1` additions, the reciprocal of the sum and the product with it. Counted roundings `k`, and the largest error of a
//! weight that was measured for up to 32 sources (random poses at scales from 1e-20 to 1e29, rings, near-coincident cameras):
//!
//! | scheme | `k` | measured |
//! |---|---|---|
//! | mean | 0 | 0.5 |
//! | distance, power 1, 2, 3 | 5.5, 11, 16.5; 2 a power more where norms are scaled | 6.3, 8.9, 14.9 |
//! | error | 21 (angle 16.5, its share 2.5, two additions) | 8.8 |
//! | L1 | 12 | 6.6 |
//! | Frobenius | 7.5; 9.5 where norms are scaled | 7.3 |
//! | relative Frobenius | `12 + (18 abs(c_t) + abs(c_s)) / e`, as its translation may cancel | 8.0; 34 on a ring of radius 800 |
//! | Gaussian | 8; beyond a distance or beta of 1e6 `11 beta (d^2 + n^2) + 4 beta abs(d^2 - n^2) + 4`, `n` the nearest distance | 6.1 within 1e6; then grows with the exponent |
//!
//! The Gaussian's exponent is kept with its rounding error, because an error of an exponent is a relative error of the
//! weight; where squares approach overflow it is not. Weights below 4e-38 may be 0.
//! `viewfuse::check::oracle` derives these bounds, and tests assert them for each weight.

use crate::math::{abs, angle_from_squares, clamp, exp, max, min, norm3, sqrt, two_product, two_sum};
use crate::pose::Pose;
use crate::sources::Sources;
use crate::weights::Weights;
use bytemuck::{Pod, Zeroable};
use core::f32::consts::FRAC_1_PI;
use core::fmt;

/// Added to every error before the reciprocal, as in the published code.
pub const ERROR_OFFSET: f32 = 1.0e-6;

/// Which angle between two cameras error weighting uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum AngleKind {
    /// Between the principal axes, as the paper defines it.
    PrincipalAxis = 0,
    /// Of the full relative rotation, roll included, as the published code computes it.
    FullRotation = 1,
}

/// Why a number cannot be a parameter of a scheme.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SchemeError {
    /// `alpha` must lie in `[0, 1]`.
    Alpha,
    /// `beta` must be finite and at least 0.
    Beta,
    /// The power must be 1, 2 or 3.
    Power,
}

impl fmt::Display for SchemeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            SchemeError::Alpha => "alpha must be between 0 and 1",
            SchemeError::Beta => "beta must be finite and at least 0",
            SchemeError::Power => "the power must be 1, 2 or 3",
        })
    }
}

impl core::error::Error for SchemeError {}

/// A weighting scheme given by a formula. Built by checked constructors where it has parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scheme(Formula);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Formula {
    Mean,
    L1,
    Frobenius,
    Gaussian { beta: f32 },
    Error { alpha: f32, angle: AngleKind },
    Distance { power: u32 },
    RelativeFrobenius,
}

impl Scheme {
    /// Every source counts the same: what PixelNeRF and GeNVS do.
    pub const MEAN: Scheme = Scheme(Formula::Mean);
    /// `e = sum |T - S|` over the entries of the two 4x4 poses.
    pub const L1: Scheme = Scheme(Formula::L1);
    /// `e = |T - S|_F`, the Frobenius norm of the difference of the two 4x4 poses.
    pub const FROBENIUS: Scheme = Scheme(Formula::Frobenius);
    /// `e = |S T^-1|_F`, the Frobenius norm of the relative pose (in world axes, as published). Uniform on a ring of
    /// cameras that look at its centre.
    pub const RELATIVE_FROBENIUS: Scheme = Scheme(Formula::RelativeFrobenius);

    /// Error weighting with `alpha = 1` and the angle between principal axes: the best of the paper's formulas.
    pub const ERROR: Scheme = Scheme(Formula::Error { alpha: 1.0, angle: AngleKind::PrincipalAxis });

    /// Weights proportional to `exp(-beta d^2)` with `d` the distance of the centres in world units.
    ///
    /// # Errors
    /// [`SchemeError::Beta`] unless `beta` is finite and at least 0.
    pub fn gaussian(beta: f32) -> Result<Scheme, SchemeError> {
        if (0.0..=f32::MAX).contains(&beta) { Ok(Scheme(Formula::Gaussian { beta })) } else { Err(SchemeError::Beta) }
    }

    /// `e = alpha * angle / pi + (1 - alpha) * d / max d`.
    ///
    /// # Errors
    /// [`SchemeError::Alpha`] unless `alpha` lies in `[0, 1]`.
    pub fn error(alpha: f32, angle: AngleKind) -> Result<Scheme, SchemeError> {
        if (0.0..=1.0).contains(&alpha) { Ok(Scheme(Formula::Error { alpha, angle })) } else { Err(SchemeError::Alpha) }
    }

    /// `e = d^power` with `d` the distance of the centres in world units and `power` 1, 2 or 3.
    ///
    /// # Errors
    /// [`SchemeError::Power`] for any other power.
    pub fn distance(power: u32) -> Result<Scheme, SchemeError> {
        if (1..=3).contains(&power) { Ok(Scheme(Formula::Distance { power })) } else { Err(SchemeError::Power) }
    }
}

/// A scheme as plain data: what a kernel reads from a buffer. Made from a [`Scheme`] by [`Scheme::block`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SchemeBlock {
    /// Which formula, in the order of [`weigh`]'s cases; unknown ones are the mean.
    pub formula: u32,
    /// The power, or 1 for the angle of the full rotation.
    pub choice: u32,
    /// `alpha` or `beta`.
    pub parameter: f32,
    /// Zero.
    pub padding: u32,
}

const _: () = assert!(size_of::<SchemeBlock>() == 16);

/// How many sources the kernels that weigh on a device can hold: rows of weights there have this length.
pub const MOST_WEIGHED: usize = 32;

/// A dispatch of [`weigh`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct WeighBlock {
    /// The scheme.
    pub scheme: SchemeBlock,
    /// How many sources there are.
    pub source_count: u32,
}

impl Scheme {
    /// The scheme as plain data for kernels.
    pub fn block(&self) -> SchemeBlock {
        let (formula, choice, parameter) = match self.0 {
            Formula::Mean => (0, 0, 0.0),
            Formula::Gaussian { beta } => (1, 0, beta),
            Formula::Distance { power } => (2, power, 0.0),
            Formula::Error { alpha, angle } => (3, angle as u32, alpha),
            Formula::L1 => (4, 0, 0.0),
            Formula::Frobenius => (5, 0, 0.0),
            Formula::RelativeFrobenius => (6, 0, 0.0),
        };
        SchemeBlock { formula, choice, parameter, padding: 0 }
    }
}

impl SchemeBlock {
    /// The scheme that the block was made from. Parameters that no scheme has are brought into their range.
    #[inline]
    pub fn scheme(&self) -> Scheme {
        Scheme(match self.formula {
            1 => Formula::Gaussian { beta: clamp(self.parameter, 0.0, f32::MAX) },
            2 => Formula::Distance { power: self.choice.clamp(1, 3) },
            3 => Formula::Error {
                alpha: clamp(self.parameter, 0.0, 1.0),
                angle: if self.choice == 0 { AngleKind::PrincipalAxis } else { AngleKind::FullRotation },
            },
            4 => Formula::L1,
            5 => Formula::Frobenius,
            6 => Formula::RelativeFrobenius,
            _ => Formula::Mean,
        })
    }
}

/// The weights of the sources for a target, by formula. Sums run in view order. A single source has weight 1.
pub fn weigh<const S: usize>(scheme: Scheme, sources: &Sources<S>, target: &Pose) -> Weights<S> {
    let count = sources.count();
    match scheme.0 {
        Formula::Mean => Weights::mean(count),
        Formula::Gaussian { beta } => gaussian(sources, target, beta),
        Formula::Distance { power } => inverse_distance(sources, target, power),
        Formula::Error { alpha, angle } => error_weights(sources, target, alpha, angle),
        Formula::L1 => inverse(sources, target, pose_difference_l1),
        Formula::Frobenius => inverse(sources, target, pose_difference_frobenius),
        Formula::RelativeFrobenius => inverse(sources, target, relative_pose_frobenius),
    }
}

/// Weights proportional to `1 / (error(source, target) + 1e-6)`.
fn inverse<const S: usize>(sources: &Sources<S>, target: &Pose, error: impl Fn(&Pose, &Pose) -> f32) -> Weights<S> {
    let mut errors = [0.0; S];
    let mut view = 0;
    while view < sources.count() {
        errors[view as usize] = error(sources.pose(view), target) + ERROR_OFFSET;
        view += 1;
    }
    Weights::from_errors(&errors, sources.count())
}

/// Distances of the source centres from the target's, and the largest of them.
fn distances<const S: usize>(sources: &Sources<S>, target: &Pose) -> ([f32; S], f32) {
    let mut distances = [0.0; S];
    let mut largest = 0.0;
    let mut view = 0;
    while view < sources.count() {
        let distance = sources.pose(view).distance(target);
        distances[view as usize] = distance;
        largest = max(distance, largest);
        view += 1;
    }
    (distances, largest)
}

fn error_weights<const S: usize>(sources: &Sources<S>, target: &Pose, alpha: f32, angle: AngleKind) -> Weights<S> {
    let count = sources.count();
    // A term whose factor is 0 is left out: it can change nothing.
    let (mut errors, largest) = if alpha < 1.0 { distances(sources, target) } else { ([0.0; S], 0.0) };
    // All centres at the target's: the published 0 / 0 is a distance term of 0.
    let translation_factor = if largest > 0.0 { (1.0 - alpha) / largest } else { 0.0 };
    let mut angles = [0.0; S];
    if alpha > 0.0 {
        angles_between(sources, target, angle, &mut angles);
    }
    let mut view = 0;
    while view < count as usize {
        errors[view] = alpha * (angles[view] * FRAC_1_PI) + translation_factor * errors[view] + ERROR_OFFSET;
        view += 1;
    }
    Weights::from_errors(&errors, count)
}

/// Angles between the sources and the target in radians, in `[0, pi]`.
fn angles_between<const S: usize>(sources: &Sources<S>, target: &Pose, kind: AngleKind, angles: &mut [f32; S]) {
    let count = (sources.count() as usize).min(S);
    match kind {
        AngleKind::PrincipalAxis => {
            // Two plain loops, so that the arc tangents run as vectors on a CPU.
            let mut differences = [0.0; S];
            let mut view = 0;
            while view < count {
                (differences[view], angles[view]) = sources.pose(view as u32).axis_chords_squared(target);
                view += 1;
            }
            view = 0;
            while view < count {
                angles[view] = 2.0 * angle_from_squares(differences[view], angles[view]);
                view += 1;
            }
        }
        AngleKind::FullRotation => {
            let mut view = 0;
            while view < count {
                angles[view] = sources.pose(view as u32).rotation_angle(target);
                view += 1;
            }
        }
    }
}

fn inverse_distance<const S: usize>(sources: &Sources<S>, target: &Pose, power: u32) -> Weights<S> {
    let (mut errors, largest) = distances(sources, target);
    // Cubes overflow from 7e12 on: there the distances are measured in units of the nearest one, which cancels, and the
    // offset shrinks with them. In units of the nearest nothing that matters can vanish, and what overflows to infinity
    // has no weight.
    let (unit, offset) = if largest > 1.0e6 {
        let mut nearest = largest;
        let mut view = 0;
        while view < sources.count() {
            nearest = min(errors[view as usize], nearest);
            view += 1;
        }
        let unit = max(nearest, 0.01);
        (unit, ERROR_OFFSET * integer_power(1.0 / unit, power))
    } else {
        (1.0, ERROR_OFFSET)
    };
    let mut view = 0;
    while view < sources.count() {
        errors[view as usize] = integer_power(errors[view as usize] / unit, power) + offset;
        view += 1;
    }
    Weights::from_errors(&errors, sources.count())
}

fn gaussian<const S: usize>(sources: &Sources<S>, target: &Pose, beta: f32) -> Weights<S> {
    let count = sources.count() as usize;
    let (distances, largest) = distances(sources, target);
    let (mut nearest, mut least) = (0, distances[0]);
    let mut view = 1;
    while view < count {
        if distances[view] < least {
            (nearest, least) = (view, distances[view]);
        }
        view += 1;
    }
    // The limit only tells the compiler that the nearest is one of them.
    let nearest_squared = squared_distance(sources.pose(nearest.min(S - 1) as u32), target);
    let mut scores = [0.0; S];
    view = 0;
    while view < count {
        // Relative to the nearest source, so that the largest weight never underflows.
        let squared = squared_distance(sources.pose(view as u32), target);
        // A relative error of an exponent is an absolute error of the logarithm of a weight: an exponent of 40 in f32
        // alone would cost 5e-6. So it is kept with its rounding error, and the exponential corrected by that.
        let (excess, rest) = two_sum(squared.0, -nearest_squared.0);
        let rest = rest + (squared.1 - nearest_squared.1);
        scores[view] = if largest > LARGEST_EXACT_DISTANCE || beta > LARGEST_EXACT_BETA {
            // So far away the squares overflow; d^2 - n^2 = (d - n)(d + n).
            let (far, near) = (distances[view], least);
            if far > near && beta > 0.0 { exp(-(beta * (far - near)) * (far + near)) } else { 1.0 }
        } else {
            let (exponent, error) = two_product(beta, excess);
            exp(-exponent) * (1.0 - (error + beta * rest))
        };
        view += 1;
    }
    Weights::from_scores(&scores, sources.count())
}

/// Distance up to which the Gaussian's exponent is kept with its rounding error.
const LARGEST_EXACT_DISTANCE: f32 = 1.0e6;
/// The same for `beta`.
const LARGEST_EXACT_BETA: f32 = 1.0e6;

/// Squared distance of two cameras' centres, as the rounded value and the rest.
fn squared_distance(a: &Pose, b: &Pose) -> (f32, f32) {
    let (a, b) = (a.centre_world().to_array(), b.centre_world().to_array());
    let (mut sum, mut rest) = (0.0, 0.0);
    let mut axis = 0;
    while axis < 3 {
        let (difference, lost) = two_sum(a[axis], -b[axis]);
        let (square, error) = two_product(difference, difference);
        let (total, carry) = two_sum(sum, square);
        sum = total;
        rest += carry + (error + 2.0 * difference * lost);
        axis += 1;
    }
    (sum, rest)
}

/// `x^power` for `power` in 1..=3.
fn integer_power(x: f32, power: u32) -> f32 {
    match power {
        1 => x,
        2 => x * x,
        _ => x * x * x,
    }
}

/// `sum |T - S|` over the 16 entries (the last row contributes 0). The same in OpenCV and OpenGL axes.
fn pose_difference_l1(source: &Pose, target: &Pose) -> f32 {
    let (s, t) = (source.to_opencv(), target.to_opencv());
    let mut sum = 0.0;
    let mut row = 0;
    while row < 3 {
        let mut column = 0;
        while column < 4 {
            sum += abs(t[row][column] - s[row][column]);
            column += 1;
        }
        row += 1;
    }
    sum
}

/// `|T - S|_F` over the 16 entries, without overflow.
fn pose_difference_frobenius(source: &Pose, target: &Pose) -> f32 {
    let rotation = (target.right_world() - source.right_world()).length_squared()
        + (target.down_world() - source.down_world()).length_squared()
        + (target.forward_world() - source.forward_world()).length_squared();
    norm3(sqrt(rotation), target.distance(source), 0.0)
}

/// `|S T^-1|_F` of the 4x4 relative pose: its rotation `R_s R_t^T`, its translation `c_s - R_s R_t^T c_t`, and the 1
/// in the corner.
fn relative_pose_frobenius(source: &Pose, target: &Pose) -> f32 {
    let (s, t) = (source, target);
    let mut rotation = 0.0;
    let c = target.centre_world();
    // R_s (R_t^T c_t): the target's centre in the target's camera axes, carried along the source's axes.
    let carried = source.rotate_to_world(glam::Vec3::new(
        t.right_world().dot(c),
        t.down_world().dot(c),
        t.forward_world().dot(c),
    ));
    let columns = [
        s.right_world() * t.right_world().x
            + s.down_world() * t.down_world().x
            + s.forward_world() * t.forward_world().x,
        s.right_world() * t.right_world().y
            + s.down_world() * t.down_world().y
            + s.forward_world() * t.forward_world().y,
        s.right_world() * t.right_world().z
            + s.down_world() * t.down_world().z
            + s.forward_world() * t.forward_world().z,
    ];
    let mut column = 0;
    while column < 3 {
        rotation += columns[column].length_squared();
        column += 1;
    }
    let translation = source.centre_world() - carried;
    norm3(sqrt(rotation + 1.0), norm3(translation.x, translation.y, translation.z), 0.0)
}
