//! Painted pottery: rings of motifs around the upright axis.

use super::{inside, worn};
use crate::scenes::noise::{blend, fractions, layered};
use core::f32::consts::TAU;
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, angle_from_components, floor_to_i32, sqrt};

/// Rings around local z, each with a motif of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glaze {
    /// The ground and three paints.
    pub colours: [Vec3; 4],
    /// Height of a ring.
    pub band: f32,
    /// Motifs around the axis.
    pub count: u32,
    pub seed: u32,
}

impl Glaze {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        // Painted by hand: rings waver a little.
        let place = p.z / self.band + 0.16 * (layered(p / self.band, self.seed ^ 3, 2) - 0.5);
        let ring = floor_to_i32(place);
        let up = place - ring as f32;
        let turns = if p.y >= 0.0 { 0.0 } else { 0.5 };
        let (y, x) = if p.y >= 0.0 { (p.y, p.x) } else { (-p.y, -p.x) };
        let along = (turns + angle_from_components(y, x) / TAU) * self.count as f32;
        let cell = floor_to_i32(along);
        let u = along - cell as f32;
        let [motif, ink, ground, _] = fractions(self.seed, [ring, 0, 80]);
        let [vary, tint, ..] = fractions(self.seed, [ring, cell, 81]);
        let pick = |value: f32| ((value * 3.0) as usize).min(2);
        let ink_index = 1 + pick(ink);
        let back = if ground < 0.6 { self.colours[0] } else { self.colours[1 + (pick(ink) + 1) % 3] };
        let paint = self.colours[ink_index] * (0.85 + 0.3 * tint);
        let soft = 0.06;
        let amount = match floor_to_i32(6.0 * motif) {
            0 => inside(abs(up - 0.15 - 1.4 * abs(u - 0.5)) - 0.14, soft),
            1 => inside(sqrt((u - 0.5) * (u - 0.5) + (up - 0.5) * (up - 0.5)) - 0.2 - 0.16 * vary, soft),
            2 => inside(abs(u - 0.5) + abs(up - 0.5) - 0.28 - 0.16 * vary, soft),
            3 => inside(abs(up - 0.5) - 0.3, soft),
            4 => inside(abs(u - 0.3 - 0.4 * up) - 0.14, soft),
            _ => inside(0.32 - up, soft).max(inside(up - 0.3 + 0.3 * vary, soft)),
        };
        let line = inside(0.5 - abs(up - 0.5) - 0.04, 0.04);
        let colour = blend(blend(back, paint, amount), self.colours[3], line);
        let speck = layered(p / 0.035, self.seed ^ 82, 2);
        let colour = blend(colour, self.colours[3], ((speck - 0.72) * 6.0).clamp(0.0, 0.7));
        worn(colour, p, 0.15, 0.2, self.seed ^ 83)
    }
}
