//! Wood: planks with rings, fibres and joints.

use super::Plane;
use crate::scenes::noise::{blend, fractions, layered, smooth};
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, floor_to_i32, min, sqrt};

/// Planks side by side, each from another place of another tree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wood {
    /// Early and late wood: light and dark.
    pub colours: [Vec3; 2],
    /// The plane that the planks lie in; they run along its first coordinate.
    pub plane: Plane,
    /// Whether they run along the second coordinate instead.
    pub turned: bool,
    /// Width of a plank.
    pub plank: f32,
    /// Length of a plank.
    pub length: f32,
    pub seed: u32,
}

impl Wood {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        let coordinates = self.plane.coordinates(p);
        let [along, across, through] = if self.turned { self.plane.turned(coordinates) } else { coordinates };
        let row = floor_to_i32(across / self.plank);
        let [start, ..] = fractions(self.seed, [row, 0, 91]);
        let place = along / self.length + start;
        let piece = floor_to_i32(place);
        let [a, b, c, d] = fractions(self.seed, [row, piece, 17]);

        // Rings around an axis that runs roughly along the plank, below or above it.
        let middle = (row as f32 + 0.5 + 1.4 * (a - 0.5)) * self.plank;
        let wander = 0.22 * layered(Vec3::new(0.5 * along + 40.0 * b, 1.1 * across, 5.0 * c), self.seed, 3);
        let deep = 0.05 + 0.2 * d + 0.04 * along * (b - 0.5);
        let (beside, below) = (across - middle, through + deep);
        let radius = sqrt(beside * beside + below * below) + wander;
        let ring = radius * (16.0 + 10.0 * c);
        let step = ring - floor_to_i32(ring) as f32;
        // Slowly darker, then suddenly light again.
        let late = step * step * (1.0 - step * step * step * step) * 1.9;

        let fibre = smooth(Vec3::new(4.0 * along + 9.0 * a, 70.0 * across, 70.0 * through), self.seed ^ 5);
        let patch = smooth(Vec3::new(0.7 * along, 2.5 * across, 20.0 * b), self.seed ^ 9);
        let amount = 0.62 * late + 0.3 * (fibre - 0.5) + 0.34 * (patch - 0.4);
        let wood = blend(self.colours[0], self.colours[1], amount.clamp(-0.2, 1.2)) * (0.86 + 0.24 * d);

        let beside_joint = abs(across / self.plank - row as f32 - 0.5);
        let from_side = (0.5 - beside_joint) * self.plank;
        let from_end = (0.5 - abs(place - piece as f32 - 0.5)) * self.length;
        let gap = min(from_side, from_end);
        blend(wood, self.colours[1] * 0.3, (1.0 - gap / 0.016).clamp(0.0, 1.0))
    }
}
