//! Poses refined by the photographs themselves: each is moved until what its neighbours show at its pose is nearest to it
//! (direct image alignment, as of Newcombe et al., "DTAM", 2011, with the field's depths and pictures as the model).
//!
//! ```text
//! r = truth - gain picture(pose)          differences of levels, over the pixels that the photograph shows
//! J = - grad picture  d(u, v) / d pose    the pixel's way in the picture, by its depth
//! (J^T W J + damping diag) step = J^T W r   W by Huber: what the neighbours cannot show must not pull
//! ```
//!
//! All photographs move at the same time, and then stand as neighbours at their new poses. A step that meets its photograph
//! no better is halved once, then given up. The whole is kept if the mean score of all photographs, left out again, is better
//! and no photograph is met clearly worse.

use crate::left_out::{Photographs, Rendered, Shown, open_album};
use glam::{DMat3, DVec3};
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_field::render::RenderError;
use viewfuse_job::progress::{Progress, Quiet};
use viewfuse_scene::Scene;
use viewfuse_scene::rig::Rig;

/// Times that all photographs move.
const SWEEPS: usize = 2;
/// Steps of a photograph each time.
const STEPS: usize = 2;
/// Damping, as a share of the diagonal.
const DAMPING: f64 = 0.05;
/// Longest step in pixels of the rendered picture.
const MAX_STEP: f64 = 1.0;
/// Differences of levels from which on they count linearly.
const HUBER: f64 = 0.1;
/// Least gain of the mean score in decibels for which refined poses are kept.
const MIN_GAIN: f64 = 0.02;
/// Most decibels that a photograph may lose.
const MAX_LOSS: f64 = 0.2;

/// A motion of a camera in its own axes (right, down, forward): a rotation vector in radians, a way in world units.
pub(crate) type Motion = [f64; 6];

/// What was refined.
pub(crate) struct Refined {
    /// The motions of each view, one after the other.
    pub(crate) motions: Vec<Vec<Motion>>,
    /// Mean score of the photographs, left out at the new poses.
    pub(crate) score: f64,
}

/// Refines the poses of a scene whose photographs have these scores when they are left out; `None` if that gains nothing.
///
/// # Errors
/// [`RenderError`].
pub(crate) fn refine(scene: &Scene, before: &[f64], progress: &dyn Progress) -> Result<Option<Refined>, RenderError> {
    let quiet = Quiet(progress);
    let album = open_album(scene, &quiet)?;
    let mut photographs = Photographs::of(scene, &album, &quiet)?;
    let mut motions = vec![Vec::new(); scene.views.len()];
    for _ in 0..SWEEPS {
        let cameras: Vec<_> = photographs.scene.views.iter().map(|view| view.camera).collect();
        let focus = Rig::of(&cameras).focus.as_dvec3();
        let steps = photographs.each(progress, |_, rendered| steps(rendered, focus))?;
        let end = |(camera, steps): (&Camera, &Vec<Motion>)| {
            steps.iter().try_fold(camera.pose, |pose, step| moved(&pose, step)).unwrap_or(camera.pose)
        };
        let poses: Vec<Pose> = cameras.iter().zip(&steps).map(end).collect();
        photographs = photographs.at(&poses);
        motions.iter_mut().zip(steps).for_each(|(all, steps)| all.extend(steps));
    }
    let after = photographs.each(progress, |_, rendered| rendered.score(rendered.camera.pose))?;
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len().max(1) as f64;
    let is_better = mean(&after) >= mean(before) + MIN_GAIN;
    let is_worse = before.iter().zip(&after).any(|(before, after)| after < &(before - MAX_LOSS));
    Ok((is_better && !is_worse).then(|| Refined { motions, score: mean(&after) }))
}

/// The motions that bring a photograph nearer to what its neighbours show.
fn steps(rendered: &mut Rendered<'_>, focus: DVec3) -> Result<Vec<Motion>, RenderError> {
    let mut pose = rendered.camera.pose;
    let mut shown = rendered.shown(pose)?;
    let mut motions = Vec::new();
    'steps: for _ in 0..STEPS {
        let Some(full) = step(rendered, &pose, &shown, focus) else { break };
        for share in [1.0, 0.5] {
            let motion = full.map(|own| share * own);
            let Some(next) = moved(&pose, &motion) else { continue };
            let there = rendered.shown(next)?;
            if rendered.truth.score(&there.picture) > rendered.truth.score(&shown.picture) {
                (pose, shown) = (next, there);
                motions.push(motion);
                continue 'steps;
            }
        }
        break;
    }
    Ok(motions)
}

/// The damped least-squares step at a pose; `None` where the picture does not tell one.
fn step(rendered: &Rendered<'_>, pose: &Pose, shown: &Shown, focus: DVec3) -> Option<Motion> {
    let (width, height) = shown.picture.dimensions();
    let pinhole = rendered.camera.pinhole.resized(width, height).ok()?;
    let focal = pinhole.focal().map(f64::from);
    let principal = pinhole.principal().map(f64::from);
    // A pixel as an angle, and as a way at the distance of what the cameras look at.
    let (angle, distance) = (1.0 / focal[0], focus.distance(pose.centre_world().as_dvec3()));
    let units: Motion = [angle, angle, angle, angle * distance, angle * distance, angle * distance];
    let (differences, gains) = rendered.truth.differences(&shown.picture);
    let mut rows = [[0.0; 7]; 6];
    for ((x, y), difference) in rendered.truth.places().zip(differences.chunks_exact(3)) {
        let depth = f64::from(shown.depth([x, y]));
        if depth <= 0.0 || x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            continue;
        }
        // The point's place, and per motion of the camera its way: -way - turn x point.
        let across = [(x, focal[0], principal[0]), (y, focal[1], principal[1])];
        let [a, b] = across.map(|(own, focal, principal)| (f64::from(own) + 0.5 - principal) / focal);
        let flow_u = [a * b, -(1.0 + a * a), b, -1.0 / depth, 0.0, a / depth].map(|own| focal[0] * own);
        let flow_v = [1.0 + b * b, -a * b, -a, 0.0, -1.0 / depth, b / depth].map(|own| focal[1] * own);
        let level = |x: u32, y: u32, channel: usize| f64::from(shown.picture.get_pixel(x, y)[channel]) / 255.0;
        for channel in 0..3 {
            let slope_u = 0.5 * (level(x + 1, y, channel) - level(x - 1, y, channel));
            let slope_v = 0.5 * (level(x, y + 1, channel) - level(x, y - 1, channel));
            let derivative: [f64; 6] = std::array::from_fn(|axis| {
                -gains[channel] * units[axis] * (slope_u * flow_u[axis] + slope_v * flow_v[axis])
            });
            let weight = HUBER / difference[channel].abs().max(HUBER);
            for row in 0..6 {
                let own = weight * derivative[row];
                rows[row][..6].iter_mut().zip(derivative).for_each(|(sum, other)| *sum += own * other);
                rows[row][6] += own * difference[channel];
            }
        }
    }
    (0..6).for_each(|axis| rows[axis][axis] *= 1.0 + DAMPING);
    let found = solve(rows)?;
    let longest = found.iter().fold(0.0_f64, |longest, own| longest.max(own.abs()));
    let share = (MAX_STEP / longest.max(f64::MIN_POSITIVE)).min(1.0);
    Some(std::array::from_fn(|axis| share * found[axis] * units[axis]))
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
            let pivot = rows[column];
            rows[row].iter_mut().zip(pivot).for_each(|(own, pivot)| *own -= factor * pivot);
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
