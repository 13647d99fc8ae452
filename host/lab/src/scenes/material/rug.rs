//! A knotted rug: borders, a field with scattered motifs, a medallion in the middle.

use crate::scenes::noise::{blend, fractions, layered};
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, floor_to_i32, max, min};

/// A rug that lies around the local origin in the plane of x and y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rug {
    /// Field, border, and two for motifs.
    pub colours: [Vec3; 4],
    /// Half of its length and width.
    pub half: [f32; 2],
    /// Size of a motif.
    pub motif: f32,
    pub seed: u32,
}

/// Size of a knot as a part of a motif.
const KNOTS: f32 = 12.0;

impl Rug {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        // Every knot has one colour: edges are stepped.
        let knot = self.motif / KNOTS;
        let (i, j) = (floor_to_i32(p.x / knot), floor_to_i32(p.y / knot));
        let (x, y) = ((i as f32 + 0.5) * knot, (j as f32 + 0.5) * knot);
        let [tint, dye, ..] = fractions(self.seed, [i, j, 1]);
        let rows = layered(Vec3::new(0.2 * x, 1.5 * y, 0.0) / self.motif, self.seed ^ 4, 2);
        let colour = self.drawing(x, y) * (0.84 + 0.2 * tint + 0.2 * (rows - 0.5));
        let pile = layered(Vec3::new(p.x, p.y, 0.0) / (0.8 * knot), self.seed ^ 6, 1);
        blend(colour, self.colours[3], 0.06 * dye) * (0.88 + 0.2 * pile)
    }

    fn drawing(&self, x: f32, y: f32) -> Vec3 {
        let [field, border, first, second] = self.colours;
        let m = self.motif;
        let (from_end, from_side) = (self.half[0] - abs(x), self.half[1] - abs(y));
        let from_edge = min(from_end, from_side);
        // Lines around a broad border of diamonds.
        if from_edge < 0.25 * m {
            return border;
        }
        if from_edge < 0.4 * m || (1.6 * m..1.75 * m).contains(&from_edge) {
            return second;
        }
        if from_edge < 1.6 * m {
            let along = if from_end < from_side { y } else { x };
            let cell = floor_to_i32(along / m);
            let (u, v) = (abs(along / m - cell as f32 - 0.5), abs((from_edge - 1.0 * m) / (1.2 * m)));
            let [choice, ..] = fractions(self.seed, [cell, i32::from(from_end < from_side), 33]);
            let inks = if choice < 0.5 { [first, second] } else { [second, first] };
            let diamond = u + v;
            return if diamond < 0.16 {
                border
            } else if diamond < 0.32 {
                inks[0]
            } else if diamond < 0.42 {
                inks[1]
            } else {
                border
            };
        }
        if from_edge < 1.9 * m {
            return first;
        }
        // The medallion: diamonds in each other, with stepped and notched edges.
        let notch = 0.3 * m * ((floor_to_i32((abs(x) + 0.35 * abs(y)) / (0.5 * m)) & 1) as f32);
        let inner = max(self.half[1] - 1.9 * m, m);
        let rhomb = (0.62 * abs(x) + abs(y) + notch) / inner;
        if rhomb < 0.82 {
            let ring = floor_to_i32(rhomb * 7.0);
            let [choice, ..] = fractions(self.seed, [ring, 0, 34]);
            let all = [second, border, first, field];
            return all[((ring as usize) + (choice * 2.0) as usize) & 3];
        }
        // Scattered motifs: small crosses and stars on a loose grid.
        let (ci, cj) = (floor_to_i32(x / m), floor_to_i32(y / m));
        let [a, b, c, d] = fractions(self.seed, [ci, cj, 35]);
        let (u, v) = (abs(x / m - ci as f32 - 0.4 - 0.2 * a), abs(y / m - cj as f32 - 0.4 - 0.2 * b));
        let ink = if d < 0.4 {
            first
        } else if d < 0.8 {
            second
        } else {
            border
        };
        let hit = if c < 0.5 { u + v < 0.33 && min(u, v) < 0.11 } else { max(u, v) < 0.24 && u + v > 0.13 };
        if hit { ink } else { field }
    }
}
