//! Poses refined by the photographs themselves: each is moved until what its neighbours show at its pose is nearest to it.
//!
//! ```text
//! r = truth - gain picture(pose)            differences of levels, over the pixels that the photograph shows
//! J = d picture / d pose                    six central differences of rendered pictures, half a pixel to each side
//! (J^T W J + damping diag) step = J^T W r   W by Huber: what the neighbours cannot show must not pull
//! ```
//!
//! All photographs move at the same time, and then stand as neighbours at their new poses. A step that meets its photograph
//! no better is halved, then given up. The whole is kept if the mean score of all photographs, left out again, is better.

use crate::left_out::{LeftOut, Photographs, Rendered, open_album};
use glam::{DMat3, DVec3};
use viewfuse_core::pose::Pose;
use viewfuse_field::render::RenderError;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_scene::Scene;
use viewfuse_scene::rig::Rig;

/// Times that all photographs move.
const SWEEPS: usize = 3;
/// Half of the difference for a derivative, in pixels of the rendered picture.
const DIFFERENCE: f64 = 0.5;
/// Damping, as a share of the diagonal.
const DAMPING: f64 = 0.05;
/// Longest step in pixels of the rendered picture.
const MAX_STEP: f64 = 1.0;
/// Differences of levels from which on they count linearly.
const HUBER: f64 = 0.1;
/// Least gain of the mean score in decibels for which refined poses are kept.
const MIN_GAIN: f64 = 0.02;

/// A motion of a camera in its own axes (right, down, forward): a rotation vector in radians, a way in world units.
pub(crate) type Motion = [f64; 6];

/// What was refined.
pub(crate) struct Refined {
    /// The motions of each view, one after the other.
    pub(crate) motions: Vec<Vec<Motion>>,
    /// The photographs, left out at the new poses.
    pub(crate) left_out: Vec<LeftOut>,
}

/// Refines the poses of a scene whose photographs scored so when they were left out; `None` if that gains nothing.
///
/// # Errors
/// [`RenderError`].
pub(crate) fn refine(
    scene: &Scene,
    before: &[LeftOut],
    progress: &dyn Progress,
) -> Result<Option<Refined>, RenderError> {
    let quiet = Quiet(progress);
    let album = open_album(scene, &quiet)?;
    let mut photographs = Photographs::of(scene, &album, &quiet)?;
    let mut motions = vec![Vec::new(); scene.views.len()];
    for _ in 0..SWEEPS {
        let focus = Rig::of(&scene.views.iter().map(|view| view.camera).collect::<Vec<_>>()).focus;
        let steps = photographs.each(progress, |_, rendered| step(rendered, focus.as_dvec3()))?;
        let poses: Vec<Pose> = photographs
            .scene
            .views
            .iter()
            .zip(&steps)
            .map(|(view, step)| moved(&view.camera.pose, step).unwrap_or(view.camera.pose))
            .collect();
        photographs = photographs.at(&poses);
        motions.iter_mut().zip(steps).for_each(|(all, step)| all.push(step));
    }
    let left_out = photographs.left_out(progress)?;
    let mean = |all: &[LeftOut]| all.iter().map(|own| own.score).sum::<f64>() / all.len().max(1) as f64;
    Ok((mean(&left_out) >= mean(before) + MIN_GAIN).then_some(Refined { motions, left_out }))
}

/// The motion that brings a photograph nearest to what its neighbours show; none where no step does.
fn step(rendered: &mut Rendered<'_>, focus: DVec3) -> Result<Motion, RenderError> {
    let camera = rendered.camera;
    let (pose, pinhole) = (camera.pose, camera.pinhole);
    let longest = f64::from(pinhole.width().max(pinhole.height()));
    let picture = rendered.picture(pose)?;
    let pixels = longest / f64::from(picture.width().max(picture.height()));
    // A pixel of the rendered picture, as an angle and as a way at the distance of what the cameras look at.
    let angle = pixels / f64::from(pinhole.focal()[0]);
    let way = angle * focus.distance(pose.centre_world().as_dvec3());
    let units: Motion = [angle, angle, angle, way, way, way];
    let (differences, gains) = rendered.truth.differences(&picture);
    let mut derivatives: Vec<Vec<f64>> = Vec::with_capacity(6);
    for axis in 0..6 {
        let mut levels = |share: f64| -> Result<Vec<f64>, RenderError> {
            let mut motion = [0.0; 6];
            motion[axis] = share * units[axis];
            let picture = rendered.picture(moved(&pose, &motion).unwrap_or(pose))?;
            Ok(rendered.truth.levels(&picture))
        };
        let (ahead, behind) = (levels(DIFFERENCE)?, levels(-DIFFERENCE)?);
        let of =
            |(index, (ahead, behind)): (usize, (f64, f64))| gains[index % 3] * (ahead - behind) / (2.0 * DIFFERENCE);
        derivatives.push(ahead.into_iter().zip(behind).enumerate().map(of).collect());
    }
    let weights: Vec<f64> = differences.iter().map(|own| (HUBER / own.abs().max(HUBER)).min(1.0)).collect();
    let sum = |a: &[f64], b: &[f64]| a.iter().zip(b).zip(&weights).map(|((a, b), w)| w * a * b).sum::<f64>();
    let mut matrix = [[0.0; 7]; 6];
    for row in 0..6 {
        for column in 0..6 {
            matrix[row][column] = sum(&derivatives[row], &derivatives[column]);
        }
        matrix[row][row] *= 1.0 + DAMPING;
        matrix[row][6] = sum(&derivatives[row], &differences);
    }
    let Some(mut found) = solve(matrix) else { return Ok([0.0; 6]) };
    let longest = found.iter().fold(0.0_f64, |longest, own| longest.max(own.abs()));
    found.iter_mut().for_each(|own| *own *= (MAX_STEP / longest.max(f64::MIN_POSITIVE)).min(1.0));
    let score = rendered.truth.score(&picture);
    for share in [1.0, 0.5, 0.25] {
        let motion: Motion = std::array::from_fn(|axis| share * found[axis] * units[axis]);
        if let Some(pose) = moved(&pose, &motion)
            && rendered.score(pose)? > score
        {
            return Ok(motion);
        }
    }
    Ok([0.0; 6])
}

/// Solves six equations by elimination with the largest pivot; `None` if one of them is empty.
fn solve(mut rows: [[f64; 7]; 6]) -> Option<[f64; 6]> {
    for column in 0..6 {
        let pivot = (column..6).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()))?;
        rows.swap(column, pivot);
        if rows[column][column].abs() < 1.0e-12 {
            return None;
        }
        for row in (0..6).filter(|row| *row != column) {
            let factor = rows[row][column] / rows[column][column];
            for place in column..7 {
                rows[row][place] -= factor * rows[column][place];
            }
        }
    }
    Some(std::array::from_fn(|row| rows[row][6] / rows[row][row]))
}

/// The turn of a motion.
pub(crate) fn turn(motion: &Motion) -> DMat3 {
    DMat3::from_quat(glam::DQuat::from_scaled_axis(DVec3::new(motion[0], motion[1], motion[2])))
}

/// A pose after a motion; `None` if it is none.
pub(crate) fn moved(pose: &Pose, motion: &Motion) -> Option<Pose> {
    let axes = [pose.right_world(), pose.down_world(), pose.forward_world()].map(|axis| axis.as_dvec3());
    let rotation = DMat3::from_cols(axes[0], axes[1], axes[2]);
    let centre = pose.centre_world().as_dvec3() + rotation * DVec3::new(motion[3], motion[4], motion[5]);
    let turned = rotation * turn(motion);
    let row = |row: usize| {
        [turned.x_axis[row] as f32, turned.y_axis[row] as f32, turned.z_axis[row] as f32, centre[row] as f32]
    };
    Pose::from_opencv(&[row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]).ok()
}
