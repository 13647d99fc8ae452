//! Bricks, stones and tiles between joints.

use super::Plane;
use crate::scenes::noise::{blend, fractions, layered};
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, floor_to_i32, min};

/// Courses of bricks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Masonry {
    /// The bricks: each a mixture of its own.
    pub bricks: [Vec3; 2],
    /// The joints.
    pub mortar: Vec3,
    /// The plane of the wall or the floor.
    pub plane: Plane,
    /// Length and height of a brick with its joint.
    pub size: [f32; 2],
    /// Width of a joint.
    pub joint: f32,
    /// By what part of its length each course is moved against the one below: 0.5 for bricks, 0 for tiles.
    pub bond: f32,
    pub seed: u32,
}

impl Masonry {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        let [right, up, through] = self.plane.coordinates(p);
        let waver =
            0.35 * self.joint * (2.0 * layered(Vec3::new(right, up, 0.0) / (3.0 * self.joint), self.seed, 1) - 1.0);
        let course = floor_to_i32(up / self.size[1]);
        let along = right / self.size[0] + self.bond * (course & 1) as f32;
        let brick = floor_to_i32(along);
        let [a, b, c, _] = fractions(self.seed, [brick, course, 3]);
        let from_end = (0.5 - abs(along - brick as f32 - 0.5)) * self.size[0];
        let from_side = (0.5 - abs(up / self.size[1] - course as f32 - 0.5)) * self.size[1];
        let from_joint = min(from_end, from_side) - 0.5 * self.joint + waver;

        let place = Vec3::new(right, up, through);
        let grain = layered(place / (0.25 * self.size[1]) + Vec3::splat(30.0 * b), self.seed ^ 1, 3);
        let stain = layered(place / (4.0 * self.size[0]), self.seed ^ 2, 2);
        let fired = blend(self.bricks[0], self.bricks[1], (1.1 * a - 0.05 + 0.7 * (grain - 0.5)).clamp(0.0, 1.0));
        let face = fired * (0.72 + 0.3 * grain + 0.22 * c) * (0.8 + 0.36 * stain);
        let sand = layered(place / 0.03, self.seed ^ 3, 2);
        let mortar = self.mortar * (0.8 + 0.3 * sand);
        blend(face, mortar, (0.5 - from_joint / (0.4 * self.joint)).clamp(0.0, 1.0))
    }
}
