//! Blotches and veins: marble, plaster, soil, grass, leaves.

use crate::scenes::noise::{blend, layered};
use viewfuse_core::Vec3;
use viewfuse_core::math::abs;

/// Blotches of all sizes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stone {
    /// Between these.
    pub colours: [Vec3; 2],
    /// Veins and specks.
    pub vein: Vec3,
    /// How much of the veins shows, 0 to 1.
    pub veined: f32,
    /// Size of the largest blotches along each axis.
    pub cell: Vec3,
    pub seed: u32,
}

impl Stone {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        let place = p / self.cell;
        let amount = layered(place, self.seed, 5);
        let warped = place * 0.8 + Vec3::splat(1.6 * amount);
        let vein = 1.0 - 9.0 * abs(layered(warped, self.seed ^ 41, 3) - 0.5);
        let fine = layered(place * 11.0, self.seed ^ 42, 2);
        let colour = blend(self.colours[0], self.colours[1], (2.4 * (amount - 0.5) + 0.5).clamp(0.0, 1.0));
        blend(colour * (0.74 + 0.5 * fine), self.vein, self.veined * vein.clamp(0.0, 1.0))
    }
}
