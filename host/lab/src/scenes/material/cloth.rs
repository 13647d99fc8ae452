//! Woven cloth: warp and weft, each with its own sequence of coloured threads.

use super::Plane;
use crate::scenes::noise::{blend, fractions, layered, smooth};
use viewfuse_core::Vec3;
use viewfuse_core::math::floor_to_i32;

/// Checked or striped cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cloth {
    /// The threads, the first the commonest.
    pub colours: [Vec3; 3],
    /// The plane of the cloth.
    pub plane: Plane,
    /// Length of the sequence of threads.
    pub repeat: f32,
    /// Width of a thread.
    pub thread: f32,
    /// Whether only the threads along the second coordinate change: stripes, no checks.
    pub striped: bool,
    pub seed: u32,
}

/// Bands in a sequence.
const BAND_COUNT: i32 = 9;

impl Cloth {
    pub(super) fn colour(&self, p: Vec3) -> Vec3 {
        let [right, up, through] = self.plane.coordinates(p);
        let warp = self.band(right, 1);
        let weft = if self.striped { self.band(0.0, 2) } else { self.band(up, 1) };
        let (i, j) = (floor_to_i32(right / self.thread), floor_to_i32(up / self.thread));
        // A twill: over two, under two, moved on by one from thread to thread.
        let on_top = ((i + j) & 3) < 2;
        let [shade, ..] = fractions(self.seed, [i, j, 5]);
        let woven = blend(warp, weft, if on_top { 0.3 } else { 0.7 }) * (0.9 + 0.18 * shade);
        let place = Vec3::new(right, up, through);
        let fold = smooth(place / 0.6, self.seed ^ 3);
        let fluff = layered(place / (2.5 * self.thread), self.seed ^ 4, 2);
        woven * (0.8 + 0.16 * fold + 0.26 * fluff)
    }

    /// The thread's colour at a place along the sequence.
    fn band(&self, place: f32, which: i32) -> Vec3 {
        let turns = place / self.repeat;
        let within = turns - floor_to_i32(turns) as f32;
        // Bands of unequal width: places on the sequence are pushed together here and there.
        let bent = within + 0.09 * (smooth(Vec3::new(within * 5.0, 0.5, 0.5), self.seed ^ 11) - 0.5);
        let band = floor_to_i32(bent * BAND_COUNT as f32).clamp(0, BAND_COUNT - 1);
        let [choice, tint, ..] = fractions(self.seed, [band, which, 21]);
        let colour = if choice < 0.46 { 0 } else { 1 + usize::from(choice > 0.76) };
        self.colours[colour] * (0.9 + 0.2 * tint)
    }
}
