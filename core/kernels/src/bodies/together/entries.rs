//! Lists of tiles: an invocation of a workgroup is a tile of a bin, and splats come through the workgroup's memory.

use crate::gaussians::lists::{
    ListBlock, MASK_SPLATS, RUNS_TOGETHER, TILE_RUN, TILES_OF_BIN, is_reached, lowest_bit, next_status, saturating,
};
use crate::rows::{SHARED_BYTES, WORKGROUP};
use crate::store::Store;
use crate::workgroup::Workgroup;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;

/// Where the indices of splats begin, behind how many each invocation has found in its mask.
const LISTED: usize = WORKGROUP as usize;
/// Where the splats begin that are looked at, `[number][splat]`.
const STAGED: usize = LISTED + (WORKGROUP * MASK_SPLATS) as usize;
/// Numbers of such a splat: mean, opacity, inverse of the covariance, depth, the pixels of its box.
const STAGED_NUMBERS: usize = 11;

/// Words of the workgroup's memory that [`count_entries`] and [`list_entries`] take.
pub const ENTRIES_SHARED: usize = STAGED + STAGED_NUMBERS * WORKGROUP as usize;
/// Words of the workgroup's memory that [`sum_entries`] takes.
pub const SUM_ENTRIES_SHARED: usize = WORKGROUP as usize;
/// Words of the workgroup's memory that [`start_tiles`] takes.
pub const START_TILES_SHARED: usize = 2 * WORKGROUP as usize;

const _: () = assert!(WORKGROUP == TILES_OF_BIN && WORKGROUP == TILE_RUN * RUNS_TOGETHER);
const _: () = assert!(4 * ENTRIES_SHARED <= SHARED_BYTES);

/// A tile of a piece's bin, invocation `invocation % 64` of the piece `invocation / 64`.
#[inline(always)]
pub fn count_entries(
    block: &ListBlock,
    splats: &impl Fetch<ProjectedGaussian>,
    masks: &impl Fetch<u32>,
    counts: &mut impl Store<u32>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let count = fold_entries(block, splats, masks, &mut group, invocation, 0, |count, _, _| count + 1);
    counts.store(invocation as usize, count);
}

/// A tile of a piece's bin, as in [`count_entries`].
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn list_entries(
    block: &ListBlock,
    splats: &impl Fetch<ProjectedGaussian>,
    masks: &impl Fetch<u32>,
    starts: &impl Fetch<u32>,
    before: &impl Fetch<u32>,
    keys: &mut impl Store<[u32; 2]>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (piece, tile) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let place = block.tile_of_bin(block.bin_of_piece(piece), tile);
    let (mut first, mut end) = (0, 0);
    if block.has_tile(place) {
        let list = (place[1] * block.tile_columns() + place[0]) as usize;
        let part = piece % block.part_count();
        end = starts.fetch(list + 1);
        first = starts.fetch(list) + before.fetch(block.before_at(block.run_of(place), part, tile % TILE_RUN) as usize);
    }
    fold_entries(block, splats, masks, &mut group, invocation, first, |place, depth, index| {
        if place < end {
            keys.store(place as usize, [depth.to_bits(), index]);
        }
        place + 1
    });
}

/// As [`ListBlock::fold_entries`] for all tiles of a bin: invocations look for splats in a mask each, fetch one each,
/// and look at all that were found.
#[inline(always)]
fn fold_entries(
    block: &ListBlock,
    splats: &impl Fetch<ProjectedGaussian>,
    masks: &impl Fetch<u32>,
    group: &mut impl Workgroup,
    invocation: u32,
    mut state: u32,
    mut next: impl FnMut(u32, f32, u32) -> u32,
) -> u32 {
    let (piece, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let bin = block.bin_of_piece(piece);
    let [column, row] = block.tile_of_bin(bin, thread);
    let [mut mask, end] = block.masks_of_piece(piece);
    // All invocations of a workgroup see the same numbers of masks and splats, so all come to the barriers.
    while mask < end {
        let word = mask + thread;
        let mut rest = if word < end { masks.fetch((word * block.bin_count() + bin) as usize) } else { 0 };
        group.put_word(thread as usize, rest.count_ones());
        group.wait();
        let (mut place, mut found, mut other) = (0, 0, 0);
        while other < WORKGROUP {
            place = if other == thread { found } else { place };
            found += group.word(other as usize);
            other += 1;
        }
        while rest != 0 {
            group.put_word(LISTED + place as usize, word * MASK_SPLATS + lowest_bit(rest));
            rest &= rest.wrapping_sub(1);
            place += 1;
        }
        group.wait();
        let mut first = 0;
        while first < found {
            let count = if found - first < WORKGROUP { found - first } else { WORKGROUP };
            if thread < count {
                let index = group.word(LISTED + (first + thread) as usize);
                put_splat(group, thread, block, &splats.fetch(index as usize));
            }
            group.wait();
            let mut at = 0;
            while at < count {
                let (splat, pixels) = staged(group, at);
                if is_reached(&splat, pixels, column, row) {
                    state = next(state, splat.depth, group.word(LISTED + (first + at) as usize));
                }
                at += 1;
            }
            group.wait();
            first += count;
        }
        mask += WORKGROUP;
    }
    state
}

/// Puts what tiles need of a splat.
#[inline(always)]
fn put_splat(group: &mut impl Workgroup, place: u32, block: &ListBlock, splat: &ProjectedGaussian) {
    let [left, right, top, bottom] = splat.pixels(block.width, block.height);
    let ([x, y], [xx, xy, yy]) = (splat.mean, splat.conic);
    let words: [u32; STAGED_NUMBERS] = [
        x.to_bits(),
        y.to_bits(),
        splat.opacity.to_bits(),
        xx.to_bits(),
        xy.to_bits(),
        yy.to_bits(),
        splat.depth.to_bits(),
        left,
        right,
        top,
        bottom,
    ];
    let mut number = 0;
    while number < STAGED_NUMBERS {
        group.put_word(STAGED + number * WORKGROUP as usize + place as usize, words[number]);
        number += 1;
    }
}

/// The splat at a place, and the pixels of its box; what tiles do not need of it is 0.
#[inline(always)]
fn staged(group: &impl Workgroup, place: u32) -> (ProjectedGaussian, [u32; 4]) {
    let word = |number: usize| group.word(STAGED + number * WORKGROUP as usize + place as usize);
    let number = |at: usize| f32::from_bits(word(at));
    let splat = ProjectedGaussian {
        mean: [number(0), number(1)],
        depth: number(6),
        opacity: number(2),
        conic: [number(3), number(4), number(5)],
        padding: 0.0,
        colour: [0.0; 3],
        padding_colour: 0.0,
        extent: [0.0; 2],
        padding_end: [0.0; 2],
    };
    (splat, [word(7), word(8), word(9), word(10)])
}

/// An eighth of the parts of a tile of a run, invocation `invocation % 64` of the run `invocation / 64`.
#[inline(always)]
pub fn sum_entries(
    block: &ListBlock,
    counts: &impl Fetch<u32>,
    before: &mut impl Store<u32>,
    sums: &mut impl Store<u32>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (run, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let (tile, eighth) = (thread % TILE_RUN, thread / TILE_RUN);
    let part_count = block.part_count();
    let of_eighth = part_count.div_ceil(WORKGROUP / TILE_RUN);
    let limited = |part: u32| if part < part_count { part } else { part_count };
    let (first, end) = (limited(eighth * of_eighth), limited((eighth + 1) * of_eighth));
    let (mut part, mut sum) = (first, 0);
    while part < end {
        sum += counts.fetch(block.count_at(run, part, tile) as usize);
        part += 1;
    }
    group.put_word(thread as usize, sum);
    group.wait();
    (part, sum) = (0, 0);
    while part < eighth {
        sum += group.word((part * TILE_RUN + tile) as usize);
        part += 1;
    }
    part = first;
    while part < end {
        before.store(block.before_at(run, part, tile) as usize, sum);
        sum += counts.fetch(block.count_at(run, part, tile) as usize);
        part += 1;
    }
    if thread < TILE_RUN {
        let (mut other, mut all) = (0, 0);
        while other < WORKGROUP {
            all += if other % TILE_RUN <= tile { group.word(other as usize) } else { 0 };
            other += 1;
        }
        sums.store((run * TILE_RUN + tile) as usize, all);
    }
}

/// A tile of eight runs, invocation `invocation % 64` of the element `invocation / 64`.
#[inline(always)]
pub fn start_tiles(
    block: &ListBlock,
    sums: &impl Fetch<u32>,
    status: &impl Fetch<u32>,
    starts: &mut impl Store<u32>,
    next_statuses: &mut impl Store<u32>,
    mut group: impl Workgroup,
    invocation: u32,
) {
    let (element, thread) = (invocation / WORKGROUP, invocation % WORKGROUP);
    let (first, run_count) = (element * RUNS_TOGETHER, block.run_count());
    let (mut before, mut all, mut run) = (0, 0, thread);
    while run < run_count {
        let sum = sums.fetch((run * TILE_RUN + TILE_RUN - 1) as usize);
        before = if run < first { saturating(before, sum) } else { before };
        all = saturating(all, sum);
        run += WORKGROUP;
    }
    group.put_word(thread as usize, before);
    group.put_word((WORKGROUP + thread) as usize, all);
    group.wait();
    let mut other = 0;
    (before, all) = (0, 0);
    while other < WORKGROUP {
        before = saturating(before, group.word(other as usize));
        all = saturating(all, group.word((WORKGROUP + other) as usize));
        other += 1;
    }
    let is_over = all > block.capacity || status.fetch(0) != 0;
    let (run, tile) = (first + thread / TILE_RUN, thread % TILE_RUN);
    if run < run_count && tile < block.tiles_of_run(run) {
        let start = ListBlock::start_of(sums, before, first, run, tile);
        starts.store((block.first_of_run(run) + tile) as usize, if is_over { 0 } else { start });
    }
    if thread == 0 && first + RUNS_TOGETHER >= run_count {
        starts.store(block.tile_count() as usize, if is_over { 0 } else { all });
        let numbers = next_status([status.fetch(0), status.fetch(1), status.fetch(2)], all, is_over);
        next_statuses.store(0, numbers[0]);
        next_statuses.store(1, numbers[1]);
        next_statuses.store(2, numbers[2]);
    }
}
