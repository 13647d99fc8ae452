//! The cameras of a scene as a whole: their focus, their distance from it, and the up direction.

use crate::scene::frame;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};

/// Cameras seen as one arrangement around a subject. World coordinates and units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    /// The point nearest to all principal axes, in the sense of least squares.
    pub focus: Vec3,
    /// Root mean square distance of the principal axes from the focus.
    pub axis_miss: f32,
    /// Mean distance of the camera centres from the focus.
    pub distance: f32,
    /// The up direction: the mean of the cameras' up directions, or the axis of their ring where those cancel. Unit.
    pub up: Vec3,
    /// Radius of the ball around the focus that a camera sees whole or in part: the mean over the cameras of the
    /// focus's depth times half the image's diagonal over the focal length.
    pub subject_radius: f32,
}

impl Rig {
    /// The rig of these cameras, of which there must be at least one. A single camera, or cameras whose axes are
    /// parallel, leave the focus undetermined along the axes: it is then put one unit, or the cameras' spread, ahead.
    pub fn of(cameras: &[Camera]) -> Rig {
        let count = cameras.len().max(1) as f32;
        let centroid = cameras.iter().map(|c| c.pose.centre_world()).sum::<Vec3>() / count;
        let spread = cameras.iter().map(|c| c.pose.centre_world().distance(centroid)).sum::<f32>() / count;
        let axes: Vec<(Vec3, Vec3)> = cameras.iter().map(|c| (c.pose.centre_world(), c.pose.forward_world())).collect();
        let focus = nearest_point_to_lines(&axes).unwrap_or_else(|| {
            let ahead = cameras.iter().map(|c| c.pose.forward_world()).sum::<Vec3>() / count;
            centroid + ahead * if spread > 0.0 { spread } else { 1.0 }
        });
        let offsets = || cameras.iter().map(move |c| (c, focus - c.pose.centre_world()));
        let squared_miss: f32 = offsets()
            .map(|(c, to)| (to - c.pose.forward_world() * to.dot(c.pose.forward_world())).length_squared())
            .sum();
        let distance = offsets().map(|(_, to)| to.length()).sum::<f32>() / count;
        let subject_radius = offsets()
            .map(|(c, to)| to.dot(c.pose.forward_world()).abs() * half_diagonal_slope(&c.pinhole))
            .sum::<f32>()
            / count;
        Rig {
            focus,
            axis_miss: (squared_miss / count).sqrt(),
            distance,
            up: up_direction(cameras, focus),
            subject_radius,
        }
    }

    /// The point that the cameras look at: in the sense of least squares where their principal axes meet, which is in
    /// front of all of them and in their pictures, or beyond these by no more than half their sides. `None` for a single
    /// camera, and for axes that are nearly parallel, part from one another, or miss one another by much of what lies
    /// between the cameras: nothing says then how far away it is.
    pub fn meeting_point(cameras: &[Camera]) -> Option<Vec3> {
        let axes = || cameras.iter().map(|camera| camera.pose.forward_world());
        let angle = |a: Vec3| axes().map(|b| a.dot(b).clamp(-1.0, 1.0).acos()).fold(0.0, f32::max);
        if axes().map(angle).fold(0.0, f32::max) < MIN_MEETING_ANGLE {
            return None;
        }
        let Rig { focus, axis_miss, .. } = Rig::of(cameras);
        let count = cameras.len() as f32;
        let centroid = cameras.iter().map(|camera| camera.pose.centre_world()).sum::<Vec3>() / count;
        let squares = cameras.iter().map(|camera| camera.pose.centre_world().distance_squared(centroid));
        if axis_miss > MAX_MISS * (squares.sum::<f32>() / count).sqrt() {
            return None;
        }
        let is_seen = |camera: &Camera| {
            let to = focus - camera.pose.centre_world();
            let depth = to.dot(camera.pose.forward_world());
            let slope = (to - camera.pose.forward_world() * depth).length() / depth;
            depth > 0.0 && slope <= 2.0 * half_diagonal_slope(&camera.pinhole)
        };
        cameras.iter().all(is_seen).then_some(focus)
    }

    /// The angle between a camera and the nearest other one, seen from the focus, in degrees: of all cameras,
    /// ascending; none of fewer than two.
    pub fn gaps(&self, cameras: &[Camera]) -> Vec<f32> {
        let mut gaps = self.nearest(cameras);
        gaps.sort_by(f32::total_cmp);
        gaps
    }

    /// For each camera the angle to the nearest other one, in degrees, seen from the focus; none for fewer than two.
    pub fn nearest(&self, cameras: &[Camera]) -> Vec<f32> {
        let directions: Vec<Vec3> =
            cameras.iter().map(|c| (c.pose.centre_world() - self.focus).normalize_or_zero()).collect();
        let nearest = |camera: usize| {
            let others = directions.iter().enumerate().filter(|(other, _)| *other != camera);
            others.map(|(_, other)| other.dot(directions[camera]).clamp(-1.0, 1.0).acos().to_degrees()).reduce(f32::min)
        };
        (0..cameras.len()).filter_map(nearest).collect()
    }

    /// The median of [`Rig::gaps`]; `None` for fewer than two cameras.
    pub fn median_gap(&self, cameras: &[Camera]) -> Option<f32> {
        let gaps = self.gaps(cameras);
        gaps.get(gaps.len() / 2).copied()
    }
}

/// Greatest angle between two principal axes, radians, below which they are taken for parallel: poses that were found
/// from photographs are off by some tenths of a degree.
const MIN_MEETING_ANGLE: f32 = 0.03;

/// Most that axes may miss the point where they meet, as a share of how far their cameras spread: beyond that it is a
/// crossing by chance.
const MAX_MISS: f32 = 0.3;

/// Angle between neighbouring views, seen from what they look at, beyond which depths are no longer found in whole
/// photographs.
pub(crate) const MAX_GAP_DEGREES: f32 = 15.0;

/// A warning if neighbouring views are too far apart to find depths in whole photographs. `cameras` are the sources'.
pub fn gap_warning(cameras: &[Camera]) -> Option<String> {
    let gap = Rig::of(cameras).median_gap(cameras).filter(|gap| *gap > MAX_GAP_DEGREES)?;
    Some(format!(
        "a view and the one nearest to it are {gap:.0} degrees apart (median): depths in whole photographs are found \
         reliably up to about {MAX_GAP_DEGREES:.0} degrees; take photographs between them"
    ))
}

/// `count` of the points, each next one as far from those before as possible (farthest-point sampling, starting with
/// the first point; of equally far ones the first), as ascending indices. All of them if there are fewer.
pub fn spread(points: &[Vec3], count: usize) -> Vec<usize> {
    let mut chosen: Vec<usize> = Vec::new();
    let mut gaps = vec![f32::INFINITY; points.len()];
    while chosen.len() < count.min(points.len()) {
        let rest = (0..points.len()).filter(|point| !chosen.contains(point));
        let Some(next) = rest.rev().max_by(|a, b| gaps[*a].total_cmp(&gaps[*b])) else { break };
        gaps.iter_mut().zip(points).for_each(|(gap, point)| *gap = gap.min(point.distance(points[next])));
        chosen.push(next);
    }
    chosen.sort_unstable();
    chosen
}

/// Half the image's diagonal over the focal length: the slope of the ray through a corner.
pub(crate) fn half_diagonal_slope(pinhole: &Pinhole) -> f32 {
    let [fx, fy] = pinhole.focal();
    (pinhole.width() as f32 / (2.0 * fx)).hypot(pinhole.height() as f32 / (2.0 * fy))
}

/// The point nearest to lines given by a point and a unit direction each, in the sense of least squares, or `None`
/// where they are too nearly parallel.
pub fn nearest_point_to_lines(lines: &[(Vec3, Vec3)]) -> Option<Vec3> {
    let lines: Vec<_> = lines.iter().map(|(point, direction)| (point.as_dvec3(), direction.as_dvec3())).collect();
    frame::nearest_point_to_lines(&lines).map(|point| point.as_vec3())
}

/// Least length of a mean of up directions that says where up is: upright cameras at up to 70 degrees of elevation keep
/// a third of theirs.
const MIN_UP: f32 = 0.3;
/// Cosine of the roll from which on a camera is turned on its side, or over.
const MAX_ROLL_COSINE: f32 = std::f32::consts::FRAC_1_SQRT_2;

/// Mean up direction of the cameras, without those of a minority that are turned on their sides or over; where rolled
/// cameras cancel it, the axis of least variance of their centres, on the side on which the cameras are.
fn up_direction(cameras: &[Camera], focus: Vec3) -> Vec3 {
    let count = cameras.len().max(1) as f32;
    let mean_up = cameras.iter().map(|c| -c.pose.down_world()).sum::<Vec3>() / count;
    if mean_up.length() > MIN_UP {
        return upright_mean(cameras, mean_up).normalize();
    }
    let centroid = cameras.iter().map(|c| c.pose.centre_world()).sum::<Vec3>() / count;
    let mut covariance = glam::DMat3::ZERO;
    for camera in cameras {
        let d = (camera.pose.centre_world() - centroid).as_dvec3();
        covariance += glam::DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
    if !(trace > 0.0) {
        return mean_up.try_normalize().unwrap_or(Vec3::Z);
    }
    // Inverse iteration towards the least eigenvector; the shift keeps the matrix regular.
    let inverse = (covariance + glam::DMat3::from_diagonal(glam::DVec3::splat(trace * 1.0e-6))).inverse();
    let mut axis = glam::DVec3::new(0.48, 0.6, 0.64);
    for _ in 0..64 {
        axis = (inverse * axis).normalize();
    }
    let axis = axis.as_vec3();
    if (centroid - focus).dot(axis) < 0.0 { -axis } else { axis }
}

/// The mean up direction of the cameras that are upright by this one, which is all but a few's, and by what it becomes.
fn upright_mean(cameras: &[Camera], mut mean_up: Vec3) -> Vec3 {
    let mut kept = cameras.len();
    loop {
        let up = mean_up.normalize();
        let is_upright = |camera: &&Camera| {
            let forward = camera.pose.forward_world();
            let in_picture = up - forward * up.dot(forward);
            // A camera that looks up or down has no roll.
            in_picture.length() < MIN_UP || -camera.pose.down_world().dot(up) >= MAX_ROLL_COSINE * in_picture.length()
        };
        let upright: Vec<Vec3> = cameras.iter().filter(is_upright).map(|c| -c.pose.down_world()).collect();
        let mean = upright.iter().sum::<Vec3>() / upright.len().max(1) as f32;
        if upright.len() >= kept || 2 * upright.len() <= cameras.len() || mean.length() <= MIN_UP {
            return mean_up;
        }
        (mean_up, kept) = (mean, upright.len());
    }
}
