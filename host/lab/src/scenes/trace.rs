//! The first point of an object on a ray, by sphere tracing.
//!
//! A union's first point is the nearest of its parts' first points, so each part is traced on its own, in its own
//! coordinates and only inside its bounding ball. That takes fewer steps than tracing the minimum of the distances:
//! a ray that passes close to one part on its way to another is not slowed down.

use crate::scenes::object::Object;
use crate::scenes::part::{Part, Probe};
use viewfuse_core::Vec3;
use viewfuse_core::camera::Ray;
use viewfuse_core::math::{abs, max, min, sqrt};

/// A ray has arrived when it is this near to the surface, in world units: 0.001 pixels in the sample scene, and a
/// hundred times the rounding error of a coordinate.
pub const ARRIVAL_DISTANCE: f32 = 1.0e-5;

/// Most steps along a ray through one part. Only rays that graze a surface come near it, and they are then let pass.
const MAX_STEP_COUNT: u32 = 256;

/// Half of the distance between the points that a normal is computed from, in world units: smaller than any edge's
/// radius, and large enough for a rounding error below 0.001 in the normal.
const NORMAL_STEP: f32 = 4.0e-4;

/// How much larger a part's box is taken, in world units: a ray that passes it by is far from arriving.
const BOX_MARGIN: f32 = 1.0e-3;

/// Parts whose ball is larger than this, in world units, are walls and the like: a ray begins at their box. With
/// smaller ones that would save no more than a step.
const LARGE: f32 = 1.0;

/// Where a ray meets an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance from the ray's origin, in world units.
    pub distance: f32,
    /// Index of the part.
    pub part: usize,
    /// The point, in the part's coordinates.
    pub point_local: Vec3,
    /// Outward unit normal, in the part's coordinates.
    pub normal_local: Vec3,
}

/// The nearest point of `object` on `ray`, if there is one. A ray that starts inside a part hits it at once.
pub fn trace(object: &Object, ray: &Ray) -> Option<Hit> {
    let (distance, index) = first(object, ray, f32::MAX)?;
    let part = &object.parts()[index];
    let point_local = part.placement.to_local(ray.at(distance));
    Some(Hit { distance, part: index, point_local, normal_local: normal(part, point_local) })
}

/// Distance to the nearest point of `object` on `ray`, if it is less than `limit`, and the index of its part.
pub fn first(object: &Object, ray: &Ray, limit: f32) -> Option<(f32, usize)> {
    ball_interval(ray.origin_world, ray.direction_world, object.bounding_radius())?;
    let (bounds, probe) = (object.bounds(), Probe::new(ray.origin_world, ray.direction_world));
    let mut nearest: Option<(f32, usize)> = None;
    for cluster in 0..bounds.cluster_count() {
        let before = nearest.map_or(limit, |(distance, _)| distance);
        for index in bounds.parts_of(cluster, &probe, before) {
            let before = nearest.map_or(limit, |(distance, _)| distance);
            if !bounds.may_meet(index, &probe, before) {
                continue;
            }
            let (part, radius) = object.bounded_part(index);
            if let Some(distance) = march(part, radius, ray, before) {
                nearest = Some((distance, index));
            }
        }
    }
    nearest
}

/// Whether anything of `object` lies on `ray` nearer than `limit`.
pub fn is_blocked(object: &Object, ray: &Ray, limit: f32) -> bool {
    let (bounds, probe) = (object.bounds(), Probe::new(ray.origin_world, ray.direction_world));
    let blocks = |index: usize| {
        let (part, radius) = object.bounded_part(index);
        bounds.may_meet(index, &probe, limit) && march(part, radius, ray, limit).is_some()
    };
    (0..bounds.cluster_count()).any(|cluster| bounds.parts_of(cluster, &probe, limit).any(blocks))
}

/// Distance along the ray to a part's surface, if it is less than `limit`.
fn march(part: &Part, bounding_radius: f32, ray: &Ray, limit: f32) -> Option<f32> {
    // The ball looks the same from all sides: most parts are passed by without turning the ray into their coordinates.
    let offset = ray.origin_world - part.placement.origin_world();
    let (enter, leave) = ball_interval(offset, ray.direction_world, bounding_radius)?;
    let leave = min(leave, limit);
    let origin = part.placement.rotate_to_local(offset);
    let direction = part.placement.rotate_to_local(ray.direction_world);
    let (box_enter, box_leave) = box_interval(origin, direction, part.shape.half_box())?;
    if box_leave < 0.0 || box_enter > leave {
        return None;
    }
    let mut t = if bounding_radius > LARGE { max(enter, box_enter) } else { enter };
    let leave = min(leave, box_leave);
    for _ in 0..MAX_STEP_COUNT {
        if t >= leave {
            return None;
        }
        let distance = part.shape.distance(origin + direction * t);
        if distance < ARRIVAL_DISTANCE {
            return Some(t);
        }
        t += distance;
    }
    None
}

/// The stretch of a ray, not behind its origin, inside a ball around the coordinates' origin. The ball is taken a
/// little larger than told, so that a sphere, which fills its ball, is not lost to rounding at its rim.
fn ball_interval(origin: Vec3, direction: Vec3, radius: f32) -> Option<(f32, f32)> {
    let radius = radius * 1.001;
    let middle = -origin.dot(direction);
    let nearest = origin + direction * middle;
    let discriminant = radius * radius - nearest.dot(nearest);
    if !(discriminant > 0.0) {
        return None;
    }
    let half = sqrt(discriminant);
    if middle + half > 0.0 { Some((max(middle - half, 0.0), middle + half)) } else { None }
}

/// The stretch of a line inside a box around the coordinates' origin, taken a little larger than told. Long and flat
/// parts fill little of their balls.
fn box_interval(origin: Vec3, direction: Vec3, half_box: Vec3) -> Option<(f32, f32)> {
    let (mut enter, mut leave) = (f32::MIN, f32::MAX);
    for axis in 0..3 {
        let (start, step, half) = (origin[axis], direction[axis], half_box[axis] + BOX_MARGIN);
        if step == 0.0 {
            if abs(start) > half {
                return None;
            }
            continue;
        }
        let (a, b) = ((-half - start) / step, (half - start) / step);
        enter = max(enter, min(a, b));
        leave = min(leave, max(a, b));
    }
    if enter <= leave { Some((enter, leave)) } else { None }
}

/// Gradient of the distance from four values at the corners of a tetrahedron, scaled to unit length.
fn normal(part: &Part, point_local: Vec3) -> Vec3 {
    const CORNERS: [Vec3; 4] =
        [Vec3::new(1.0, -1.0, -1.0), Vec3::new(-1.0, -1.0, 1.0), Vec3::new(-1.0, 1.0, -1.0), Vec3::new(1.0, 1.0, 1.0)];
    let mut sum = Vec3::ZERO;
    for corner in CORNERS {
        sum += corner * part.shape.distance(point_local + corner * NORMAL_STEP);
    }
    let length = sum.length();
    // The four values cancel only at a primitive's very centre.
    if length > 0.0 { sum / length } else { Vec3::Z }
}
