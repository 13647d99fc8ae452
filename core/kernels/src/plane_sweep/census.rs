//! Soft census: whether a pixel is lighter or darker than its neighbours, compared across all views.

use super::evidence::{UNSEEN, ViewPair};
use super::frustum::FrustumBlock;
use super::{MAX_MATCHED, PLANES, Planes};
use viewfuse_core::math::{abs, clamp, max, min};

/// Reach of the census window, in pixels to each side.
pub const REACH: u32 = 2;
/// Difference of grey from which on a pixel counts fully as lighter or darker.
pub const CONTRAST: f32 = 0.04;
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

/// Cost of a group of planes at a pixel of a band, times its weight, and the weight.
///
/// `grey[view][row][column][group]` and `evidence[row][column][group][difference, weight, dissent, hull]` are of the band;
/// `pixel` is counted in it.
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
    while offset < 12 {
        let (x, y) = (column + offset % 5 - REACH as i32, row + offset / 5 - REACH as i32);
        if x >= 0 && x < width && y >= 0 {
            let there = (y * width + x) as usize * groups + group as usize;
            let mut lighter = [[UNSEEN; PLANES]; MAX_MATCHED];
            let mut valid = [[0.0; PLANES]; MAX_MATCHED];
            let mut slot = 0;
            while slot < frustum.view_count as usize {
                let (own, other) = (&grey[slot * slice + here], &grey[slot * slice + there]);
                let mut plane = 0;
                while plane < PLANES {
                    lighter[slot][plane] = clamp((own[plane] - other[plane]) * (1.0 / CONTRAST), -1.0, 1.0);
                    valid[slot][plane] = if min(own[plane], other[plane]) >= 0.0 { 1.0 } else { 0.0 };
                    plane += 1;
                }
                slot += 1;
            }
            let mut index = 0;
            while index < frustum.pair_count as usize {
                let pair = &pairs[index];
                let (a, b) = (pair.first as usize, pair.second as usize);
                let mut plane = 0;
                while plane < PLANES {
                    let seen = valid[a][plane] * valid[b][plane] * pair.weight;
                    sum[plane] += seen * min(abs(lighter[a][plane] - lighter[b][plane]), 1.0);
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

/// Cost and weight of a group of planes, from the pairs' sums `[difference, weight, contrast]` over the census window and the
/// group's `evidence[here][difference, weight, dissent, hull]`.
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
        let census = sum[plane] / max(count[plane], 1.0e-6);
        let matched = COLOUR_SHARE * colour + CENSUS_SHARE * census + frustum.dissent_share * dissent[plane];
        let inside = hull[plane];
        let told =
            MIN_TOLD + (1.0 - MIN_TOLD) * min(texture[plane] / max(count[plane], 1.0e-6) * (1.0 / FULL_TEXTURE), 1.0);
        let weight = weight[plane] * told;
        share[plane] = weight * inside + (1.0 - inside);
        cost[plane] = matched * weight * inside + OUTSIDE_COST * (1.0 - inside);
        plane += 1;
    }
    [cost, share]
}
