//! Objects: primitives, placed and painted. Their union is the minimum of their distances.

use crate::light::Light;
use crate::placement::Placement;
use crate::shape::Shape;
use crate::texture::Finish;
use core::ops::Range;
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, max, min};

/// Farthest that a part may reach from the world's origin: coordinates there are exact to about the distance at which a
/// ray counts as arrived.
pub const LARGEST_DISTANCE: f32 = 100.0;

/// One primitive of an object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Its form.
    pub shape: Shape,
    /// Where it stands.
    pub placement: Placement,
    /// What it looks like.
    pub finish: Finish,
}

/// Why parts are not an object. Parts count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ObjectError {
    /// There is nothing to see.
    #[error("the object has no parts")]
    Empty,
    /// A size is not positive and finite, or a rounding is larger than what it rounds.
    #[error("part {part} has an unusable size or rounding")]
    Shape {
        /// Which part.
        part: usize,
    },
    /// A colour, a gloss or a texture's size is not usable.
    #[error("part {part} has an unusable colour, gloss or texture size")]
    Finish {
        /// Which part.
        part: usize,
    },
    /// A lamp's direction or strength is not usable.
    #[error("the light has an unusable direction or strength")]
    Light,
    /// A part's place is not finite or farther away than [`LARGEST_DISTANCE`].
    #[error("part {part} is not within {LARGEST_DISTANCE} of the origin")]
    Place {
        /// Which part.
        part: usize,
    },
}

/// A union of parts, checked when built.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    parts: Vec<Part>,
    /// Neighbours in the list of parts, in the same order.
    clusters: Vec<Cluster>,
    /// Of each part, around its own origin.
    bounding_radii: Vec<f32>,
    /// Of all together, around the world's origin.
    bounding_radius: f32,
    light: Light,
}

/// Parts of a cluster.
const CLUSTER_SIZE: usize = 8;

/// How much larger a cluster's box is taken, in world units: more than a part's own.
const CLUSTER_MARGIN: f32 = 2.0e-3;

/// Parts that follow each other, and a box with world axes that holds them. Who lists what is near each other together
/// makes a ray pass by most of the parts eight at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cluster {
    first: usize,
    end: usize,
    low: Vec3,
    high: Vec3,
}

impl Cluster {
    fn new(first: usize, parts: &[Part]) -> Cluster {
        let (mut low, mut high) = (Vec3::splat(f32::MAX), Vec3::splat(f32::MIN));
        for part in parts {
            let half = part.shape.half_box();
            let reach = |axis: Vec3| {
                let local = part.placement.rotate_to_local(axis);
                Vec3::new(abs(local.x), abs(local.y), abs(local.z)).dot(half) + CLUSTER_MARGIN
            };
            let reach = Vec3::new(reach(Vec3::X), reach(Vec3::Y), reach(Vec3::Z));
            low = low.min(part.placement.origin_world() - reach);
            high = high.max(part.placement.origin_world() + reach);
        }
        Cluster { first, end: first + parts.len(), low, high }
    }

    /// Indices of the parts.
    pub(crate) fn range(&self) -> Range<usize> {
        self.first..self.end
    }

    /// Whether a part of it may lie on the ray nearer than `limit`.
    pub(crate) fn may_be_on(&self, origin: Vec3, direction: Vec3, limit: f32) -> bool {
        let (mut enter, mut leave) = (0.0, limit);
        for axis in 0..3 {
            let (start, step) = (origin[axis], direction[axis]);
            if step == 0.0 {
                if start < self.low[axis] || start > self.high[axis] {
                    return false;
                }
                continue;
            }
            let (a, b) = ((self.low[axis] - start) / step, (self.high[axis] - start) / step);
            enter = max(enter, min(a, b));
            leave = min(leave, max(a, b));
        }
        enter <= leave
    }
}

/// Distance from the world's origin to the farthest corner of the box around a part: less than that of the ball for
/// long parts whose ends are near the origin.
fn farthest_corner(part: &Part) -> f32 {
    let half = part.shape.half_box();
    let mut farthest = 0.0;
    for corner in 0..8 {
        let sign = |axis: u32| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 };
        let offset = part.placement.rotate_to_world(half * Vec3::new(sign(0), sign(1), sign(2)));
        farthest = max(farthest, (part.placement.origin_world() + offset).length());
    }
    farthest
}

impl Object {
    /// The union of these parts. Where two surfaces coincide, the earlier part shows.
    ///
    /// # Errors
    /// [`ObjectError`] if there is no part, or names the first one with an unusable size, finish or place.
    pub fn new(parts: Vec<Part>) -> Result<Object, ObjectError> {
        if parts.is_empty() {
            return Err(ObjectError::Empty);
        }
        let mut bounding_radius = 0.0;
        let mut bounding_radii = Vec::with_capacity(parts.len());
        for (index, part) in parts.iter().enumerate() {
            if !part.shape.is_sound() {
                return Err(ObjectError::Shape { part: index });
            }
            if !part.finish.is_sound() {
                return Err(ObjectError::Finish { part: index });
            }
            let reach = part.placement.origin_world().length() + part.shape.bounding_radius();
            if !(reach <= LARGEST_DISTANCE) {
                return Err(ObjectError::Place { part: index });
            }
            bounding_radius = max(bounding_radius, min(reach, farthest_corner(part)));
            bounding_radii.push(part.shape.bounding_radius());
        }
        let cluster = |(index, parts)| Cluster::new(index * CLUSTER_SIZE, parts);
        let clusters = parts.chunks(CLUSTER_SIZE).enumerate().map(cluster).collect();
        Ok(Object { parts, clusters, bounding_radii, bounding_radius, light: Light::default() })
    }

    /// The same object under other lamps.
    ///
    /// # Errors
    /// [`ObjectError::Light`].
    pub fn under(self, light: Light) -> Result<Object, ObjectError> {
        if light.is_sound() { Ok(Object { light, ..self }) } else { Err(ObjectError::Light) }
    }

    /// The lamps that it stands under.
    pub fn light(&self) -> &Light {
        &self.light
    }

    /// The parts, in the order given.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// The parts in clusters.
    pub(crate) fn clusters(&self) -> &[Cluster] {
        &self.clusters
    }

    /// A part with the radius of a ball around its own origin that holds it.
    pub(crate) fn bounded_part(&self, index: usize) -> (&Part, f32) {
        (&self.parts[index], self.bounding_radii[index])
    }

    /// The parts, each with the radius of a ball around its own origin that holds it.
    pub fn bounded_parts(&self) -> impl Iterator<Item = (&Part, f32)> {
        self.parts.iter().zip(self.bounding_radii.iter().copied())
    }

    /// Radius of a ball around the world's origin that holds the object.
    pub fn bounding_radius(&self) -> f32 {
        self.bounding_radius
    }

    /// Signed distance (world units) from a world point to the object, limited to `most`; a lower bound of it inside
    /// overlapping parts and beside ellipsoids and prisms. Parts farther than `most` cost next to nothing.
    pub fn distance(&self, point_world: Vec3, most: f32) -> f32 {
        let mut nearest = most;
        for (part, radius) in self.bounded_parts() {
            let offset = point_world - part.placement.origin_world();
            let reach = radius + max(nearest, 0.0);
            if offset.dot(offset) < reach * reach {
                nearest = min(nearest, part.shape.distance(part.placement.rotate_to_local(offset)));
            }
        }
        nearest
    }
}
