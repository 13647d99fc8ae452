//! Soft census: whether a pixel is lighter or darker than its neighbours, compared across all views.
//!
//! Greys and the pairs' weights enter in whole steps. Their products and sums then are whole numbers below `2^24`,
//! which `f32` holds exactly: they are the same in any order, and a CPU may compute them with 16-bit integers.

use super::evidence::{UNSEEN, ViewPair};
use super::frustum::FrustumBlock;
use super::{MAX_MATCHED, PLANES, Planes};
use viewfuse_core::math::{abs, clamp, max, min};

/// Reach of the census window, in pixels to each side.
pub const REACH: u32 = 2;
/// Most pixels of the window's first half.
pub const HALF_WINDOW: usize = 12;
/// Steps of a grey from black to white.
pub const GREY_STEPS: f32 = 1024.0;
/// The lightest grey, in steps: differences of two greys fit into 16 bits.
pub const MAX_GREY: f32 = 16383.0;
/// Difference of grey from which on a pixel counts fully as lighter or darker, in steps: 0.04.
pub const CONTRAST: f32 = 41.0;
/// Steps of the weight of a pair, where all pairs together have a weight of 1.
pub const WEIGHT_STEPS: f32 = 16384.0;
/// Share of the difference of colours in the cost.
pub const COLOUR_SHARE: f32 = 0.2;
/// Share of the census, a number in `[0, 1]`, in the cost.
pub const CENSUS_SHARE: f32 = 0.2;
/// Weight of a pixel without texture.
pub const MIN_TOLD: f32 = 0.1;
/// Mean contrast, in [`CONTRAST`], from which on a pixel has its full weight.
pub const FULL_TEXTURE: f32 = 0.3;
/// The cost of a point that some silhouette does not contain.
pub const OUTSIDE_COST: f32 = 0.5;

// The sum over a window's first half of all pairs is exact.
const _: () = assert!(HALF_WINDOW as f32 * CONTRAST * WEIGHT_STEPS < 16_777_216.0);

/// A grey in whole steps, rounded down; [`UNSEEN`] stays negative.
#[inline(always)]
pub fn grey_steps(grey: f32) -> i32 {
    min(grey * GREY_STEPS, MAX_GREY) as i32
}

/// The weight of a pair in whole steps, rounded down.
#[inline(always)]
pub fn weight_steps(pair: &ViewPair) -> i32 {
    (pair.weight * WEIGHT_STEPS) as i32
}

/// Cost of a group of planes at a pixel of a band, times its weight, and the weight.
///
/// `grey[view][row][column][group]` and `evidence[row][column][group][difference, weight, dissent, hull]` are of the
/// band; `pixel` is counted in it.
#[inline(always)]
pub fn census_cost(
    frustum: &FrustumBlock,
    pairs: &[ViewPair],
    grey: &[Planes],
    evidence: &[Planes],
    pixel: u32,
    group: u32,
) -> [Planes; 2] {
    let (width, height) = (frustum.camera.width as i32, frustum.row_count as i32);
    let (column, row) = (pixel as i32 % width, pixel as i32 / width);
    let groups = frustum.group_count as usize;
    let slice = (width * height) as usize * groups;
    let here = pixel as usize * groups + group as usize;
    let mut sum = [0.0; PLANES];
    let mut count = [0.0; PLANES];
    let mut texture = [0.0; PLANES];
    // The half of the window before the pixel: the other half gives the same comparisons with the opposite sign.
    let mut offset = 0;
    while offset < HALF_WINDOW as i32 {
        let (x, y) = (column + offset % 5 - REACH as i32, row + offset / 5 - REACH as i32);
        if x >= 0 && x < width && y >= 0 {
            let there = (y * width + x) as usize * groups + group as usize;
            let mut lighter = [[UNSEEN; PLANES]; MAX_MATCHED];
            let mut valid = [[0.0; PLANES]; MAX_MATCHED];
            let mut slot = 0;
            while slot < frustum.view_count as usize {
                let (here_grey, other) = (&grey[slot * slice + here], &grey[slot * slice + there]);
                let mut plane = 0;
                while plane < PLANES {
                    let (here_grey, other) = (grey_steps(here_grey[plane]) as f32, grey_steps(other[plane]) as f32);
                    lighter[slot][plane] = clamp(here_grey - other, -CONTRAST, CONTRAST);
                    valid[slot][plane] = if min(here_grey, other) >= 0.0 { 1.0 } else { 0.0 };
                    plane += 1;
                }
                slot += 1;
            }
            let mut index = 0;
            while index < frustum.pair_count as usize {
                let pair = &pairs[index];
                let (a, b) = (pair.first as usize, pair.second as usize);
                let weight = weight_steps(pair) as f32;
                let mut plane = 0;
                while plane < PLANES {
                    let seen = valid[a][plane] * valid[b][plane] * weight;
                    sum[plane] += seen * min(abs(lighter[a][plane] - lighter[b][plane]), CONTRAST);
                    count[plane] += seen;
                    texture[plane] += seen * max(abs(lighter[a][plane]), abs(lighter[b][plane]));
                    plane += 1;
                }
                index += 1;
            }
        }
        offset += 1;
    }
    cost_of_sums(frustum, evidence, here, &[sum, count, texture])
}

/// Cost and weight of a group of planes, from the pairs' sums `[difference, weight, contrast]` over the census window,
/// in steps, and the group's `evidence[here][difference, weight, dissent, hull]`.
#[inline(always)]
pub fn cost_of_sums(frustum: &FrustumBlock, evidence: &[Planes], here: usize, sums: &[Planes; 3]) -> [Planes; 2] {
    let (difference, weight) = (&evidence[4 * here], &evidence[4 * here + 1]);
    let (dissent, hull) = (&evidence[4 * here + 2], &evidence[4 * here + 3]);
    let [sum, count, texture] = sums;
    let mut cost = [0.0; PLANES];
    let mut share = [0.0; PLANES];
    let mut plane = 0;
    while plane < PLANES {
        let colour = difference[plane] / max(weight[plane], 1.0e-6);
        // The weight of all pairs, in steps; where there is none, the sums are 0.
        let steps = max(count[plane], 1.0);
        let census = sum[plane] / steps * (1.0 / CONTRAST);
        let matched = COLOUR_SHARE * colour + CENSUS_SHARE * census + frustum.dissent_share * dissent[plane];
        let inside = hull[plane];
        let told = MIN_TOLD + (1.0 - MIN_TOLD) * min(texture[plane] / steps * (1.0 / (CONTRAST * FULL_TEXTURE)), 1.0);
        let weight = weight[plane] * told;
        share[plane] = weight * inside + (1.0 - inside);
        cost[plane] = matched * weight * inside + OUTSIDE_COST * (1.0 - inside);
        plane += 1;
    }
    [cost, share]
}
