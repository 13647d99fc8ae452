//! Rotations of two solutions between the same photographs: what does not depend on the world's orientation, place and
//! scale.

use crate::solution::Solution;
use glam::DMat3;
use viewfuse_job::medians;

/// For each of these photographs, which both solutions must have registered, the median over the others of the angle in
/// degrees between the two solutions' relative rotations; 0 for a photograph without others.
pub(crate) fn differences(a: &Solution, b: &Solution, photos: &[usize]) -> Vec<f64> {
    let rotations = |solution: &Solution| -> Vec<DMat3> {
        photos.iter().map(|photo| solution.photographs[*photo].rotation().unwrap_or(DMat3::IDENTITY)).collect()
    };
    let (a, b) = (rotations(a), rotations(b));
    let difference = |first: usize| {
        let others = (0..photos.len()).filter(|other| *other != first);
        // (A_first A_other^T) (B_first B_other^T)^T
        let angles = others.map(|other| degrees(a[first] * a[other].transpose() * b[other] * b[first].transpose()));
        median(angles)
    };
    (0..photos.len()).map(difference).collect()
}

/// The angle of a rotation.
pub(crate) fn degrees(rotation: DMat3) -> f64 {
    let trace = rotation.x_axis.x + rotation.y_axis.y + rotation.z_axis.z;
    // Near 0 the sine is exact where the cosine is not.
    let sine = DMat3::from_cols(
        rotation.x_axis - rotation.transpose().x_axis,
        rotation.y_axis - rotation.transpose().y_axis,
        rotation.z_axis - rotation.transpose().z_axis,
    );
    let axis = glam::DVec3::new(sine.y_axis.z, sine.z_axis.x, sine.x_axis.y);
    (0.5 * axis.length()).atan2(0.5 * (trace - 1.0)).to_degrees()
}

/// The median; of an even number the mean of the middle two; 0 of none.
pub(crate) fn median(numbers: impl IntoIterator<Item = f64>) -> f64 {
    medians::median(numbers).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solution::SolvedPhotograph;

    fn solution(rotations: &[DMat3]) -> Solution {
        let photograph = |rotation: &DMat3| {
            let t = rotation.transpose();
            let row = |row: glam::DVec3| [row.x, row.y, row.z, 0.0];
            let camera_from_world = Some([row(t.x_axis), row(t.y_axis), row(t.z_axis)]);
            SolvedPhotograph { camera_from_world, reason: None }
        };
        Solution { photographs: rotations.iter().map(photograph).collect(), ..Solution::default() }
    }

    #[test]
    fn a_turn_of_the_world_is_no_difference() {
        let turn = |degrees: f64| DMat3::from_rotation_y(degrees.to_radians());
        let turns = [turn(0.0), turn(10.0), turn(20.0), turn(30.0)];
        let world = DMat3::from_rotation_x(1.0);
        let same = solution(&turns.map(|rotation| rotation * world));
        let photos = [0, 1, 2, 3];
        assert!(differences(&solution(&turns), &same, &photos).iter().all(|difference| *difference < 1.0e-9));
        let one = solution(&[turns[0], turns[1], turn(25.0), turns[3]]);
        let found = differences(&solution(&turns), &one, &photos);
        assert!((found[2] - 5.0).abs() < 1.0e-9 && found[0] < 1.0e-9, "{found:?}");
    }

    #[test]
    fn angles_are_exact_at_both_ends() {
        for angle in [1.0e-7, 1.0, 90.0, 179.999] {
            assert!((degrees(DMat3::from_rotation_z(f64::to_radians(angle))) - angle).abs() < 1.0e-6, "{angle}");
        }
    }
}
