//! Wallpaper: flowers, stripes or a trellis, printed.

use super::{Plane, inside, worn};
use crate::scenes::noise::{blend, fractions, layered};
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, floor_to_i32, min, sin_cos, sqrt};

/// What is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motif {
    /// Flowers and leaves strewn in half drops.
    Flowers,
    /// Broad stripes with flowers between them.
    Stripes,
    /// A trellis of diamonds with something in each.
    Trellis,
}

/// Printed paper; no two flowers are turned alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wallpaper {
    /// The paper.
    pub ground: Vec3,
    /// Flowers, their hearts or the other flowers, leaves and lines.
    pub inks: [Vec3; 3],
    /// What is printed.
    pub motif: Motif,
    /// The plane of the wall.
    pub plane: Plane,
    /// From one flower to the next.
    pub repeat: f32,
    pub seed: u32,
}

/// Over this much, in repeats, a printed edge goes from one colour to the other.
const SOFT: f32 = 0.03;

impl Wallpaper {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        let [right, up, _] = self.plane.coordinates(p);
        let (x, y) = (right / self.repeat, up / self.repeat);
        let paper = match self.motif {
            Motif::Flowers => self.flowers(self.ground, x, y, 1.0),
            Motif::Stripes => {
                let band = x * 0.5;
                let place = abs(band - floor_to_i32(band) as f32 - 0.5);
                let broad = inside(place - 0.26, SOFT);
                let line = inside(abs(place - 0.31) - 0.018, SOFT);
                let striped = blend(self.ground, blend(self.ground, self.inks[2], 0.4), broad);
                self.flowers(blend(striped, self.inks[2], line), x - 0.5, y, 0.72)
            }
            Motif::Trellis => {
                let (a, b) = (0.6 * (x + y), 0.6 * (x - y));
                let near = |v: f32| abs(v - floor_to_i32(v + 0.5) as f32);
                let line = inside(min(near(a), near(b)) - 0.045, SOFT);
                let alternate = (floor_to_i32(a) ^ floor_to_i32(b)) & 1;
                let ground = blend(self.ground, self.inks[2], 0.22 * alternate as f32);
                let bloom = self.flower(
                    ground,
                    a - floor_to_i32(a) as f32,
                    b - floor_to_i32(b) as f32,
                    [floor_to_i32(a), floor_to_i32(b), 1],
                    0.36,
                );
                blend(bloom, self.inks[2], line)
            }
        };
        let age = layered(Vec3::new(right, up, 0.0) / 1.3, self.seed ^ 77, 3);
        worn(paper, Vec3::new(right, up, 0.0), 0.05, 0.1, self.seed ^ 78) * (0.84 + 0.3 * age)
    }

    /// Flowers in half drops with leaves between, `scale` of their full size.
    fn flowers(&self, ground: Vec3, x: f32, y: f32, scale: f32) -> Vec3 {
        let mut colour = ground;
        // Leaves on a winding stem between the columns.
        let column = floor_to_i32(x);
        let (sine, _) = sin_cos(2.6 * y + 3.0 * column as f32);
        let stem = x - column as f32 - 0.5 - 0.2 * sine;
        colour = blend(colour, self.inks[2], inside(abs(stem) - 0.016, SOFT));
        let leaf_row = floor_to_i32(y * 2.0);
        let [turn, side, size, _] = fractions(self.seed, [column, leaf_row, 7]);
        let side = if side < 0.5 { -1.0 } else { 1.0 };
        let (lx, ly) = (stem - 0.13 * side * scale, y - (leaf_row as f32 + 0.5) * 0.5);
        let (s, c) = sin_cos(side * (0.5 + 0.8 * turn));
        let (u, v) = (lx * c + ly * s, ly * c - lx * s);
        let leaf = sqrt(u * u * 3.2 + v * v * 14.0) - (0.2 + 0.12 * size) * scale;
        colour = blend(colour, self.inks[2] * (0.8 + 0.4 * size), inside(leaf, SOFT));
        // A flower in each cell; every second column is half a cell higher.
        let drop = if column & 1 == 0 { 0.0 } else { 0.5 };
        let row = floor_to_i32(y + drop);
        self.flower(colour, x - column as f32, y + drop - row as f32, [column, row, 2], 0.34 * scale)
    }

    /// A flower around the middle of a unit cell, up to `reach` in size.
    fn flower(&self, ground: Vec3, x: f32, y: f32, cell: [i32; 3], reach: f32) -> Vec3 {
        let [a, b, c, d] = fractions(self.seed, cell);
        let (dx, dy) = (x - 0.5 - 0.12 * (a - 0.5), y - 0.5 - 0.12 * (b - 0.5));
        let radius = sqrt(dx * dx + dy * dy);
        if radius > reach || radius == 0.0 {
            return ground;
        }
        // The cosine of five or six times the angle, from powers of the direction, turned at random.
        let (sine, cosine) = sin_cos(6.3 * c);
        let (ux, uy) = ((dx * cosine - dy * sine) / radius, (dx * sine + dy * cosine) / radius);
        let petal_count = if d < 0.5 { 5 } else { 6 };
        let (mut re, mut im) = (1.0, 0.0);
        for _ in 0..petal_count {
            (re, im) = (re * ux - im * uy, re * uy + im * ux);
        }
        let size = reach * (0.75 + 0.25 * a);
        let petals = inside(radius - size * (0.68 + 0.32 * re), SOFT);
        let inner = inside(radius - size * (0.45 - 0.2 * re), SOFT);
        let heart = inside(radius - 0.2 * size, SOFT);
        let swap = usize::from(b > 0.6);
        let ink = self.inks[swap] * (0.85 + 0.25 * c);
        let colour = blend(ground, ink, petals);
        let colour = blend(colour, blend(ink, self.ground, 0.45), inner);
        blend(colour, self.inks[1 - swap], heart)
    }
}
