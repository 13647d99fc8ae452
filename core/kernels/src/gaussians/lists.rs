//! Which splats each tile of a picture shows, the nearest first, without the host: the lists that
//! [`blend`](super::blend) takes.
//!
//! ```text
//! masks     which splats' boxes reach a bin of 8 by 8 tiles, a bit each      ListBlock::mask
//! counts    how many of them a tile shows, in 32 parts of the splats         ListBlock::fold_entries
//! starts    sums of the counts before a tile                                 ListBlock::before
//! keys      a tile's splats with their depths, by index                      ListBlock::fold_entries
//! entries   the same by depth, and of one depth by index                     rank
//! ```
//!
//! There are no atomics: every element knows where it writes, so that the lists are the same in every run. The host
//! does not know how many entries there are when it dispatches, so they have a capacity. If a picture needs more, all
//! its lists are empty, and a status says so and how many there would have been ([`ListStatus`]).
//!
//! Mesa's llvmpipe ends the loops of an invocation after 65,535 rounds. The longest loop here is that over the splats
//! of a tile's list: a list with more would be in the wrong order there, and no such device makes lists in production.

use super::{SPLAT_TILE, TileBlock};
use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;

/// Tiles of a bin's side.
pub const BIN_TILES: u32 = 8;
/// Pixels of a bin's side.
const BIN: u32 = BIN_TILES * SPLAT_TILE as u32;
/// Splats of a mask.
pub const MASK_SPLATS: u32 = 32;
/// Parts of the splats: those of a tile are counted and listed by so many invocations.
pub const LIST_PARTS: u32 = 32;
/// Tiles whose counts are summed together.
pub const TILE_RUN: u32 = 8;
/// Numbers of a [`ListStatus`].
pub const STATUS_NUMBERS: u32 = 3;

/// What became of the lists so far, as an array of [`STATUS_NUMBERS`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ListStatus {
    /// Whether there were more entries than the capacity: from then on all lists are empty.
    pub is_over: bool,
    /// Pictures with all their entries.
    pub done: u32,
    /// The most entries of a picture.
    pub most: u32,
}

impl ListStatus {
    /// From the array.
    pub fn of([is_over, done, most]: [u32; STATUS_NUMBERS as usize]) -> ListStatus {
        ListStatus { is_over: is_over != 0, done, most }
    }
}

/// A picture and its splats, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct ListBlock {
    /// Columns of pixels, at least 1.
    pub width: u32,
    /// Rows of pixels, at least 1.
    pub height: u32,
    /// Number of splats.
    pub splat_count: u32,
    /// The most entries of all lists together.
    pub capacity: u32,
}

const _: () = assert!(size_of::<ListBlock>() == 16);

#[inline(always)]
fn lesser(a: u32, b: u32) -> u32 {
    if a < b { a } else { b }
}

impl ListBlock {
    /// Columns of tiles.
    #[inline(always)]
    pub fn tile_columns(&self) -> u32 {
        self.width.div_ceil(SPLAT_TILE as u32)
    }

    /// Tiles of the picture, row by row.
    #[inline(always)]
    pub fn tile_count(&self) -> u32 {
        self.tile_columns() * self.height.div_ceil(SPLAT_TILE as u32)
    }

    /// Bins of the picture, row by row.
    #[inline(always)]
    pub fn bin_count(&self) -> u32 {
        self.width.div_ceil(BIN) * self.height.div_ceil(BIN)
    }

    /// Masks of a bin.
    #[inline(always)]
    pub fn mask_count(&self) -> u32 {
        self.splat_count.div_ceil(MASK_SPLATS)
    }

    /// Masks of a part.
    #[inline(always)]
    fn masks_of_part(&self) -> u32 {
        self.mask_count().div_ceil(LIST_PARTS)
    }

    /// Runs of tiles.
    #[inline(always)]
    pub fn run_count(&self) -> u32 {
        self.tile_count().div_ceil(TILE_RUN)
    }

    /// The place of `starts` that element `element` of `start_tiles` writes: behind the last one are those of the
    /// status.
    #[inline(always)]
    pub fn place_of_start(&self, element: u32) -> u32 {
        lesser(element, self.tile_count() + 1)
    }

    /// The place of the status that element `element` of `start_tiles` writes.
    #[inline(always)]
    pub fn place_of_status(&self, element: u32) -> u32 {
        element - lesser(element, self.tile_count() + 1)
    }

    /// Which of 32 splats have pixels of their box in a bin: `element` is `bin * mask_count + mask`, and bit `i` is
    /// splat `32 * mask + i`.
    #[inline(always)]
    pub fn mask(&self, splats: &(impl Fetch<ProjectedGaussian> + ?Sized), element: u32) -> u32 {
        let (bin, first) = (element / self.mask_count(), element % self.mask_count() * MASK_SPLATS);
        let bin_columns = self.width.div_ceil(BIN);
        let (column, row) = (bin % bin_columns * BIN, bin / bin_columns * BIN);
        let (mut mask, mut bit) = (0, 0);
        while bit < MASK_SPLATS {
            if first + bit < self.splat_count {
                let splat = splats.fetch((first + bit) as usize);
                let [left, right, top, bottom] = splat.pixels(self.width, self.height);
                let across = left < right && left < column + BIN && right > column;
                let down = top < bottom && top < row + BIN && bottom > row;
                mask |= u32::from(across && down) << bit;
            }
            bit += 1;
        }
        mask
    }

    /// Goes through the splats of a part that may be seen in a tile, in the order of their indices: what begins as
    /// `state` becomes `next(state, depth, index)` with each. `element` is `tile * LIST_PARTS + part`, `masks` those of
    /// all bins.
    #[inline(always)]
    pub fn fold_entries(
        &self,
        splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
        masks: &[u32],
        element: u32,
        mut state: u32,
        mut next: impl FnMut(u32, f32, u32) -> u32,
    ) -> u32 {
        let (tile, part) = (element / LIST_PARTS, element % LIST_PARTS);
        let (tile_column, tile_row) = (tile % self.tile_columns(), tile / self.tile_columns());
        let bin = tile_row / BIN_TILES * self.width.div_ceil(BIN) + tile_column / BIN_TILES;
        let (count, of_bin) = (self.mask_count(), bin * self.mask_count());
        let mut mask = lesser(part * self.masks_of_part(), count);
        let end = lesser(mask + self.masks_of_part(), count);
        while mask < end {
            let mut rest = masks[(of_bin + mask) as usize];
            while rest != 0 {
                // The lowest bit that is set has as many below it as its number.
                let below = (rest & rest.wrapping_neg()).wrapping_sub(1);
                let index = mask * MASK_SPLATS + below.count_ones();
                rest &= rest.wrapping_sub(1);
                let splat = splats.fetch(index as usize);
                let pixels = splat.pixels(self.width, self.height);
                if is_reached(&splat, pixels, tile_column, tile_row) {
                    state = next(state, splat.depth, index);
                }
            }
            mask += 1;
        }
        state
    }

    /// All entries of the runs of tiles before that of `tile`, and of all runs: `sums[run]`. A number that is too great
    /// is the greatest.
    #[inline(always)]
    pub fn of_runs(&self, sums: &[u32], tile: u32) -> [u32; 2] {
        let (mut before, mut all, mut run) = (0, 0, 0);
        while run < self.run_count() {
            let sum = sums[run as usize];
            all = if sum > u32::MAX - all { u32::MAX } else { all + sum };
            before = if run < tile / TILE_RUN { all } else { before };
            run += 1;
        }
        [before, all]
    }

    /// Entries of a tile's earlier parts, and of those of the tiles before it in its run: `counts[tile][part]` before
    /// `element`, from `first` on.
    #[inline(always)]
    pub fn sum(counts: &[u32], first: u32, element: u32) -> u32 {
        let (mut sum, mut at) = (0, first);
        while at < element {
            sum += counts[at as usize];
            at += 1;
        }
        sum
    }

    /// Where the keys of a part begin, `element` as in [`ListBlock::fold_entries`]: in the place of the number behind
    /// the last part it is the number of keys. If the capacity is exceeded, all begin at 0, and there are none.
    #[inline(always)]
    pub fn first_of_part(starts: &[u32], counts: &[u32], element: u32) -> u32 {
        let (tile, part) = (element / LIST_PARTS, element % LIST_PARTS);
        let start = starts[tile as usize];
        if part == 0 || starts[tile as usize + 1] == start {
            return start;
        }
        start + ListBlock::sum(counts, tile * LIST_PARTS, element)
    }

    /// The tile in whose list an entry is, which is in one.
    #[inline(always)]
    pub fn tile_of_entry(&self, starts: &[u32], entry: u32) -> u32 {
        // The last tile whose list begins at the entry or before it.
        let (mut low, mut high) = (0, self.tile_count());
        while high - low > 1 {
            let middle = (low + high) / 2;
            if starts[middle as usize] <= entry {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

impl ListBlock {
    /// The picture's tiles, over a background.
    pub fn tiles(&self, background: [f32; 3]) -> TileBlock {
        TileBlock::new(self.width, self.height, background)
    }
}

/// Whether a splat may be seen in a tile, from the pixels of its box
/// ([`ProjectedGaussian::pixels`]): the test by which all lists are made.
#[inline(always)]
pub fn is_reached(
    splat: &ProjectedGaussian,
    [left, right, top, bottom]: [u32; 4],
    tile_column: u32,
    tile_row: u32,
) -> bool {
    let side = SPLAT_TILE as u32;
    let (column, row) = (tile_column * side, tile_row * side);
    let is_beside = left >= right || top >= bottom || left >= column + side || right <= column;
    if is_beside || top >= row + side || bottom <= row {
        return false;
    }
    let columns = [if left > column { left } else { column }, lesser(right - 1, column + side - 1)];
    let rows = [if top > row { top } else { row }, lesser(bottom - 1, row + side - 1)];
    splat.reaches(columns, rows)
}

/// Where an entry is in its tile's sorted list, from the tile's keys `keys[start..end]`, each a depth's bits and the
/// index of a splat: how many are nearer, and of those of its depth how many have a lower index. Depths are positive,
/// so that their bits are in their order.
#[inline(always)]
pub fn rank(keys: &(impl Fetch<[u32; 2]> + ?Sized), start: u32, end: u32, entry: u32) -> u32 {
    let [depth, index] = keys.fetch(entry as usize);
    let (mut rank, mut at) = (0, start);
    while at < end {
        let [other_depth, other_index] = keys.fetch(at as usize);
        rank += u32::from(other_depth < depth || (other_depth == depth && other_index < index));
        at += 1;
    }
    rank
}

/// The entry of a splat in a tile's sorted list, `entries[start..end]`; `end` if it is not there.
#[inline(always)]
pub fn entry_of(
    entries: &[u32],
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    start: u32,
    end: u32,
    index: u32,
    depth: f32,
) -> u32 {
    let (mut low, mut high) = (start, end);
    while low < high {
        let middle = (low + high) / 2;
        let other = entries[middle as usize];
        let other_depth = splats.fetch(other as usize).depth;
        if other_depth < depth || (other_depth == depth && other < index) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    if low < end && entries[low as usize] == index { low } else { end }
}
