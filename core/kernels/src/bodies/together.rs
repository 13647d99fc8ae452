//! Kernels whose elements a workgroup computes together: for each the function of its name, which an invocation runs. Its results are
//! those of the body of that name, which is the definition. It must not panic: others wait for it. Arrays hold at least one element and may be read beyond
//! their end.

use crate::gaussians::blend_gradient::{GradientLanes, GradientSums, NUMBERS, SplatGradient};
use crate::gaussians::lanes::sum;
use crate::gaussians::{MIN_TRANSMITTANCE, SPLAT_TILE, TileBlock};
use crate::rows::WORKGROUP;
use crate::store::Store;
use crate::workgroup::Workgroup;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;

/// Splats between two barriers.
const BATCH: u32 = 6;
/// Their numbers, and what is seen behind them.
const SUMMED: u32 = BATCH * NUMBERS as u32;
/// From a number of all pixels to the next: odd, so that invocations that sum neighbouring ones read different banks.
const STRIDE: usize = WORKGROUP as usize + 1;
/// Where the sums begin.
const SUMS: usize = (SUMMED as usize + 1) * STRIDE;

/// Numbers of the workgroup's memory that [`blend_gradient`] takes.
pub const BLEND_GRADIENT_SHARED: usize = SUMS + SUMMED as usize + 1;

const _: () = assert!(WORKGROUP as usize == SPLAT_TILE * SPLAT_TILE && SUMMED < WORKGROUP);

/// A pixel of a tile, invocation `invocation % 64` of the tile `invocation / 64`. The pixels' numbers of some splats go to the
/// workgroup's memory, where each sum over the pixels is one invocation's.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn blend_gradient(
    block: &TileBlock,
    starts: &impl Fetch<u32>,
    entries: &impl Fetch<u32>,
    splats: &impl Fetch<ProjectedGaussian>,
    colours: &impl Fetch<[f32; 4]>,
    gradients: &impl Fetch<[f32; 4]>,
    sums: &mut impl Store<SplatGradient>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (tile, own) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let mut pixel = GradientLanes::<1>::OUTSIDE;
    let [column, row] = block.first_of(tile);
    let (column, row) = (column + own % SPLAT_TILE as u32, row + own / SPLAT_TILE as u32);
    if column < block.width && row < block.height {
        let at = (row * block.width + column) as usize;
        pixel.set(0, colours.fetch(at), gradients.fetch(at));
    }
    let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
    let (mut entry, end) = (starts.fetch(tile as usize), starts.fetch(tile as usize + 1));
    let mut is_over = false;
    // All invocations of the tile see the same here, so all come to the barriers.
    while entry < end && !is_over {
        let mut place = 0;
        while place < BATCH {
            let mut said = GradientSums::<1>::ZERO;
            if entry + place < end {
                let splat = splats.fetch(entries.fetch((entry + place) as usize) as usize);
                pixel.add(x, y, &splat, &mut said);
            }
            let mut number = 0;
            while number < NUMBERS {
                group.put((place as usize * NUMBERS + number) * STRIDE + own as usize, said.0[number][0]);
                number += 1;
            }
            place += 1;
        }
        group.put(SUMMED as usize * STRIDE + own as usize, pixel.most_seen());
        group.wait();
        if own < SUMMED {
            let total = sum_of_tile(&group, own as usize * STRIDE);
            group.put(SUMS + own as usize, total);
        } else if own == SUMMED {
            let most = most_of_tile(&group, own as usize * STRIDE);
            group.put(SUMS + own as usize, most);
        }
        group.wait();
        if own < BATCH && entry + own < end {
            let first = SUMS + own as usize * NUMBERS;
            let mut numbers = [0.0; NUMBERS];
            let mut number = 0;
            while number < NUMBERS {
                numbers[number] = group.get(first + number);
                number += 1;
            }
            sums.store((entry + own) as usize, SplatGradient::of(numbers));
        }
        is_over = group.get(SUMS + SUMMED as usize) < MIN_TRANSMITTANCE;
        entry += BATCH;
    }
    let mut behind = entry + own;
    while behind < end {
        sums.store(behind as usize, SplatGradient::ZERO);
        behind += WORKGROUP;
    }
}

/// A sum over a tile's pixels: over the rows in each column, then over the columns.
#[inline(always)]
fn sum_of_tile(group: &impl Workgroup, first: usize) -> f32 {
    let mut columns = [0.0; SPLAT_TILE];
    let mut row = 0;
    while row < SPLAT_TILE {
        let mut column = 0;
        while column < SPLAT_TILE {
            columns[column] += group.get(first + row * SPLAT_TILE + column);
            column += 1;
        }
        row += 1;
    }
    sum(&columns)
}

/// The most of a tile's pixels.
#[inline(always)]
fn most_of_tile(group: &impl Workgroup, first: usize) -> f32 {
    let mut most = 0.0;
    let mut pixel = 0;
    while pixel < WORKGROUP as usize {
        let own = group.get(first + pixel);
        most = if own > most { own } else { most };
        pixel += 1;
    }
    most
}
