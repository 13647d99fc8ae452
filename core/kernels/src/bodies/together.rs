//! Kernels whose elements a workgroup computes together: for each the function of its name, which an invocation runs.
//! Its results are those of the body of that name, which is the definition. It must not panic: others wait for it.
//! Arrays hold at least one element and may be read beyond their end.

mod blend;
mod entries;
mod norms;
mod paths;
mod shares;

pub use blend::*;
pub use entries::*;
pub use norms::*;
pub use paths::*;
pub use shares::*;

use crate::gaussians::blend_gradient::{GradientLanes, GradientSums, NUMBERS, SplatGradient};
use crate::gaussians::lanes::{SplatLanes, sum};
use crate::gaussians::{MIN_TRANSMITTANCE, SPLAT_TILE, TileBlock};
use crate::rows::{SHARED_BYTES, WORKGROUP};
use crate::store::Store;
use crate::workgroup::Workgroup;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;
use viewfuse_core::math::abs;

/// Splats of which the pixels' numbers are in the workgroup's memory at a time.
const BATCH: u32 = 5;
/// Their numbers.
const SUMMED: u32 = BATCH * NUMBERS as u32;
/// From a number of all pixels to the next: odd, so that invocations that sum neighbouring ones read different banks.
const STRIDE: usize = WORKGROUP as usize + 1;
/// Where the sums begin: behind the numbers of the pixels, the last of which is 1 where something behind is seen.
const SUMS: usize = (SUMMED as usize + 1) * STRIDE;
/// Splats that are fetched at a time, each by one invocation.
const FETCHED: u32 = WORKGROUP / BATCH * BATCH;
/// Numbers of a splat that its pixels need.
const SPLAT_NUMBERS: usize = 10;
/// Where the splats begin, `[number][splat]`.
const SPLATS: usize = SUMS + SUMMED as usize + 1;

/// Numbers of the workgroup's memory that [`blend_gradient`] takes.
pub const BLEND_GRADIENT_SHARED: usize = SPLATS + SPLAT_NUMBERS * FETCHED as usize;

const _: () = assert!(WORKGROUP as usize == SPLAT_TILE * SPLAT_TILE && SUMMED < WORKGROUP);
const _: () = assert!(4 * BLEND_GRADIENT_SHARED <= SHARED_BYTES);

/// A pixel of a tile, invocation `invocation % 64` of the tile `invocation / 64`. Splats go through the workgroup's
/// memory, so that none is waited for alone; so do the pixels' numbers of some splats, where each sum over the pixels
/// is one invocation's.
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
    let (tile, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let mut pixel = GradientLanes::<1>::OUTSIDE;
    let [column, row] = block.first_of(tile);
    let (column, row) = (column + thread % SPLAT_TILE as u32, row + thread / SPLAT_TILE as u32);
    if column < block.width && row < block.height {
        let at = (row * block.width + column) as usize;
        pixel.set(0, colours.fetch(at), gradients.fetch(at));
    }
    let centre = [column as f32 + 0.5, row as f32 + 0.5];
    let (mut entry, end) = (starts.fetch(tile as usize), starts.fetch(tile as usize + 1));
    let mut is_over = false;
    // All invocations of the tile see the same here, so all come to the barriers.
    while entry < end && !is_over {
        let fetched = if end - entry < FETCHED { end - entry } else { FETCHED };
        if thread < fetched {
            put_splat(&mut group, thread, &splats.fetch(entries.fetch((entry + thread) as usize) as usize));
        }
        group.wait();
        let mut first = 0;
        while first < fetched && !is_over {
            let count = if fetched - first < BATCH { fetched - first } else { BATCH };
            put_numbers(&mut group, thread, &mut pixel, centre, first, count);
            group.wait();
            // All by the same instructions: invocations of a subgroup that differ would wait for one another.
            if thread <= SUMMED {
                group.put(SUMS + thread as usize, sum_of_tile(&group, thread as usize * STRIDE));
            }
            group.wait();
            if thread < count {
                sums.store((entry + first + thread) as usize, sum_of_splat(&group, thread));
            }
            is_over = group.get(SUMS + SUMMED as usize) == 0.0;
            first += count;
        }
        entry += first;
    }
    let mut behind = entry + thread;
    while behind < end {
        sums.store(behind as usize, SplatGradient::ZERO);
        behind += WORKGROUP;
    }
}

/// Puts what pixels need of a splat.
#[inline(always)]
fn put_splat(group: &mut impl Workgroup, place: u32, splat: &ProjectedGaussian) {
    let ([x, y], [xx, xy, yy], [red, green, blue]) = (splat.mean, splat.conic, splat.colour);
    let numbers: [f32; SPLAT_NUMBERS] = [x, y, splat.extent[1], splat.opacity, xx, xy, yy, red, green, blue];
    let mut number = 0;
    while number < SPLAT_NUMBERS {
        group.put(SPLATS + number * FETCHED as usize + place as usize, numbers[number]);
        number += 1;
    }
}

/// The splat at a place; what pixels do not need of it is 0.
#[inline(always)]
fn splat_at(group: &impl Workgroup, place: u32) -> ProjectedGaussian {
    let get = |number: usize| group.get(SPLATS + number * FETCHED as usize + place as usize);
    ProjectedGaussian {
        mean: [get(0), get(1)],
        depth: 0.0,
        opacity: get(3),
        conic: [get(4), get(5), get(6)],
        padding: 0.0,
        colour: [get(7), get(8), get(9)],
        padding_colour: 0.0,
        extent: [0.0, get(2)],
        padding_end: [0.0; 2],
    }
}

/// Puts what a pixel says of `count` splats from `first` on, and whether something behind them is seen. How a pixel sees
/// a splat depends on no other one, so that a device computes that of all side by side; one after the other is only
/// what they hide of one another.
#[inline(always)]
fn put_numbers<W: Workgroup>(
    group: &mut W,
    thread: u32,
    pixel: &mut GradientLanes<1>,
    [x, y]: [f32; 2],
    first: u32,
    count: u32,
) {
    let seen = |group: &W, place: u32| {
        let splat = splat_at(group, first + if place < count { place } else { 0 });
        let mut seen = SplatLanes::<1>::of(&splat, x, y);
        if place >= count || abs(y - splat.mean[1]) > splat.extent[1] {
            (seen.alpha, seen.slope) = ([0.0], [0.0]);
        }
        (seen, splat.colour)
    };
    const { assert!(BATCH == 5) };
    let (a, b, c, d, e) = (seen(group, 0), seen(group, 1), seen(group, 2), seen(group, 3), seen(group, 4));
    let mut put = |place: usize, (seen, colour): (SplatLanes<1>, [f32; 3])| {
        let mut said = GradientSums::<1>::ZERO;
        pixel.add_seen(&seen, colour, &mut said);
        let mut number = 0;
        while number < NUMBERS {
            group.put((place * NUMBERS + number) * STRIDE + thread as usize, said.0[number][0]);
            number += 1;
        }
    };
    put(0, a);
    put(1, b);
    put(2, c);
    put(3, d);
    put(4, e);
    let sees_on = if pixel.most_seen() >= MIN_TRANSMITTANCE { 1.0 } else { 0.0 };
    group.put(SUMMED as usize * STRIDE + thread as usize, sees_on);
}

/// The sums of a splat of a batch.
#[inline(always)]
fn sum_of_splat(group: &impl Workgroup, place: u32) -> SplatGradient {
    let mut numbers = [0.0; NUMBERS];
    let mut number = 0;
    while number < NUMBERS {
        numbers[number] = group.get(SUMS + place as usize * NUMBERS + number);
        number += 1;
    }
    SplatGradient::of(numbers)
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
