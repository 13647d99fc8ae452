//! The census of a plane sweep, in 16-bit integers: a group of planes is a vector. The body's numbers are whole, and
//! their sums exact in any order, so the results are the same bits. Here each pair sums up the window by itself, and
//! its weight multiplies the sum. Most pixels are seen by all views, in all planes of a group: then no pair needs to
//! ask who sees what.

use super::tracks::whole;
use crate::parallel::for_each_row;
use pulp::{Arch, Simd, WithSimd};
use viewfuse_core::math::{max, min};
use viewfuse_kernels::plane_sweep::census::{
    CONTRAST, GREY_STEPS, HALF_WINDOW, MAX_GREY, REACH, cost_of_sums, weight_steps,
};
use viewfuse_kernels::plane_sweep::evidence::ViewPair;
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::{MAX_MATCHED, PLANES, Planes};

/// A whole number of each plane of a group: a grey, a difference, or a mask whose bits are all 1 or all 0.
type Whole = [i16; PLANES];

const MOST: i16 = CONTRAST as i16;
const ALL: i16 = -1;

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
    fn with_simd<S: Simd>(self, _: S) {
        let Census { block, pairs, grey, evidence, row, costs } = self;
        let (width, groups) = (block.camera.width as usize, block.group_count as usize);
        let row_len = width * groups;
        let reach = REACH as usize;
        // The rows of the window's first half.
        let first_row = row.saturating_sub(reach);
        let greys = Greys::new(block, grey, first_row * row_len..(row + 1) * row_len);
        let mut window = Window::new();
        for column in 0..width {
            // The half of the window before the pixel, as in the body.
            let mut before = [0; HALF_WINDOW];
            let mut count = 0;
            for offset in 0..HALF_WINDOW {
                let (x, y) = ((column + offset % 5).checked_sub(reach), (row + offset / 5).checked_sub(reach));
                if let (Some(x), Some(y)) = (x.filter(|x| *x < width), y) {
                    before[count] = ((y - first_row) * width + x) * groups;
                    count += 1;
                }
            }
            for group in 0..groups {
                let here = (row - first_row) * row_len + column * groups + group;
                window.compare(&greys, here, before[..count].iter().map(|first| first + group));
                let at = 2 * (column * groups + group);
                let sums = window.sums(pairs, count);
                costs[at..at + 2].copy_from_slice(&cost_of_sums(block, evidence, first_row * row_len + here, &sums));
            }
        }
    }
}

/// The greys of some rows in steps, the views of a group beside each other.
struct Greys {
    view_count: usize,
    steps: Vec<Whole>,
    /// Whether all views see all planes of a group.
    are_all_seen: Vec<bool>,
}

impl Greys {
    #[inline(always)]
    fn new(block: &FrustumBlock, grey: &[Planes], rows: std::ops::Range<usize>) -> Greys {
        let view_count = block.view_count as usize;
        let slice = (block.row_count * block.camera.width * block.group_count) as usize;
        let mut steps = Vec::with_capacity(rows.len() * view_count);
        let mut are_all_seen = Vec::with_capacity(rows.len());
        for at in rows {
            let mut least = [0; PLANES];
            for slot in 0..view_count {
                let greys = grey[slot * slice + at].map(grey_steps);
                for plane in 0..PLANES {
                    least[plane] = least[plane].min(greys[plane]);
                }
                steps.push(greys);
            }
            are_all_seen.push(least.iter().fold(true, |seen, least| seen & (*least >= 0)));
        }
        Greys { view_count, steps, are_all_seen }
    }

    /// A group's greys, a view after the other.
    #[inline(always)]
    fn of(&self, at: usize) -> &[Whole] {
        &self.steps[at * self.view_count..][..self.view_count]
    }
}

/// A grey in steps, as the body's. Where the view does not see the point it is some negative number, which no sum
/// takes.
#[inline(always)]
fn grey_steps(grey: f32) -> i16 {
    whole(max(min(grey * GREY_STEPS, MAX_GREY), -1.0)) as i16
}

/// A pixel of each view beside those of its window's first half.
struct Window {
    /// How much lighter the pixel is.
    lighter: [[Whole; HALF_WINDOW]; MAX_MATCHED],
    /// Where the view sees both.
    valid: [[Whole; HALF_WINDOW]; MAX_MATCHED],
    are_all_seen: bool,
}

impl Window {
    fn new() -> Window {
        let none = [[[0; PLANES]; HALF_WINDOW]; MAX_MATCHED];
        Window { lighter: none, valid: none, are_all_seen: false }
    }

    /// A group at a place, and at the places around it.
    #[inline(always)]
    fn compare(&mut self, greys: &Greys, here: usize, around: impl Iterator<Item = usize>) {
        let grey = greys.of(here);
        self.are_all_seen = greys.are_all_seen[here];
        for (index, there) in around.enumerate() {
            self.are_all_seen &= greys.are_all_seen[there];
            for (slot, (grey, other)) in grey.iter().zip(greys.of(there)).enumerate() {
                let (lighter, valid) = (&mut self.lighter[slot][index], &mut self.valid[slot][index]);
                for plane in 0..PLANES {
                    lighter[plane] = (grey[plane] - other[plane]).clamp(-MOST, MOST);
                    valid[plane] = if grey[plane].min(other[plane]) >= 0 { ALL } else { 0 };
                }
            }
        }
    }

    /// The pairs' sums over so many places: difference, weight, contrast.
    #[inline(always)]
    fn sums(&self, pairs: &[ViewPair], count: usize) -> [Planes; 3] {
        let mut sums = [[0.0; PLANES]; 3];
        for pair in pairs {
            let (a, b) = (pair.first as usize % MAX_MATCHED, pair.second as usize % MAX_MATCHED);
            let of_pair = if self.are_all_seen { self.of_seen_pair(a, b, count) } else { self.of_pair(a, b, count) };
            let weight = weight_steps(pair) as f32;
            for (sum, of_pair) in sums.iter_mut().zip(&of_pair) {
                for plane in 0..PLANES {
                    sum[plane] += weight * f32::from(of_pair[plane]);
                }
            }
        }
        sums
    }

    /// A pair's sums over so many places, without its weight.
    #[inline(always)]
    fn of_pair(&self, a: usize, b: usize, count: usize) -> [Whole; 3] {
        let (mut difference, mut seen, mut contrast) = ([0; PLANES], [0; PLANES], [0; PLANES]);
        for index in 0..count {
            let (first, second) = (&self.lighter[a][index], &self.lighter[b][index]);
            let (first_valid, second_valid) = (&self.valid[a][index], &self.valid[b][index]);
            for plane in 0..PLANES {
                let valid = first_valid[plane] & second_valid[plane];
                difference[plane] += (first[plane] - second[plane]).abs().min(MOST) & valid;
                seen[plane] -= valid;
                contrast[plane] += first[plane].abs().max(second[plane].abs()) & valid;
            }
        }
        [difference, seen, contrast]
    }

    /// The same where all views see all.
    #[inline(always)]
    fn of_seen_pair(&self, a: usize, b: usize, count: usize) -> [Whole; 3] {
        let (mut difference, mut contrast) = ([0; PLANES], [0; PLANES]);
        for index in 0..count {
            let (first, second) = (&self.lighter[a][index], &self.lighter[b][index]);
            for plane in 0..PLANES {
                difference[plane] += (first[plane] - second[plane]).abs().min(MOST);
                contrast[plane] += first[plane].abs().max(second[plane].abs());
            }
        }
        [difference, [count as i16; PLANES], contrast]
    }
}
