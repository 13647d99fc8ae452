//! Random numbers that belong to places: the same place has the same number, whatever was asked before.
//!
//! Cheaper than the counter-based generator that draws objects, and good enough for grain, stains and bricks. The hash
//! is PCG4D (M. Jarzynski and M. Olano, "Hash functions for GPU rendering", JCGT 9 (2020)).

use viewfuse_core::Vec3;
use viewfuse_core::math::floor_to_i32;

/// Four words that depend on the seed and a cell of the unit grid.
pub fn words(seed: u32, cell: [i32; 3]) -> [u32; 4] {
    let step = |word: u32| word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    let mut v = [step(cell[0] as u32), step(cell[1] as u32), step(cell[2] as u32), step(seed)];
    for round in 0..2 {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[3]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
        v[3] = v[3].wrapping_add(v[1].wrapping_mul(v[2]));
        if round == 0 {
            v = v.map(|word| word ^ (word >> 16));
        }
    }
    v
}

/// A number in `[0, 1)` from the upper 24 bits of a word.
pub fn fraction(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Four numbers in `[0, 1)` of a cell.
pub fn fractions(seed: u32, cell: [i32; 3]) -> [f32; 4] {
    words(seed, cell).map(fraction)
}

/// The unit cell that a point lies in.
pub fn cell_of(p: Vec3) -> [i32; 3] {
    [floor_to_i32(p.x), floor_to_i32(p.y), floor_to_i32(p.z)]
}

/// Random values in `[0, 1)` at whole-numbered points, and a smooth blend between them.
pub fn smooth(p: Vec3, seed: u32) -> f32 {
    let [x, y, z] = cell_of(p);
    let ease = |t: f32| t * t * (3.0 - 2.0 * t);
    let blend = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let (tx, ty, tz) = (ease(p.x - x as f32), ease(p.y - y as f32), ease(p.z - z as f32));
    let value = |dx: i32, dy: i32, dz: i32| {
        let cell = [x.wrapping_add(dx), y.wrapping_add(dy), z.wrapping_add(dz)];
        fraction(words(seed, cell)[3])
    };
    let edge = |dy: i32, dz: i32| blend(value(0, dy, dz), value(1, dy, dz), tx);
    let face = |dz: i32| blend(edge(0, dz), edge(1, dz), ty);
    blend(face(0), face(1), tz)
}

/// Octaves of [`smooth`] noise, each half as large and half as strong as the one before; about 0.5, in `[0, 1)`.
pub fn layered(p: Vec3, seed: u32, octave_count: u32) -> f32 {
    let (mut sum, mut weight, mut total, mut place) = (0.0, 1.0, 0.0, p);
    for octave in 0..octave_count {
        sum += weight * smooth(place, seed.wrapping_add(octave));
        total += weight;
        weight *= 0.5;
        place = place * 2.03 + Vec3::splat(7.3);
    }
    if total > 0.0 { sum / total } else { 0.5 }
}

/// Linear blend of two colours.
pub fn blend(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a + (b - a) * t
}
