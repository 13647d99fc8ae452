//! Pictures to hang on a wall: landscapes and abstract ones.

use super::{Plane, inside, worn};
use crate::scenes::noise::{blend, fractions, layered};
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, floor_to_i32, max, min, sqrt};

/// A painting around the local origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Painting {
    /// Half of its width and height.
    pub half: [f32; 2],
    pub plane: Plane,
    pub seed: u32,
}

/// Skies, from above to the horizon; suns; near and far land; what is painted on abstract ones.
const SKIES: [[Vec3; 2]; 4] = [
    [Vec3::new(0.22, 0.42, 0.72), Vec3::new(0.86, 0.86, 0.76)],
    [Vec3::new(0.28, 0.22, 0.46), Vec3::new(0.96, 0.62, 0.36)],
    [Vec3::new(0.18, 0.46, 0.62), Vec3::new(0.78, 0.9, 0.88)],
    [Vec3::new(0.42, 0.3, 0.3), Vec3::new(0.95, 0.8, 0.52)],
];
const LANDS: [[Vec3; 2]; 4] = [
    [Vec3::new(0.18, 0.34, 0.16), Vec3::new(0.5, 0.62, 0.5)],
    [Vec3::new(0.24, 0.12, 0.14), Vec3::new(0.58, 0.4, 0.44)],
    [Vec3::new(0.1, 0.24, 0.3), Vec3::new(0.44, 0.58, 0.62)],
    [Vec3::new(0.4, 0.26, 0.1), Vec3::new(0.72, 0.6, 0.4)],
];
const PAINTS: [Vec3; 7] = [
    Vec3::new(0.8, 0.22, 0.14),
    Vec3::new(0.94, 0.72, 0.2),
    Vec3::new(0.14, 0.3, 0.56),
    Vec3::new(0.9, 0.86, 0.76),
    Vec3::new(0.1, 0.12, 0.16),
    Vec3::new(0.22, 0.5, 0.42),
    Vec3::new(0.84, 0.5, 0.42),
];

/// The share of landscapes.
const LANDSCAPES: f32 = 0.6;

impl Painting {
    /// Whether the painting with this seed is a landscape.
    pub fn is_landscape(seed: u32) -> bool {
        fractions(seed, [0, 0, 60])[0] < LANDSCAPES
    }

    /// Whether it is a landscape by day, with a blue sky.
    pub fn is_day(seed: u32) -> bool {
        Painting::is_landscape(seed) && Painting::palette(seed).is_multiple_of(2)
    }

    fn palette(seed: u32) -> usize {
        (fractions(seed, [0, 0, 60])[1] * 4.0) as usize & 3
    }

    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        let [right, up, _] = self.plane.coordinates(p);
        let (x, y) = (right / self.half[1], up / self.half[1]);
        let palette = Painting::palette(self.seed);
        let colour =
            if Painting::is_landscape(self.seed) { self.landscape(x, y, palette) } else { self.abstracted(x, y) };
        // Strokes of the brush.
        let stroke = Vec3::new(right + 0.5 * up, 3.0 * up, 0.0);
        worn(colour, stroke, 0.05, 0.22, self.seed ^ 61)
    }

    /// Clouds, a sun, hills behind each other, each hill nearer and darker.
    fn landscape(&self, x: f32, y: f32, palette: usize) -> Vec3 {
        let [a, b, c, d] = fractions(self.seed, [0, 0, 62]);
        let height = 0.5 + 0.5 * y;
        let cloud = layered(Vec3::new(1.6 * x, 4.0 * y, 9.0 * a), self.seed ^ 63, 4);
        let [above, below] = SKIES[palette];
        let mut colour = blend(below, above, height);
        colour = blend(colour, Vec3::new(0.97, 0.94, 0.88), ((cloud - 0.5) * 3.2).clamp(0.0, 0.85));
        let (dx, dy) = (x - 0.9 * (b - 0.5), y - 0.3 - 0.35 * c);
        colour = blend(colour, Vec3::new(1.0, 0.93, 0.7), inside(sqrt(dx * dx + dy * dy) - 0.13, 0.03));
        let [near, far] = LANDS[palette];
        for hill in 0..5 {
            let nearness = hill as f32 / 4.0;
            let rough = 1.2 + 0.9 * nearness;
            let profile = layered(Vec3::new(rough * x + 20.0 * d, hill as f32 * 3.7, 0.5), self.seed ^ 64, 4);
            let line = 0.25 - 0.95 * nearness + 0.9 * (profile - 0.5);
            let ground = layered(Vec3::new(5.0 * x, 9.0 * y, hill as f32), self.seed ^ 65, 3);
            let land = blend(far, near, nearness) * (0.6 + 0.8 * ground);
            colour = blend(colour, land, inside(y - line, 0.02));
        }
        colour
    }

    /// Rectangles, discs and rings, painted over each other.
    fn abstracted(&self, x: f32, y: f32) -> Vec3 {
        let paint = |value: f32| PAINTS[((value * PAINTS.len() as f32) as usize).min(PAINTS.len() - 1)];
        let wide = self.half[0] / self.half[1];
        let [ground, ..] = fractions(self.seed, [0, 0, 66]);
        let mut colour = blend(paint(ground), Vec3::splat(0.85), 0.55);
        for index in 0..14 {
            let [a, b, c, d] = fractions(self.seed, [index, 0, 67]);
            let [e, f, ..] = fractions(self.seed, [index, 1, 67]);
            let (dx, dy) = (x - wide * (2.0 * a - 1.0), y - (2.0 * b - 1.0));
            let size = 0.12 + 0.34 * c;
            let distance = match floor_to_i32(4.0 * d) {
                0 => sqrt(dx * dx + dy * dy) - size,
                1 => abs(sqrt(dx * dx + dy * dy) - size) - 0.06,
                2 => max(abs(dx) - size, abs(dy) - 0.5 * size),
                _ => min(max(abs(dx) - 0.03, abs(dy) - 1.4 * size), max(abs(dy) - 0.03, abs(dx) - 1.4 * size)),
            };
            colour = blend(colour, paint(e) * (0.8 + 0.3 * f), inside(distance, 0.02));
        }
        colour
    }
}
