//! Poses that were found, beside those that are known.

use glam::{DMat3, DQuat, DVec3, Vec3};
use viewfuse_core::pose::Pose;
use viewfuse_pose::Solution;
use viewfuse_scene::Scene;

/// Errors of poses, in degrees and percent.
pub(super) struct Errors {
    /// Photographs.
    pub(super) count: usize,
    /// Median over pairs of the angle between relative rotations.
    pub(super) rotation: f64,
    /// The greatest of these.
    pub(super) worst: f64,
    /// Root mean square distance of the aligned centres, of their spread.
    pub(super) centres: f64,
}

/// The errors of these photographs of a solution; `view_of` gives a photograph's view in the scene with known poses.
pub(super) fn errors(scene: &Scene, solution: &Solution, photos: &[usize], view_of: impl Fn(usize) -> usize) -> Errors {
    let known: Vec<&Pose> = photos.iter().map(|photo| &scene.views[view_of(*photo)].camera.pose).collect();
    let rotations: Vec<DMat3> = known.iter().map(|pose| camera_from_world(pose)).collect();
    let found: Vec<DMat3> =
        photos.iter().map(|photo| solution.photographs[*photo].rotation().unwrap_or(DMat3::IDENTITY)).collect();
    let mut angles = Vec::new();
    for first in 0..photos.len() {
        for second in 0..first {
            let own = found[first] * found[second].transpose();
            angles.push(degrees(own * rotations[second] * rotations[first].transpose()));
        }
    }
    angles.sort_by(f64::total_cmp);
    let at = |place: usize| angles.get(place).copied().unwrap_or(0.0);
    let centres: Vec<DVec3> = photos.iter().filter_map(|photo| solution.photographs[*photo].centre()).collect();
    let known: Vec<DVec3> = known.iter().map(|pose| pose.centre_world().as_dvec3()).collect();
    let worlds = rotations.iter().zip(&found).map(|(known, found)| known.transpose() * *found);
    let (rotation, worst) = (at(angles.len() / 2), at(angles.len().saturating_sub(1)));
    Errors { count: photos.len(), rotation, worst, centres: 100.0 * misfit(&centres, &known, mean(worlds)) }
}

fn camera_from_world(pose: &Pose) -> DMat3 {
    let axes = [pose.right_world(), pose.down_world(), pose.forward_world()].map(|axis| axis.as_dvec3());
    DMat3::from_cols(axes[0], axes[1], axes[2]).transpose()
}

fn degrees(rotation: DMat3) -> f64 {
    2.0 * DQuat::from_mat3(&rotation).normalize().w.abs().min(1.0).acos().to_degrees()
}

/// The similarity that moves points of a scene with these poses to one with those: the mean turn between them, and the scale and way
/// of least squares between their centres.
pub(super) fn similarity(found: &[Pose], known: &[Pose]) -> impl Fn(Vec3) -> Vec3 + use<> {
    let turn = mean(found.iter().zip(known).map(|(a, b)| camera_from_world(b).transpose() * camera_from_world(a)));
    let centres = |poses: &[Pose]| poses.iter().map(|pose| pose.centre_world().as_dvec3()).collect::<Vec<_>>();
    let (from, to) = (centred(centres(found)), centred(centres(known)));
    let scale = scale(&from.1.iter().map(|own| turn * *own).collect::<Vec<_>>(), &to.1);
    move |point: Vec3| (to.0 + scale * (turn * (point.as_dvec3() - from.0))).as_vec3()
}

/// The mean of points, and the points without it.
fn centred(points: Vec<DVec3>) -> (DVec3, Vec<DVec3>) {
    let mean = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    (mean, points.into_iter().map(|point| point - mean).collect())
}

fn dots(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// The scale of least squares from points to others, both without their means.
fn scale(from: &[DVec3], to: &[DVec3]) -> f64 {
    dots(from, to) / dots(from, from).max(f64::MIN_POSITIVE)
}

/// The mean of rotations that are near to one another.
fn mean(rotations: impl Iterator<Item = DMat3>) -> DMat3 {
    let mut sum: Option<DQuat> = None;
    for own in rotations.map(|rotation| DQuat::from_mat3(&rotation).normalize()) {
        sum = Some(sum.map_or(own, |sum| if sum.dot(own) < 0.0 { sum - own } else { sum + own }));
    }
    DMat3::from_quat(sum.unwrap_or(DQuat::IDENTITY).normalize())
}

/// Root mean square distance of points from known ones, turned by a rotation, scaled and moved by least squares, as a share of the
/// known ones' distance from their mean.
fn misfit(found: &[DVec3], known: &[DVec3], rotation: DMat3) -> f64 {
    let found = centred(found.iter().map(|point| rotation * *point).collect()).1;
    let known = centred(known.to_vec()).1;
    let scale = scale(&found, &known);
    let rest: Vec<DVec3> = found.iter().zip(&known).map(|(found, known)| scale * *found - *known).collect();
    (dots(&rest, &rest) / dots(&known, &known).max(f64::MIN_POSITIVE)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_that_was_turned_scaled_and_moved_is_moved_back() {
        let eyes = [Vec3::new(0.0, 0.0, 4.0), Vec3::new(1.0, 0.5, 3.5), Vec3::new(-1.0, 1.0, 3.0)];
        let known = eyes.map(|eye| Pose::look_at(eye, Vec3::ZERO, Vec3::Y).expect("a pose"));
        let turn = glam::Quat::from_rotation_x(0.7) * glam::Quat::from_rotation_z(0.4);
        let away = |point: Vec3| 0.3 * (turn * point) + Vec3::new(2.0, -1.0, 0.5);
        let found = eyes.map(|eye| Pose::look_at(away(eye), away(Vec3::ZERO), turn * Vec3::Y).expect("a pose"));
        let back = similarity(&found, &known);
        let point = Vec3::new(0.3, -0.2, 0.9);
        assert!((back(away(point)) - point).length() < 1.0e-5, "{}", back(away(point)));
    }
}
