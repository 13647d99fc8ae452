//! The plane sweep's windows, with sums of rows that neighbouring windows share. A window's rows are summed in two
//! parts, each of which is an end of a run of rows (`rows_of_window`): here the second part grows by a row as the
//! window goes down, and the first parts of a whole run are summed once. The order is the body's, so the results are
//! the same bits.

use crate::parallel::for_each;
use pulp::{Arch, Simd, WithSimd};
use viewfuse_kernels::plane_sweep::window::{
    PRIOR_COST, SHARE, WindowBlock, add, add_near_cost, prior_weight, rows_of_window,
};
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// Groups of planes whose columns are summed at once: two cache lines of each row for each group, and all rows of a run
/// of 25 in the second-level cache.
const STRIP: usize = 32;

pub(super) fn window_cost(block: &WindowBlock, sums: &[Planes], means: &mut [Planes]) {
    let row_len = (block.width * block.group_count) as usize;
    let sums = sums.as_chunks().0.as_chunks().0;
    let mut strips: Vec<Strip> = (0..row_len).step_by(STRIP).map(|first| Strip { first, rows: Vec::new() }).collect();
    for row in means[..row_len * block.height as usize].chunks_exact_mut(row_len) {
        strips.iter_mut().zip(row.chunks_mut(STRIP)).for_each(|(strip, part)| strip.rows.push(part));
    }
    for_each(&mut strips, 1, |_, Strip { first, rows }| {
        Arch::new().dispatch(Columns { block, sums, first: *first, rows });
    });
}

/// The means of neighbouring groups of planes, in all rows.
struct Strip<'a> {
    /// The first group, counted in a row.
    first: usize,
    rows: Vec<&'a mut [Planes]>,
}

/// A strip that is computed.
struct Columns<'a, 'm> {
    block: &'a WindowBlock,
    /// `[row][column][group][window]`.
    sums: &'a [[Sums; 3]],
    /// As of the strip.
    first: usize,
    rows: &'a mut [&'m mut [Planes]],
}

/// A window's costs and weights, summed.
type Sums = [Planes; 2];
const NONE: Sums = [[0.0; PLANES]; 2];

impl WithSimd for Columns<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        for row in &mut *self.rows {
            row.fill([0.0; PLANES]);
        }
        for window in 0..3 {
            self.add_window(simd, window);
        }
        let groups = self.block.group_count as usize;
        for row in &mut *self.rows {
            for (group, mean) in (self.first..).zip(row.iter_mut()) {
                add_near_cost(mean, self.block, (group % groups) as u32);
            }
        }
    }
}

impl Columns<'_, '_> {
    /// Adds the means over a window.
    #[inline(always)]
    fn add_window<S: Simd>(&mut self, simd: S, window: usize) {
        let Columns { block, sums, first: first_group, ref mut rows } = *self;
        let row_len = (block.width * block.group_count) as usize;
        let len = rows.first().map_or(0, |row| row.len());
        let there = |row: usize| &sums[row * row_len + first_group..][..len];
        // The first parts that end at `before_split`: the sums of one row, of two, and so on.
        let mut before = vec![NONE; (2 * block.reach[window] as usize + 1) * len];
        let mut before_split = 0;
        let none = vec![NONE; len];
        // The second part, from `after_split` to `after_end`.
        let mut after = vec![NONE; len];
        let (mut after_split, mut after_end) = (0, 0);
        for (row, means) in (0..).zip(rows.iter_mut()) {
            let rows = rows_of_window(row, block.height, block.reach[window]);
            let [first, split, end] = [rows[0] as usize, rows[1] as usize, rows[2] as usize];
            if before_split != split {
                for (count, row) in (first..split).rev().enumerate() {
                    let (known, rest) = before.split_at_mut(count * len);
                    let less = if count > 0 { &known[(count - 1) * len..] } else { &none[..] };
                    for ((sums, less), more) in rest.iter_mut().zip(less).zip(there(row)) {
                        set_sums(sums, less, &more[window]);
                    }
                }
                before_split = split;
            }
            if after_split != split {
                after.fill(NONE);
                (after_split, after_end) = (split, split);
            }
            for row in after_end..end {
                for (sums, more) in after.iter_mut().zip(there(row)) {
                    add(&mut sums[0], &more[window][0]);
                    add(&mut sums[1], &more[window][1]);
                }
            }
            after_end = end;
            let before = if first < split { &before[(split - 1 - first) * len..] } else { &none[..] };
            for (group, (mean, (before, after))) in (first_group..).zip(means.iter_mut().zip(before.iter().zip(&after)))
            {
                let prior = prior_weight(block, window, group as u32 / block.group_count, rows);
                add_mean(simd, mean, SHARE[window], prior, before, after);
            }
        }
    }
}

/// Costs and weights of two parts. Written in place: sums that are returned are copied by a call.
#[inline(always)]
fn set_sums(sums: &mut Sums, first: &Sums, second: &Sums) {
    for part in 0..2 {
        for plane in 0..PLANES {
            sums[part][plane] = first[part][plane] + second[part][plane];
        }
    }
}

/// Adds the mean over a window of which both parts' sums are given. In vectors that are written out: of a loop over
/// groups the compiler would make vectors across them.
#[inline(always)]
fn add_mean<S: Simd>(simd: S, mean: &mut Planes, share: f32, prior: f32, before: &Sums, after: &Sums) {
    let (share, prior_cost, prior) =
        (simd.splat_f32s(share), simd.splat_f32s(prior * PRIOR_COST), simd.splat_f32s(prior));
    let (costs, more_costs) = (S::as_simd_f32s(&before[0]).0, S::as_simd_f32s(&after[0]).0);
    let (weights, more_weights) = (S::as_simd_f32s(&before[1]).0, S::as_simd_f32s(&after[1]).0);
    for (index, mean) in S::as_mut_simd_f32s(mean).0.iter_mut().enumerate() {
        let cost = simd.add_f32s(simd.add_f32s(costs[index], more_costs[index]), prior_cost);
        let weight = simd.add_f32s(simd.add_f32s(weights[index], more_weights[index]), prior);
        *mean = simd.add_f32s(*mean, simd.mul_f32s(share, simd.div_f32s(cost, weight)));
    }
}
