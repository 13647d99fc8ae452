//! Counter-based random draws: the same on every device, in any order of evaluation.
//!
//! Threefry-2x32 with 20 rounds (Salmon, Moraes, Dror, Shaw: "Parallel random numbers: as easy as 1, 2, 3", SC 2011):
//! only 32-bit additions, rotations and exclusive-ors, which every GPU and microcontroller has. The key is the run's
//! seed, the counter is the index of the draw: `(pixel, sample)`.

use crate::math::{ln, sin_cos, sqrt};
use core::f32::consts::TAU;

/// Two random words for a key and a counter (Threefry-2x32-20).
#[inline]
pub fn threefry_2x32(key: [u32; 2], counter: [u32; 2]) -> [u32; 2] {
    const PARITY: u32 = 0x1bd1_1bda;
    let schedule = [key[0], key[1], PARITY ^ key[0] ^ key[1]];
    let mut x = counter[0].wrapping_add(schedule[0]);
    let mut y = counter[1].wrapping_add(schedule[1]);
    // Rotations are spelled out four at a time: as a table that is indexed in a loop they cost three times as much.
    let mut group = 0;
    while group < 5 {
        if group % 2 == 0 {
            (x, y) = four_rounds(x, y, 13, 15, 26, 6);
        } else {
            (x, y) = four_rounds(x, y, 17, 29, 16, 24);
        }
        group += 1;
        x = x.wrapping_add(schedule[group % 3]);
        y = y.wrapping_add(schedule[(group + 1) % 3]).wrapping_add(group as u32);
    }
    [x, y]
}

#[inline(always)]
fn four_rounds(x: u32, y: u32, a: u32, b: u32, c: u32, d: u32) -> (u32, u32) {
    let (x, y) = one_round(x, y, a);
    let (x, y) = one_round(x, y, b);
    let (x, y) = one_round(x, y, c);
    one_round(x, y, d)
}

#[inline(always)]
fn one_round(x: u32, y: u32, rotation: u32) -> (u32, u32) {
    let x = x.wrapping_add(y);
    (x, y.rotate_left(rotation) ^ x)
}

/// A number in `[0, 1)`, a multiple of `2^-24`, for a seed, a pixel (flat row-major index) and a sample.
#[inline]
pub fn uniform(seed: u64, pixel: u32, sample: u32) -> f32 {
    uniform_from([seed as u32, (seed >> 32) as u32], pixel, sample)
}

/// As [`uniform`], from the seed's low and high word: not every GPU has 64-bit integers.
#[inline]
pub fn uniform_from(seed: [u32; 2], pixel: u32, sample: u32) -> f32 {
    uniform_pair(seed, pixel, sample)[0]
}

/// Two independent numbers as [`uniform_from`] gives one, the first of them the same.
#[inline]
pub fn uniform_pair(seed: [u32; 2], pixel: u32, sample: u32) -> [f32; 2] {
    let words = threefry_2x32(seed, [pixel, sample]);
    [fraction(words[0]), fraction(words[1])]
}

/// A number of mean 0 and variance 1, normally distributed (Box and Muller 1958); its magnitude is at most 5.8.
#[inline]
pub fn normal(seed: [u32; 2], pixel: u32, sample: u32) -> f32 {
    let [u, v] = uniform_pair(seed, pixel, sample);
    // In (0, 1], so that the logarithm is finite.
    let (_, cosine) = sin_cos(TAU * v);
    sqrt(-2.0 * ln(1.0 - u)) * cosine
}

#[inline(always)]
fn fraction(word: u32) -> f32 {
    (word >> 8) as f32 * (1.0 / 16_777_216.0)
}
