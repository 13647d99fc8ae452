//! The world's place in the coordinates of a scene's files ([`SceneFrame`]).
//!
//! Cameras far from the origin are moved near to it before anything becomes `f32`. The origin is then put where their
//! principal axes meet, if they do: there networks that learned from objects expect the object.

use glam::{DMat3, DVec3};

use super::SceneFrame;

/// Distance of SRN's cameras from what they look at.
pub const SRN_DISTANCE: f32 = 1.3;

/// Largest distance of the cameras' centroid from the origin, as a multiple of their spread.
const FAR_FROM_ORIGIN: f64 = 16.0;

/// Spreads of cameras below this share of their distance from the origin are rounding errors of f64.
const MIN_SPREAD: f64 = 1.0e-12;

/// Decimal digits of the cameras' distances that a file must hold: fewer than f32 has.
const MIN_DIGITS: f64 = 6.0;

/// Range of the cameras' spread, in units of the file, for which the unit is kept.
const USUAL_SPREADS: std::ops::RangeInclusive<f64> = 1.0e-3..=1.0e4;

/// Least determinant, over the cube of the count, of the matrix of lines that are not parallel; of perpendicular ones
/// it is about 1/4.
const MIN_DETERMINANT: f64 = 1.0e-6;

/// The frame for cameras with these centres and principal axes (unit), in the coordinates of the files, and a warning
/// where the files' own numbers cannot hold the distances between the cameras.
pub(super) fn of(axes: &[(DVec3, DVec3)]) -> (SceneFrame, Option<String>) {
    let count = axes.len().max(1) as f64;
    let centroid = axes.iter().map(|(centre, _)| *centre / count).sum::<DVec3>();
    let spread = (axes.iter().map(|(centre, _)| centre.distance_squared(centroid) / count).sum::<f64>()).sqrt();
    let far = centroid.length();
    if !(spread.is_finite() && far.is_finite()) {
        return (SceneFrame::FILE, None);
    }
    // One camera, or several in one place except for rounding: there are no distances to preserve.
    if spread <= MIN_SPREAD * far {
        let origin = if far > *USUAL_SPREADS.end() { centroid } else { DVec3::ZERO };
        return (SceneFrame { origin, scale: 1.0 }, None);
    }
    let near = |point: &DVec3| point.distance(centroid) <= FAR_FROM_ORIGIN * spread;
    let origin = match far > FAR_FROM_ORIGIN * spread {
        true => nearest_point_to_lines(axes).filter(near).unwrap_or(centroid),
        false => DVec3::ZERO,
    };
    let scale = if USUAL_SPREADS.contains(&spread) { 1.0 } else { unit(axes, spread) };
    let digits = (spread / (far * f64::EPSILON)).log10();
    let warning = (digits < MIN_DIGITS).then(|| {
        format!(
            "the cameras are {spread:.3e} units apart and {far:.3e} from the origin: the files' numbers hold only {} \
             digits of their distances; subtract the offset before they are written",
            digits.max(0.0).floor()
        )
    });
    (SceneFrame { origin, scale }, warning)
}

/// The unit in which cameras, which spread so far, are as far from what they look at as SRN's; where they look at
/// nothing in common, in which their spread is that distance.
fn unit(axes: &[(DVec3, DVec3)], spread: f64) -> f64 {
    let mean = |focus: DVec3| axes.iter().map(|(centre, _)| centre.distance(focus)).sum::<f64>() / axes.len() as f64;
    let distance = nearest_point_to_lines(axes).map(mean).filter(|distance| distance.is_normal());
    distance.unwrap_or(spread) / f64::from(SRN_DISTANCE)
}

/// The point nearest to lines given by a point and a unit direction each, in the sense of least squares, or `None`
/// where they are too nearly parallel.
pub(crate) fn nearest_point_to_lines(lines: &[(DVec3, DVec3)]) -> Option<DVec3> {
    let count = lines.len() as f64;
    let centroid = lines.iter().map(|(point, _)| *point).sum::<DVec3>() / count.max(1.0);
    // Sum over lines of (I - d d^T) (p - c) = 0, in f64 because the matrix is nearly singular for narrow rigs.
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for &(point, d) in lines {
        let across = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        matrix += across;
        right += across * (point - centroid);
    }
    if !(matrix.determinant() / (count * count * count) > MIN_DETERMINANT) {
        return None;
    }
    Some(centroid + matrix.inverse() * right)
}
