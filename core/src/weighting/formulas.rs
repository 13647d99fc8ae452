//! The formulas themselves: weights of the sources from their poses, the target's, and a scheme's choice and parameter.
//!
//! Every function that a row of [`super::ROWS`] names has the same arguments, used or not: sources, target, choice,
//! parameter. Sums run in view order. A single source has weight 1.

use super::{AngleKind, ERROR_OFFSET};
use crate::math::{abs, angle_from_squares, exp, max, min, norm3, sqrt, two_product, two_sum};
use crate::pose::Pose;
use crate::sources::Sources;
use crate::weights::Weights;
use core::f32::consts::FRAC_1_PI;

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

/// Weights by `e = alpha angle / pi + (1 - alpha) d / max d`; the choice is an [`AngleKind`].
pub(super) fn error<const S: usize>(sources: &Sources<S>, target: &Pose, choice: u32, alpha: f32) -> Weights<S> {
    let angle =
        if choice == AngleKind::PrincipalAxis as u32 { AngleKind::PrincipalAxis } else { AngleKind::FullRotation };
    let count = sources.count();
    // A term whose factor is 0 is left out: it can change nothing.
    let (mut errors, largest) = if alpha < 1.0 { distances(sources, target) } else { ([0.0; S], 0.0) };
    // All centres at the target's: the published 0 / 0 is a distance term of 0. The reciprocal of a subnormal distance
    // would be infinite, so such ones are enlarged.
    let unit = if largest < 1.0e-30 { 1.0e30 } else { 1.0 };
    let translation_factor = if largest > 0.0 { (1.0 - alpha) / (largest * unit) } else { 0.0 };
    let mut angles = [0.0; S];
    if alpha > 0.0 {
        angles_between(sources, target, angle, &mut angles);
    }
    let mut view = 0;
    while view < count as usize {
        errors[view] = alpha * (angles[view] * FRAC_1_PI) + translation_factor * (errors[view] * unit) + ERROR_OFFSET;
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

/// Weights by `e = d^power`, the power 1, 2 or 3.
pub(super) fn distance<const S: usize>(sources: &Sources<S>, target: &Pose, power: u32, _: f32) -> Weights<S> {
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

/// Weights proportional to `exp(-beta d^2)`.
pub(super) fn gaussian<const S: usize>(sources: &Sources<S>, target: &Pose, _: u32, beta: f32) -> Weights<S> {
    let count = sources.count() as usize;
    let mut squares = [(0.0, 0.0); S];
    // The nearest by squares and their rests: of two that are rounded to one number, the wrong one would have the whole
    // weight where beta is large.
    let (mut least, mut is_exact) = ((f32::INFINITY, 0.0), beta <= MAX_EXACT_BETA);
    let mut view = 0;
    while view < count {
        let (square, rest) = squared_distance(sources.pose(view as u32), target);
        squares[view] = (square, rest);
        if square < least.0 || (square == least.0 && rest < least.1) {
            least = (square, rest);
        }
        // False for a square that overflowed, too.
        is_exact &= square <= MAX_EXACT_DISTANCE * MAX_EXACT_DISTANCE;
        view += 1;
    }
    let mut scores = [0.0; S];
    if is_exact {
        view = 0;
        while view < count {
            // Relative to the nearest source, so that the largest weight never underflows.
            let (excess, rest) = two_sum(squares[view].0, -least.0);
            let rest = rest + (squares[view].1 - least.1);
            // A relative error of an exponent is an absolute error of the logarithm of a weight: an exponent of 40 in
            // f32 alone would cost 5e-6. So it is kept with its rounding error, and the exponential corrected by that.
            let (product, error) = two_product(beta, excess);
            let (exponent, error) = two_sum(product, error + beta * rest);
            scores[view] = exp(-exponent) * (1.0 - error);
            view += 1;
        }
    } else {
        // So far away the squares overflow; d^2 - n^2 = (d - n)(d + n).
        let (distances, _) = distances(sources, target);
        let mut near = f32::INFINITY;
        view = 0;
        while view < count {
            near = min(distances[view], near);
            view += 1;
        }
        view = 0;
        while view < count {
            let far = distances[view];
            scores[view] = if far > near && beta > 0.0 { exp(-(beta * (far - near)) * (far + near)) } else { 1.0 };
            view += 1;
        }
    }
    Weights::from_scores(&scores, sources.count())
}

/// Distance up to which the Gaussian's exponent is kept with its rounding error.
const MAX_EXACT_DISTANCE: f32 = 1.0e6;
/// The same for `beta`.
const MAX_EXACT_BETA: f32 = 1.0e6;

/// Squared distance of two cameras' centres, as the rounded value and the rest. Where the square overflows, neither is
/// below infinity.
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
    two_sum(sum, rest)
}

/// `x^power` for `power` in 1..=3.
fn integer_power(x: f32, power: u32) -> f32 {
    match power {
        1 => x,
        2 => x * x,
        _ => x * x * x,
    }
}

/// Equal weights.
pub(super) fn mean<const S: usize>(sources: &Sources<S>, _: &Pose, _: u32, _: f32) -> Weights<S> {
    Weights::mean(sources.count())
}

/// Weights by `e = sum |T - S|`.
pub(super) fn l1<const S: usize>(sources: &Sources<S>, target: &Pose, _: u32, _: f32) -> Weights<S> {
    inverse(sources, target, pose_difference_l1)
}

/// Weights by `e = |T - S|_F`.
pub(super) fn frobenius<const S: usize>(sources: &Sources<S>, target: &Pose, _: u32, _: f32) -> Weights<S> {
    inverse(sources, target, pose_difference_frobenius)
}

/// Weights by `e = |S T^-1|_F`.
pub(super) fn relative_frobenius<const S: usize>(sources: &Sources<S>, target: &Pose, _: u32, _: f32) -> Weights<S> {
    inverse(sources, target, relative_pose_frobenius)
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
