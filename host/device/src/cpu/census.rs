//! The census of a plane sweep, in vectors of planes. The sums are those of the body, in their order, so the results are the same
//! bits. Most pixels are seen by all views, in all planes of a group: then no pair needs to ask who sees what.

use crate::parallel::for_each_row;
use pulp::{Arch, Simd, WithSimd};
use viewfuse_kernels::plane_sweep::census::{CONTRAST, REACH, cost_of_sums};
use viewfuse_kernels::plane_sweep::evidence::ViewPair;
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::{MAX_MATCHED, PLANES, Planes};

pub(super) fn census_cost(
    block: &FrustumBlock,
    first_row: u32,
    row_count: u32,
    pairs: &[ViewPair],
    grey: &[Planes],
    evidence: &[Planes],
    costs: &mut [Planes],
) {
    let row_len = (block.camera.width * block.group_count) as usize;
    let pairs = &pairs[..block.pair_count as usize];
    let first = 2 * (block.first_row + first_row) as usize * row_len;
    for_each_row(&mut costs[first..][..2 * row_count as usize * row_len], 2 * row_len, 256, |row, costs| {
        Arch::new().dispatch(Census { block, pairs, grey, evidence, row: first_row as usize + row, costs });
    });
}

/// A row of a band.
struct Census<'a> {
    block: &'a FrustumBlock,
    pairs: &'a [ViewPair],
    grey: &'a [Planes],
    evidence: &'a [Planes],
    row: usize,
    costs: &'a mut [Planes],
}

impl WithSimd for Census<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Census { block, pairs, grey, evidence, row, costs } = self;
        let (width, groups) = (block.camera.width as usize, block.group_count as usize);
        let row_len = width * groups;
        let slice = block.row_count as usize * row_len;
        let view_count = block.view_count as usize;
        let reach = REACH as usize;
        // Of the rows of the window's first half, the groups of planes that all views see.
        let first_row = row.saturating_sub(reach);
        let seen: Vec<bool> = (first_row * row_len..(row + 1) * row_len)
            .map(|at| (0..view_count).all(|slot| is_seen(&grey[slot * slice + at])))
            .collect();
        for column in 0..width {
            // The half of the window before the pixel, as in the body.
            let mut before = [0; 12];
            let mut count = 0;
            for offset in 0..12 {
                let (x, y) = ((column + offset % 5).checked_sub(reach), (row + offset / 5).checked_sub(reach));
                if let (Some(x), Some(y)) = (x.filter(|x| *x < width), y) {
                    before[count] = (y * width + x) * groups;
                    count += 1;
                }
            }
            for group in 0..groups {
                let here = (row * width + column) * groups + group;
                let mut sums = [[0.0; PLANES]; 3];
                for first in before[..count].iter().map(|first| first + group) {
                    let all_seen = seen[here - first_row * row_len] && seen[first - first_row * row_len];
                    let of = |slot: usize| [&grey[slot * slice + here], &grey[slot * slice + first]];
                    add_census(simd, pairs, view_count, of, all_seen, &mut sums);
                }
                let at = 2 * (column * groups + group);
                costs[at..at + 2].copy_from_slice(&cost_of_sums(block, evidence, here, &sums));
            }
        }
    }
}

#[inline(always)]
fn is_seen(grey: &Planes) -> bool {
    grey.iter().fold(true, |seen, grey| seen & (*grey >= 0.0))
}

/// Adds the pairs' comparisons of a pixel with one of its window to `[difference, weight, contrast]`; `of` gives a view's grey at
/// both. Where all views see both the weights need no products: 1 times 1 times a weight is the weight.
#[inline(always)]
fn add_census<'a, S: Simd>(
    simd: S,
    pairs: &[ViewPair],
    view_count: usize,
    of: impl Fn(usize) -> [&'a Planes; 2],
    all_seen: bool,
    sums: &mut [Planes; 3],
) {
    let [difference, weight, contrast] = sums;
    let (differences, _) = S::as_mut_simd_f32s(difference);
    let (weights, _) = S::as_mut_simd_f32s(weight);
    let (contrasts, _) = S::as_mut_simd_f32s(contrast);
    let (zero, one, minus) = (simd.splat_f32s(0.0), simd.splat_f32s(1.0), simd.splat_f32s(-1.0));
    let scale = simd.splat_f32s(1.0 / CONTRAST);
    for lane in 0..differences.len() {
        let mut lighter = [zero; MAX_MATCHED];
        let mut strength = [zero; MAX_MATCHED];
        let mut valid = [one; MAX_MATCHED];
        for slot in 0..view_count {
            let [own, other] = of(slot);
            let (own, other) = (S::as_simd_f32s(own).0[lane], S::as_simd_f32s(other).0[lane]);
            let steps = simd.mul_f32s(simd.sub_f32s(own, other), scale);
            lighter[slot] = simd.min_f32s(simd.max_f32s(steps, minus), one);
            strength[slot] = simd.abs_f32s(lighter[slot]);
            if !all_seen {
                let both = simd.greater_than_or_equal_f32s(simd.min_f32s(own, other), zero);
                valid[slot] = simd.select_f32s(both, one, zero);
            }
        }
        let (mut sum, mut count, mut texture) = (differences[lane], weights[lane], contrasts[lane]);
        for pair in pairs {
            let (a, b) = (pair.first as usize % MAX_MATCHED, pair.second as usize % MAX_MATCHED);
            let mut seen = simd.splat_f32s(pair.weight);
            if !all_seen {
                seen = simd.mul_f32s(simd.mul_f32s(valid[a], valid[b]), seen);
            }
            let apart = simd.min_f32s(simd.abs_f32s(simd.sub_f32s(lighter[a], lighter[b])), one);
            sum = simd.add_f32s(sum, simd.mul_f32s(seen, apart));
            count = simd.add_f32s(count, seen);
            texture = simd.add_f32s(texture, simd.mul_f32s(seen, simd.max_f32s(strength[a], strength[b])));
        }
        (differences[lane], weights[lane], contrasts[lane]) = (sum, count, texture);
    }
}
