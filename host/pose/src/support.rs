//! What the points tell of how well poses are determined: parallax, and whether all points lie in a plane.

use crate::agreement::median;
use crate::solution::Solution;
use glam::{DMat3, DVec3};
use viewfuse_job::progress::{Interrupted, Progress};

/// How well a solution is determined.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Support {
    /// Median over the points of the greatest angle in degrees between the directions to the cameras that saw it.
    pub parallax: f64,
    /// Extent of the points across their best plane, as a share of that along it: 0 for points in a plane.
    pub thickness: f64,
    /// Fewest points that a registered photograph saw.
    pub fewest_points: usize,
}

impl Support {
    pub(crate) fn of(solution: &Solution, progress: &dyn Progress) -> Result<Support, Interrupted> {
        let centres: Vec<Option<DVec3>> = solution.photographs.iter().map(|photograph| photograph.centre()).collect();
        let mut seen = vec![0_usize; solution.photographs.len()];
        let mut angles = Vec::new();
        for point in &solution.points {
            progress.check()?;
            let position = DVec3::from_array(point.position);
            let towards: Vec<DVec3> = point
                .seen
                .iter()
                .filter_map(|(photograph, _)| Some((centres[*photograph]? - position).normalize_or_zero()))
                .collect();
            let pairs = (0..towards.len()).flat_map(|first| (0..first).map(move |second| (first, second)));
            angles.extend(pairs.map(|(a, b)| towards[a].angle_between(towards[b]).to_degrees()).reduce(f64::max));
            point.seen.iter().for_each(|(photograph, _)| seen[*photograph] += 1);
        }
        let fewest_points = solution.registered().into_iter().map(|photograph| seen[photograph]).min().unwrap_or(0);
        Ok(Support { parallax: median(angles), thickness: thickness(solution), fewest_points })
    }
}

/// Square root of the least over that of the middle eigenvalue of the covariance of the points nearer to their median
/// than three median distances: single points far away do not count.
fn thickness(solution: &Solution) -> f64 {
    let points: Vec<DVec3> = solution.points.iter().map(|point| DVec3::from_array(point.position)).collect();
    let median_of = |axis: usize| median(points.iter().map(|point| point[axis]));
    let middle = DVec3::new(median_of(0), median_of(1), median_of(2));
    let reach = 3.0 * median(points.iter().map(|point| point.distance(middle)));
    let near: Vec<DVec3> = points.into_iter().filter(|point| point.distance(middle) <= reach).collect();
    let mean = near.iter().sum::<DVec3>() / near.len().max(1) as f64;
    let mut covariance = DMat3::ZERO;
    for point in &near {
        let offset = *point - mean;
        covariance += DMat3::from_cols(offset * offset.x, offset * offset.y, offset * offset.z);
    }
    let [least, middle, _] = eigenvalues(covariance);
    if middle > 0.0 { (least.max(0.0) / middle).sqrt() } else { 0.0 }
}

/// Of a symmetric matrix, ascending (Smith 1961, by the angle of the characteristic polynomial).
fn eigenvalues(m: DMat3) -> [f64; 3] {
    let mean = (m.x_axis.x + m.y_axis.y + m.z_axis.z) / 3.0;
    let shifted = m - DMat3::from_diagonal(DVec3::splat(mean));
    let squares = shifted.to_cols_array().iter().map(|entry| entry * entry).sum::<f64>();
    let radius = (squares / 6.0).sqrt();
    if radius <= 0.0 {
        return [mean; 3];
    }
    let angle = ((shifted * radius.recip()).determinant() / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    let third = std::f64::consts::TAU / 3.0;
    let (greatest, least) = (mean + 2.0 * radius * angle.cos(), mean + 2.0 * radius * (angle + third).cos());
    [least, 3.0 * mean - greatest - least, greatest]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvalues_of_a_turned_diagonal() {
        let turn = DMat3::from_rotation_x(0.7) * DMat3::from_rotation_y(0.3);
        let found = eigenvalues(turn * DMat3::from_diagonal(DVec3::new(3.0, 1.0, 2.0)) * turn.transpose());
        for (found, expected) in found.into_iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - expected).abs() < 1.0e-9, "{found}");
        }
        assert_eq!(eigenvalues(DMat3::IDENTITY), [1.0; 3]);
    }
}
