//! Poses that were found, beside those that are known.

use glam::{DMat3, DQuat, DVec3};
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
    let count = known.len().max(1) as f64;
    let centred = |points: Vec<DVec3>| {
        let mean = points.iter().sum::<DVec3>() / count;
        points.into_iter().map(move |point| point - mean).collect::<Vec<_>>()
    };
    let found = centred(found.iter().map(|point| rotation * *point).collect());
    let known = centred(known.to_vec());
    let of = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let scale = of(&found, &known) / of(&found, &found).max(f64::MIN_POSITIVE);
    let rest: Vec<DVec3> = found.iter().zip(&known).map(|(found, known)| scale * *found - *known).collect();
    (of(&rest, &rest) / of(&known, &known).max(f64::MIN_POSITIVE)).sqrt()
}
