//! Lamps with a size and a place: what makes soft shadows.

use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, sin_cos, sqrt};

/// A glowing ball that is not itself seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Its middle, in world coordinates.
    pub centre: Vec3,
    /// Its radius, in world units.
    pub radius: f32,
    /// Light on a surface that faces it from the distance `reach`: 1 shows a surface in its own colour.
    pub light: Vec3,
    /// Where it gives that light; nearer it gives more, farther less, by the square.
    pub reach: f32,
}

impl Lamp {
    /// A point on its disc as seen from `point`; `[u, v]` in `[0, 1)` say which, evenly over the disc.
    pub fn point_on_disc(&self, point: Vec3, [u, v]: [f32; 2]) -> Vec3 {
        let towards = self.centre - point;
        let [right, up] = across(towards / towards.length());
        let [x, y] = on_disc([u, v]);
        self.centre + (right * x + up * y) * self.radius
    }
}

/// A point of the unit disc for two numbers in `[0, 1)`: even numbers give an even disc.
pub fn on_disc([u, v]: [f32; 2]) -> [f32; 2] {
    let (sine, cosine) = sin_cos(core::f32::consts::TAU * v);
    let radius = sqrt(u);
    [radius * cosine, radius * sine]
}

/// Two unit vectors that are perpendicular to a unit vector and to each other.
pub fn across(direction: Vec3) -> [Vec3; 2] {
    let other = if abs(direction.z) < 0.9 { Vec3::Z } else { Vec3::X };
    let right = direction.cross(other);
    let right = right / right.length();
    [right, right.cross(direction)]
}
