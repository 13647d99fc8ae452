//! Camera paths that follow from the cameras of a scene.

use std::f32::consts::TAU;

use glam::{DMat3, DQuat, DVec3};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole, PinholeError};
use viewfuse_core::pose::{Pose, PoseError};

use super::arc::Arc;
use crate::rig::{Rig, nearest_point_to_lines};

/// Turns of a spiral, as in LLFF.
const TURNS: f32 = 2.0;
/// Turns towards the subject and back, for each turn around.
const TURNS_TOWARDS: f32 = 0.5;
/// Share of the cameras' offsets from their middle that a spiral's radii exceed, as in LLFF.
const QUANTILE: f32 = 0.9;
/// Share of the far bound's disparity in that of the point on a spiral's principal axes, as in LLFF.
const FAR_SHARE: f32 = 0.75;
/// Least length of the mean principal axis of forward-facing cameras: 45 degrees from it on average.
const MIN_COMMON: f32 = 0.7;

/// `count` cameras on an arc around the focus of some cameras (at least one), at the mean height and distance of those
/// that stand on it, their principal axes through the focus, with the rig's up direction.
///
/// # Errors
/// [`PoseError`] if the circle degenerates (all cameras at the focus, or straight above it).
pub fn orbit(cameras: &[Camera], arc: &Arc, pinhole: Pinhole, count: usize) -> Result<Vec<Camera>, PoseError> {
    let Rig { focus, up, .. } = Rig::of(cameras);
    let offsets = || arc.cameras.iter().filter_map(|&index| Some(cameras.get(index)?.pose.centre_world() - focus));
    let mean = |value: &dyn Fn(Vec3) -> f32| offsets().map(value).sum::<f32>() / offsets().count().max(1) as f32;
    let (distance, height) = (mean(&Vec3::length), mean(&|offset| offset.dot(up)));
    let radius = (distance * distance - height * height).max(0.0).sqrt();
    let camera = |direction: Vec3| {
        let centre = focus + up * height + direction * radius;
        Ok(Camera { pose: Pose::look_at(centre, focus, up)?, pinhole })
    };
    arc.directions(count).map(camera).collect()
}

/// `count` cameras from the first to the last one, both included (one alone is the first).
///
/// If both principal axes meet in a point in front of them, the centre goes around it, the shorter way about `up`
/// (unit): height, distance from the axis and angle change at constant rates, and the point moves in the pictures as
/// little as the ends demand. Otherwise, and where an end is straight above the point, the centre moves on a line and
/// the rotation at a constant rate (slerp). Focal length and principal point change with the step; the size is that of
/// the first.
///
/// # Errors
/// [`PoseError`] if a pose between them is none: never for finite cameras.
pub fn between(first: &Camera, last: &Camera, up: Vec3, count: usize) -> Result<Vec<Camera>, PoseError> {
    let around = Around::of(first, last, up);
    let [from, to] = [first, last].map(|camera| camera.pose.centre_world().as_dvec3());
    let [turned_from, turned_to] = [first, last].map(|camera| rotation(&camera.pose));
    (0..count)
        .map(|frame| {
            let step = if count > 1 { frame as f64 / (count - 1) as f64 } else { 0.0 };
            let pose = match &around {
                Some(around) => around.pose(step)?,
                None => pose_of(turned_from.slerp(turned_to, step), from.lerp(to, step))?,
            };
            // Two pinholes in range have none out of range between them.
            let pinhole = mixed(&first.pinhole, &last.pinhole, step as f32).unwrap_or(first.pinhole);
            Ok(Camera { pose, pinhole })
        })
        .collect()
}

/// The way around a subject.
struct Around {
    subject: Vec3,
    up: Vec3,
    /// Two directions across `up`, the first towards the first camera.
    across: [DVec3; 2],
    /// Of the first camera and of the last: height above the subject, distance from the axis, angle.
    places: [DVec3; 2],
    /// Of both: the rotation relative to a principal axis through the subject.
    turns: [DQuat; 2],
}

impl Around {
    /// `None` without a point where both principal axes meet, and if one of them is straight above it.
    fn of(first: &Camera, last: &Camera, up: Vec3) -> Option<Around> {
        let subject = common_subject(first, last)?;
        let axis = up.as_dvec3();
        let [from, to] = [first, last].map(|camera| (camera.pose.centre_world() - subject).as_dvec3());
        let [flat_from, flat_to] = [from, to].map(|offset| offset - axis * offset.dot(axis));
        let ahead = flat_from.try_normalize()?;
        let across = [ahead, axis.cross(ahead)];
        // Between minus and plus half a turn: the shorter way.
        let angle = flat_to.dot(across[1]).atan2(flat_to.dot(across[0]));
        let place = |offset: DVec3, flat: DVec3, angle: f64| DVec3::new(offset.dot(axis), flat.length(), angle);
        let places = [place(from, flat_from, 0.0), place(to, flat_to, angle)];
        let turn = |camera: &Camera| {
            let centred = Pose::look_at(camera.pose.centre_world(), subject, up).ok()?;
            Some(rotation(&centred).inverse() * rotation(&camera.pose))
        };
        Some(Around { subject, up, across, places, turns: [turn(first)?, turn(last)?] })
    }

    fn pose(&self, step: f64) -> Result<Pose, PoseError> {
        let place = self.places[0].lerp(self.places[1], step);
        let (sine, cosine) = place.z.sin_cos();
        let flat = (self.across[0] * cosine + self.across[1] * sine) * place.y;
        let centre = self.subject.as_dvec3() + self.up.as_dvec3() * place.x + flat;
        let centred = Pose::look_at(centre.as_vec3(), self.subject, self.up)?;
        pose_of(rotation(&centred) * self.turns[0].slerp(self.turns[1], step), centre)
    }
}

/// `count` cameras on LLFF's spiral for forward-facing cameras: around their middle, two turns within the offsets that
/// nine of ten cameras do not exceed, their principal axes through one point ahead of it. Its depth is between the near
/// and far `bounds` of the views, nearer to the far one; without bounds, that of the cameras' focus.
///
/// `None` if the cameras are not forward-facing, or are all in one place.
pub fn spiral(cameras: &[Camera], pinhole: Pinhole, bounds: &[[f32; 2]], count: usize) -> Option<Vec<Camera>> {
    let number = cameras.len().max(1) as f32;
    let mean = |of: &dyn Fn(&Camera) -> Vec3| cameras.iter().map(of).sum::<Vec3>() / number;
    let forward = mean(&|camera| camera.pose.forward_world());
    if forward.length() < MIN_COMMON {
        return None;
    }
    let middle = mean(&|camera| camera.pose.centre_world());
    let down = mean(&|camera| camera.pose.down_world());
    let mean_pose = Pose::look_at(middle, middle + forward, -down).ok()?;
    let offsets: Vec<Vec3> = cameras.iter().map(|camera| mean_pose.to_camera(camera.pose.centre_world())).collect();
    let radii = [0, 1, 2].map(|axis| quantile(offsets.iter().map(|offset| offset[axis].abs()).collect()));
    if radii.iter().all(|radius| *radius <= 0.0) {
        return None;
    }
    let depth = depth_of(bounds).unwrap_or_else(|| {
        let ahead = mean_pose.to_camera(Rig::of(cameras).focus).z;
        if ahead > 0.0 { ahead } else { 10.0 * radii[0].max(radii[1]) }
    });
    let subject = middle + mean_pose.forward_world() * depth;
    (0..count)
        .map(|frame| {
            let angle = TURNS * TAU * frame as f32 / count as f32;
            let offset = Vec3::new(angle.cos(), angle.sin(), (TURNS_TOWARDS * angle).sin());
            let centre = middle + mean_pose.rotate_to_world(offset * Vec3::from(radii));
            Some(Camera { pose: Pose::look_at(centre, subject, -mean_pose.down_world()).ok()?, pinhole })
        })
        .collect()
}

/// The depth of bounds of views, by their disparities.
fn depth_of(bounds: &[[f32; 2]]) -> Option<f32> {
    let near = bounds.iter().map(|[near, _]| *near).reduce(f32::min)?;
    let far = bounds.iter().map(|[_, far]| *far).reduce(f32::max)?;
    Some(1.0 / ((1.0 - FAR_SHARE) / near + FAR_SHARE / far))
}

/// The value that nine of ten do not exceed; 0 of none.
fn quantile(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    let at = QUANTILE * values.len().saturating_sub(1) as f32;
    let value = |index: usize| values.get(index).copied().unwrap_or_default();
    let low = value(at as usize);
    low + (value((at as usize + 1).min(values.len().saturating_sub(1))) - low) * at.fract()
}

/// The point nearest to both principal axes, if it is in front of both cameras.
fn common_subject(first: &Camera, last: &Camera) -> Option<Vec3> {
    let axes = [first, last].map(|camera| (camera.pose.centre_world(), camera.pose.forward_world()));
    let point = nearest_point_to_lines(&axes)?;
    let is_ahead = |camera: &Camera| camera.pose.to_camera(point).z > 0.0;
    (is_ahead(first) && is_ahead(last)).then_some(point)
}

/// The rotation from the camera to the world.
fn rotation(pose: &Pose) -> DQuat {
    let axes = [pose.right_world(), pose.down_world(), pose.forward_world()];
    let [x, y, z] = axes.map(|axis| axis.as_dvec3());
    DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize()
}

fn pose_of(rotation: DQuat, centre: DVec3) -> Result<Pose, PoseError> {
    let axes = DMat3::from_quat(rotation);
    let columns = [axes.x_axis, axes.y_axis, axes.z_axis, centre];
    let entry = |row: usize, column: usize| if row < 3 { columns[column][row] } else { f64::from(column == 3) };
    Pose::from_opencv(&std::array::from_fn(|row| std::array::from_fn(|column| entry(row, column) as f32)))
}

/// A pinhole between two, of the first one's size.
fn mixed(first: &Pinhole, last: &Pinhole, step: f32) -> Result<Pinhole, PinholeError> {
    let (width, height) = (first.width(), first.height());
    let last = last.resized(width, height)?;
    let mix = |a: [f32; 2], b: [f32; 2]| [a[0] + step * (b[0] - a[0]), a[1] + step * (b[1] - a[1])];
    Pinhole::new(mix(first.focal(), last.focal()), mix(first.principal(), last.principal()), width, height)
}
