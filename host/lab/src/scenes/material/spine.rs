//! Books, as they stand on a shelf or lie on a table.

use super::worn;
use crate::scenes::material::font::{GLYPH_COUNT, has_dot};
use crate::scenes::noise::{blend, fractions};
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, floor_to_i32};

/// A book around the local origin: `x` across its back, `z` along it, and its back at the lowest `y`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spine {
    /// The cover, the bands and the letters.
    pub colours: [Vec3; 3],
    /// Half of its thickness, depth and height.
    pub half: [f32; 3],
    pub seed: u32,
}

/// Colour of paper from the side.
const PAPER: Vec3 = Vec3::new(0.88, 0.84, 0.72);

impl Spine {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        let [half_x, half_y, half_z] = self.half;
        let [cover, band, ink] = self.colours;
        let board = (0.16 * half_x).min(0.012);
        // Above, below and in front, there are pages between the boards.
        let at_end = abs(p.z) > half_z - 0.008 || p.y > half_y - 0.008;
        if at_end && abs(p.x) < half_x - board && p.y > -half_y + 2.0 * board {
            let [sheet, ..] = fractions(self.seed, [floor_to_i32(p.x / 0.004), 0, 70]);
            return PAPER * (0.75 + 0.25 * sheet);
        }
        let up = p.z / half_z;
        let [a, b, c, d] = fractions(self.seed, [0, 0, 71]);
        let at_back = p.y < -half_y + 0.02;
        let mut colour = cover;
        let near_band = |place: f32, width: f32| abs(up - place) < width;
        if at_back {
            if near_band(0.62 + 0.25 * a, 0.03 + 0.08 * b) || near_band(-0.7 - 0.15 * c, 0.03 + 0.05 * d) {
                colour = band;
            } else if a < 0.4 && (near_band(0.5, 0.012) || near_band(-0.52, 0.012)) {
                colour = ink;
            } else if abs(up) < 0.46 {
                // A title from the top to the bottom.
                let size = 1.3 * half_x;
                let pitch = 0.9 * size;
                let letter = floor_to_i32(p.z / pitch);
                let [glyph, space, ..] = fractions(self.seed, [letter, 0, 72]);
                let column = floor_to_i32((1.0 - (p.z / pitch - letter as f32)) * 6.4);
                let row = floor_to_i32((p.x / size + 0.5) * 7.0);
                if space > 0.15 && has_dot((glyph * GLYPH_COUNT as f32) as u32, column, row) {
                    colour = ink;
                }
            }
        } else if up > 0.25 && abs(p.y) < 0.6 * half_y && b < 0.6 {
            colour = blend(cover, band, 0.6);
        }
        worn(worn(colour, p, 0.025, 0.16, self.seed ^ 1), p, 0.4, 0.25, self.seed ^ 2)
    }
}
