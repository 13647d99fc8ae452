//! Printed letters.

use super::font::{GLYPH_COUNT, GLYPH_SIZE, has_dot};
use super::{Plane, worn};
use crate::scenes::noise::fractions;
use viewfuse_core::Vec3;
use viewfuse_core::math::{abs, floor_to_i32, max};

/// How letters are set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// Lines of words, as in a book or a newspaper.
    Page,
    /// Lines of large and small words in several colours.
    Poster,
    /// One letter on each face of a cube around the local origin, in a frame.
    Cube,
}

/// Letters on paper or wood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Letters {
    /// Under the letters.
    pub paper: Vec3,
    /// The letters.
    pub inks: [Vec3; 3],
    /// How they are set.
    pub setting: Setting,
    /// The plane of a page or a poster; a cube has all three.
    pub plane: Plane,
    /// Half of the width and height of the page or the face.
    pub half: [f32; 2],
    /// Height of a small letter with the space above it; a cube needs none.
    pub line: f32,
    pub seed: u32,
}

impl Letters {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        let colour = match self.setting {
            Setting::Page => {
                let [x, y, _] = self.plane.coordinates(p);
                self.page(x, y, self.line, 0)
            }
            Setting::Poster => {
                let [x, y, _] = self.plane.coordinates(p);
                self.poster(x, y)
            }
            Setting::Cube => self.cube(p),
        };
        worn(worn(colour, p, 0.02, 0.1, self.seed ^ 5), p, 0.3, 0.16, self.seed ^ 6)
    }

    /// Words in lines, with margins and an indent here and there.
    fn page(&self, x: f32, y: f32, line: f32, ink: usize) -> Vec3 {
        let margin = 1.2 * line;
        if abs(x) > self.half[0] - margin || abs(y) > self.half[1] - margin {
            return self.paper;
        }
        let row = floor_to_i32(y / line);
        let within = y - row as f32 * line;
        let pitch = line * 0.55;
        let letter = floor_to_i32(x / pitch);
        let [indent, end, bold, _] = fractions(self.seed, [row, 0, 50]);
        let first = if indent < 0.2 { -self.half[0] + 4.0 * margin } else { -self.half[0] + margin };
        let last = if end < 0.25 { self.half[0] * (end * 4.0) } else { self.half[0] - margin };
        let [glyph, space, ..] = fractions(self.seed, [row, letter, 51]);
        if x < first || x > last || space < 0.17 {
            return self.paper;
        }
        let dot = [(x - letter as f32 * pitch) / pitch * 6.5, within / line * 10.0];
        let hit = has_dot((glyph * GLYPH_COUNT as f32) as u32, floor_to_i32(dot[0]), floor_to_i32(dot[1]));
        if hit { self.inks[if bold < 0.1 { 1 } else { ink }] } else { self.paper }
    }

    /// A coloured head with large letters, stripes of letters below, and small print.
    fn poster(&self, x: f32, y: f32) -> Vec3 {
        let [w, h] = self.half;
        if max(abs(x) - w, abs(y) - h) > -0.4 * self.line {
            return self.inks[0];
        }
        // From the top: five lines, the first ones large.
        let heights = [0.3, 0.2, 0.14, 0.2];
        let mut top = h - 0.4 * self.line;
        for (index, part) in heights.into_iter().enumerate() {
            let height = part * 2.0 * h;
            if y > top - height {
                let back = [self.inks[0], self.paper, self.inks[1], self.paper][index];
                let ink = [self.paper, self.inks[1], self.paper, self.inks[2]][index];
                return self.word(x, (y - top + height) / height, height, index as i32, [back, ink]);
            }
            top -= height;
        }
        self.page(x, y, self.line, 2)
    }

    /// One line of letters over the whole width; `up` goes from 0 to 1.
    fn word(&self, x: f32, up: f32, height: f32, row: i32, [back, ink]: [Vec3; 2]) -> Vec3 {
        let pitch = 0.72 * height;
        let letter = floor_to_i32(x / pitch);
        let [glyph, ..] = fractions(self.seed, [row, letter, 52]);
        let (u, v) = (x / pitch - letter as f32, up);
        let dot = [floor_to_i32((u - 0.12) / 0.76 * 5.0), floor_to_i32((v - 0.14) / 0.72 * 7.0)];
        if has_dot((glyph * GLYPH_COUNT as f32) as u32, dot[0], dot[1]) { ink } else { back }
    }

    /// The face that the point is on shows a letter in a frame; opposite faces differ.
    fn cube(&self, p: Vec3) -> Vec3 {
        let (x, y, z) = (abs(p.x), abs(p.y), abs(p.z));
        let side = |value: f32| if value < 0.0 { -1.0 } else { 1.0 };
        let (face, right, up) = if x >= y && x >= z {
            (i32::from(p.x > 0.0), p.y * side(p.x), p.z)
        } else if y >= z {
            (2 + i32::from(p.y > 0.0), -p.x * side(p.y), p.z)
        } else {
            (4 + i32::from(p.z > 0.0), p.x, p.y * side(p.z))
        };
        let [glyph, choice, other, _] = fractions(self.seed, [face, 0, 53]);
        let (u, v) = (right / self.half[0], up / self.half[1]);
        let ink = self.inks[((choice * 3.0) as usize).min(2)];
        if max(abs(u), abs(v)) > 0.8 {
            return ink;
        }
        let paper = if other < 0.4 {
            self.inks[((choice * 3.0) as usize + 1) % 3] * 0.5 + self.paper * 0.5
        } else {
            self.paper
        };
        let [width, height] = GLYPH_SIZE;
        let dot = [(u + 0.52) / 1.04 * width as f32, (v + 0.62) / 1.24 * height as f32];
        let hit = has_dot((glyph * GLYPH_COUNT as f32) as u32, floor_to_i32(dot[0]), floor_to_i32(dot[1]));
        if hit { ink } else { paper }
    }
}
