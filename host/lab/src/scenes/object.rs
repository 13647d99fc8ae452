//! Objects: primitives, placed and painted. Their union is the minimum of their distances.

use crate::scenes::light::Light;
use crate::scenes::part::{Bounds, Part};
use viewfuse_core::Vec3;
use viewfuse_core::math::{max, min};

/// Farthest that a part may reach from the world's origin: coordinates there are exact to about the distance at which a
/// ray counts as arrived.
pub const MAX_DISTANCE: f32 = 100.0;

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
    /// A part's place is not finite or farther away than [`MAX_DISTANCE`].
    #[error("part {part} is not within {MAX_DISTANCE} of the origin")]
    Place {
        /// Which part.
        part: usize,
    },
}

/// A union of parts, checked when built.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    parts: Vec<Part>,
    /// Around all parts, for rays to pass them by.
    bounds: Bounds,
    /// Of each part, around its own origin.
    bounding_radii: Vec<f32>,
    /// Of all together, around the world's origin.
    bounding_radius: f32,
    light: Light,
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
            if !(reach <= MAX_DISTANCE) {
                return Err(ObjectError::Place { part: index });
            }
            bounding_radius = max(bounding_radius, min(reach, farthest_corner(part)));
            bounding_radii.push(part.shape.bounding_radius());
        }
        let bounds = Bounds::new(&parts);
        Ok(Object { parts, bounds, bounding_radii, bounding_radius, light: Light::default() })
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

    /// Boxes around the parts.
    pub(crate) fn bounds(&self) -> &Bounds {
        &self.bounds
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
