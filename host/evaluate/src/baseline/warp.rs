//! The homography between two cameras that a plane induces, and sampling of a photograph.
//!
//! A target pixel `(x, y)` has the direction `u = ((x - cx) / fx, (y - cy) / fy, 1)` in the target camera's
//! coordinates. The plane at depth `z` along the target's axis holds the point `z u`. With the rotation `R` and
//! translation `t` from target to source coordinates the source sees it along `R u + t / z`: linear in `u`, so one 3x3
//! matrix (Hartley and Zisserman, Multiple View Geometry, section 13.1).

use glam::{DMat3, DVec3};
use image::RgbImage;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;

/// A sample of a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WarpedSample {
    /// Levels of red, green and blue from 0 to 255, interpolated.
    pub levels: [f64; 3],
    /// Whether the place is inside the photograph; outside, the levels are those of its nearest pixel.
    pub inside: bool,
}

/// From target pixels to source pixels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Homography {
    target: Pinhole,
    source: Pinhole,
    source_from_target: DMat3,
}

impl Homography {
    /// The homography of the plane at this depth along the target's principal axis.
    pub(super) fn of_plane(target: &Camera, source: &Camera, depth: f64) -> Homography {
        let (from_target, from_source) = (frame(&target.pose), frame(&source.pose));
        let rotation = from_source.0.transpose() * from_target.0;
        let mut matrix = rotation;
        matrix.z_axis += from_source.0.transpose() * (from_target.1 - from_source.1) / depth;
        Homography { target: target.pinhole, source: source.pinhole, source_from_target: matrix }
    }

    /// The source's sample at the target's pixel. A point behind the source's camera is outside, at the border that its
    /// direction points to.
    pub(super) fn look(&self, picture: &RgbImage, column: u32, row: u32) -> WarpedSample {
        let [fx, fy] = self.target.focal().map(f64::from);
        let [cx, cy] = self.target.principal().map(f64::from);
        let direction = DVec3::new((f64::from(column) + 0.5 - cx) / fx, (f64::from(row) + 0.5 - cy) / fy, 1.0);
        let seen = self.source_from_target * direction;
        let [fx, fy] = self.source.focal().map(f64::from);
        let [cx, cy] = self.source.principal().map(f64::from);
        // So far outside that it is clamped, and never divided by zero.
        let depth = seen.z.max(1.0e-9);
        let (x, y) = (fx * seen.x / depth + cx, fy * seen.y / depth + cy);
        let (width, height) = (f64::from(picture.width()), f64::from(picture.height()));
        let inside = seen.z > 0.0 && x >= 0.0 && y >= 0.0 && x <= width && y <= height;
        WarpedSample { levels: bilinear(picture, x, y), inside }
    }
}

/// Rotation from camera to world coordinates, and the camera's centre.
fn frame(pose: &Pose) -> (DMat3, DVec3) {
    let axes = [pose.right_world(), pose.down_world(), pose.forward_world()].map(|axis| axis.as_dvec3());
    (DMat3::from_cols(axes[0], axes[1], axes[2]), pose.centre_world().as_dvec3())
}

/// Levels at a continuous image coordinate (pixel centres at halves), between the four pixels around it; outside, those
/// of the nearest pixels.
fn bilinear(picture: &RgbImage, x: f64, y: f64) -> [f64; 3] {
    let (x, right, left) = between(x, picture.width());
    let (y, below, above) = between(y, picture.height());
    let level = |column: u32, row: u32, channel: usize| f64::from(picture.get_pixel(column, row)[channel]);
    [0, 1, 2].map(|channel| {
        let upper = level(left, above, channel) * (1.0 - x) + level(right, above, channel) * x;
        let lower = level(left, below, channel) * (1.0 - x) + level(right, below, channel) * x;
        upper * (1.0 - y) + lower * y
    })
}

/// The two pixels that a coordinate lies between: the weight of the later one, its index, and the index of the earlier
/// one.
fn between(coordinate: f64, size: u32) -> (f64, u32, u32) {
    let last = size.saturating_sub(1);
    let place = (coordinate - 0.5).clamp(0.0, f64::from(last));
    let first = place as u32;
    (place - f64::from(first), (first + 1).min(last), first)
}
