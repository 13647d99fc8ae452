//! Objects: primitives, placed and painted. Their union is the minimum of their distances.

use crate::scenes::light::Light;
use crate::scenes::part::{Bounds, Part};
use viewfuse_core::Vec3;
use viewfuse_core::math::{max, min};

/// A union of parts.
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
    pub fn new(parts: Vec<Part>) -> Object {
        let bounding_radii: Vec<f32> = parts.iter().map(|part| part.shape.bounding_radius()).collect();
        let reach =
            |(part, radius): (&Part, &f32)| min(part.placement.origin_world().length() + radius, farthest_corner(part));
        let bounding_radius = parts.iter().zip(&bounding_radii).map(reach).fold(0.0, max);
        let bounds = Bounds::new(&parts);
        Object { parts, bounds, bounding_radii, bounding_radius, light: Light::default() }
    }

    /// The same object under other lamps.
    #[must_use]
    pub fn under(self, light: Light) -> Object {
        Object { light, ..self }
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
