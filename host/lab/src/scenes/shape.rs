//! Primitives and their signed distances.
//!
//! Every primitive is centred at its own origin; those with an axis stand along local z. The distance is negative
//! inside. It is exact outside for all but the ellipsoid and the prism, whose value is a lower bound of the distance;
//! sphere tracing needs no more than a lower bound. Formulas: J. C. Hart, "Sphere tracing", The Visual Computer 12
//! (1996).

use crate::scenes::prism::Prism;
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, max, min, sqrt};

/// A primitive in its own coordinates. Lengths are in world units, and sizes are those of the finished shape: rounding
/// an edge takes material away and never adds any.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(
    clippy::large_enum_variant,
    reason = "an object has tens of parts, and a ray walks over them in one piece of memory"
)]
pub enum Shape {
    /// A ball.
    Sphere { radius: f32 },
    /// A ball that is stretched along the axes.
    Ellipsoid {
        /// Half of its extent along each axis.
        radii: Vec3,
    },
    /// A cuboid with rounded edges and corners.
    Block {
        /// Half of its extent along each axis.
        half_size: Vec3,
        /// Radius of the edges, at most the smallest half extent.
        rounding: f32,
    },
    /// An upright cylinder with rounded rims.
    Cylinder {
        radius: f32,
        half_height: f32,
        /// Radius of the rims, at most the radius and the half height.
        rounding: f32,
    },
    /// A ring lying in the plane `z = 0`.
    Torus {
        /// Distance of the tube's centre line from the axis.
        ring_radius: f32,
        tube_radius: f32,
    },
    /// An upright cylinder that ends in half balls.
    Capsule {
        /// Half of the distance between the centres of the half balls.
        half_length: f32,
        /// Radius of cylinder and balls.
        radius: f32,
    },
    /// A side view with corners, given a width.
    Prism(Prism),
}

impl Shape {
    /// Signed distance (world units) from `point_local` to the surface; for the ellipsoid and the prism a lower
    /// bound of it in magnitude, for the ellipsoid off by at most the ratio of its smallest and largest radius.
    pub fn distance(&self, point_local: Vec3) -> f32 {
        let p = point_local;
        match *self {
            Shape::Sphere { radius } => p.length() - radius,
            Shape::Ellipsoid { radii } => {
                let smallest = min(min(radii.x, radii.y), radii.z);
                ((p / radii).length() - 1.0) * smallest
            }
            Shape::Block { half_size, rounding } => {
                let core = half_size - Vec3::splat(rounding);
                let beyond = Vec3::new(abs(p.x) - core.x, abs(p.y) - core.y, abs(p.z) - core.z);
                let outside = Vec3::new(max(beyond.x, 0.0), max(beyond.y, 0.0), max(beyond.z, 0.0)).length();
                let inside = min(max(max(beyond.x, beyond.y), beyond.z), 0.0);
                outside + inside - rounding
            }
            Shape::Cylinder { radius, half_height, rounding } => {
                let across = length2(p.x, p.y) - (radius - rounding);
                let along = abs(p.z) - (half_height - rounding);
                length2(max(across, 0.0), max(along, 0.0)) + min(max(across, along), 0.0) - rounding
            }
            Shape::Torus { ring_radius, tube_radius } => length2(length2(p.x, p.y) - ring_radius, p.z) - tube_radius,
            Shape::Capsule { half_length, radius } => {
                let along = max(abs(p.z) - half_length, 0.0);
                Vec3::new(p.x, p.y, along).length() - radius
            }
            Shape::Prism(ref prism) => prism.distance(p),
        }
    }

    /// Radius of a ball around the local origin that holds the shape.
    pub fn bounding_radius(&self) -> f32 {
        match *self {
            Shape::Sphere { radius } => radius,
            Shape::Ellipsoid { radii } => max(max(radii.x, radii.y), radii.z),
            Shape::Block { half_size, rounding } => (half_size - Vec3::splat(rounding)).length() + rounding,
            Shape::Cylinder { radius, half_height, rounding } => {
                length2(radius - rounding, half_height - rounding) + rounding
            }
            Shape::Torus { ring_radius, tube_radius } => ring_radius + tube_radius,
            Shape::Capsule { half_length, radius } => half_length + radius,
            Shape::Prism(ref prism) => prism.half_box().length(),
        }
    }

    /// Half of the extent along each axis of a box around the local origin that holds the shape.
    pub fn half_box(&self) -> Vec3 {
        match *self {
            Shape::Sphere { radius } => Vec3::splat(radius),
            Shape::Ellipsoid { radii } => radii,
            Shape::Block { half_size, .. } => half_size,
            Shape::Cylinder { radius, half_height, .. } => Vec3::new(radius, radius, half_height),
            Shape::Torus { ring_radius, tube_radius } => {
                Vec3::new(ring_radius + tube_radius, ring_radius + tube_radius, tube_radius)
            }
            Shape::Capsule { half_length, radius } => Vec3::new(radius, radius, half_length + radius),
            Shape::Prism(ref prism) => prism.half_box(),
        }
    }
}

/// Euclidean norm of two components.
fn length2(x: f32, y: f32) -> f32 {
    sqrt(x * x + y * y)
}
