//! Which splats each tile of a picture shows, the nearest first, without the host: the lists that
//! [`blend`](super::blend) takes.
//!
//! ```text
//! masks     which splats' boxes reach a bin of 8 by 8 tiles, a bit each      ListBlock::mask
//! counts    how many of them a tile shows, in parts of the splats            ListBlock::fold_entries
//! before    sums of a tile's counts before a part, and of a run of tiles     ListBlock::count_at
//! starts    sums of the counts before a tile                                 ListBlock::start_of
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
/// Tiles of a bin.
pub const TILES_OF_BIN: u32 = BIN_TILES * BIN_TILES;
/// A piece of a picture is a part of the splats in a bin. There are at most this many, and one a bin: enough to fill a
/// GPU with workgroups.
const PIECES: u32 = 4096;
/// Tiles of a run, whose counts are summed together: those of a bin in a row of tiles.
pub const TILE_RUN: u32 = BIN_TILES;
/// Runs whose lists' starts are found together.
pub const RUNS_TOGETHER: u32 = TILES_OF_BIN / TILE_RUN;
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

/// A sum; the greatest number where it is beyond that. Its order does not matter.
#[inline(always)]
pub fn saturating(a: u32, b: u32) -> u32 {
    if b > u32::MAX - a { u32::MAX } else { a + b }
}

/// The number of the lowest bit that is set, of one with such a bit: so many are below it.
#[inline(always)]
pub fn lowest_bit(bits: u32) -> u32 {
    (bits & bits.wrapping_neg()).wrapping_sub(1).count_ones()
}

/// The numbers of the status after a picture with so many entries, `all`.
#[inline(always)]
pub fn next_status(status: [u32; STATUS_NUMBERS as usize], all: u32, is_over: bool) -> [u32; STATUS_NUMBERS as usize] {
    let [_, done, most] = status;
    [u32::from(is_over), done + u32::from(!is_over), if most > all { most } else { all }]
}

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

    /// Columns of bins.
    #[inline(always)]
    pub fn bin_columns(&self) -> u32 {
        self.width.div_ceil(BIN)
    }

    /// Masks of a part of the splats.
    #[inline(always)]
    fn masks_of_part(&self) -> u32 {
        let all = self.bin_count() * self.mask_count();
        if all > PIECES { all.div_ceil(PIECES) } else { 1 }
    }

    /// Parts of the splats.
    #[inline(always)]
    pub fn part_count(&self) -> u32 {
        self.mask_count().div_ceil(self.masks_of_part())
    }

    /// Pieces of the picture: the parts of the splats in the first bin, then those in the next.
    #[inline(always)]
    pub fn piece_count(&self) -> u32 {
        self.bin_count() * self.part_count()
    }

    /// Most counts of all tiles' parts, whatever the number of splats.
    pub fn most_counts(&self) -> u32 {
        (PIECES + self.bin_count()) * TILES_OF_BIN
    }

    /// The bin of a piece.
    #[inline(always)]
    pub fn bin_of_piece(&self, piece: u32) -> u32 {
        piece / self.part_count()
    }

    /// The first mask of a piece, and the one behind its last.
    #[inline(always)]
    pub fn masks_of_piece(&self, piece: u32) -> [u32; 2] {
        let first = piece % self.part_count() * self.masks_of_part();
        [first, lesser(first + self.masks_of_part(), self.mask_count())]
    }

    /// Column and row of a tile of a bin, by its number in it; they may be beyond the picture.
    #[inline(always)]
    pub fn tile_of_bin(&self, bin: u32, tile: u32) -> [u32; 2] {
        let (column, row) = (bin % self.bin_columns(), bin / self.bin_columns());
        [column * BIN_TILES + tile % BIN_TILES, row * BIN_TILES + tile / BIN_TILES]
    }

    /// Whether the picture has a tile at a column and row.
    #[inline(always)]
    pub fn has_tile(&self, [column, row]: [u32; 2]) -> bool {
        column < self.tile_columns() && row < self.height.div_ceil(SPLAT_TILE as u32)
    }

    /// Runs of tiles, row by row.
    #[inline(always)]
    pub fn run_count(&self) -> u32 {
        self.height.div_ceil(SPLAT_TILE as u32) * self.bin_columns()
    }

    /// The place of the count of a part of a tile of a run, by its number in it.
    #[inline(always)]
    pub fn count_at(&self, run: u32, part: u32, tile: u32) -> u32 {
        let (row, bin_column) = (run / self.bin_columns(), run % self.bin_columns());
        let bin = row / BIN_TILES * self.bin_columns() + bin_column;
        (bin * self.part_count() + part) * TILES_OF_BIN + row % BIN_TILES * BIN_TILES + tile
    }

    /// The place of the sum of the counts before a part, of a tile of a run.
    #[inline(always)]
    pub fn before_at(&self, run: u32, part: u32, tile: u32) -> u32 {
        (run * self.part_count() + part) * TILE_RUN + tile
    }

    /// The run of a tile at a column and row.
    #[inline(always)]
    pub fn run_of(&self, [column, row]: [u32; 2]) -> u32 {
        row * self.bin_columns() + column / BIN_TILES
    }

    /// The first tile of a run.
    #[inline(always)]
    pub fn first_of_run(&self, run: u32) -> u32 {
        run / self.bin_columns() * self.tile_columns() + run % self.bin_columns() * BIN_TILES
    }

    /// Tiles of a run: fewer at the right edge.
    #[inline(always)]
    pub fn tiles_of_run(&self, run: u32) -> u32 {
        lesser(TILE_RUN, self.tile_columns() - run % self.bin_columns() * BIN_TILES)
    }

    /// Elements of `start_tiles`.
    #[inline(always)]
    pub fn start_count(&self) -> u32 {
        self.run_count().div_ceil(RUNS_TOGETHER)
    }

    /// The first place of `starts` that element `element` of `start_tiles` writes.
    #[inline(always)]
    pub fn place_of_start(&self, element: u32) -> u32 {
        if element < self.start_count() { self.first_of_run(element * RUNS_TOGETHER) } else { self.tile_count() + 1 }
    }

    /// The first place of the status that it writes: the last element does.
    #[inline(always)]
    pub fn place_of_status(&self, element: u32) -> u32 {
        if element < self.start_count() { 0 } else { STATUS_NUMBERS }
    }

    /// Which of 32 splats have pixels of their box in a bin: `element` is `mask * bin_count + bin`, and bit `i` is
    /// splat `32 * mask + i`. Neighbouring elements look at the same splats.
    #[inline(always)]
    pub fn mask(&self, splats: &(impl Fetch<ProjectedGaussian> + ?Sized), element: u32) -> u32 {
        let (bin, first) = (element % self.bin_count(), element / self.bin_count() * MASK_SPLATS);
        let (column, row) = (bin % self.bin_columns() * BIN, bin / self.bin_columns() * BIN);
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

    /// Goes through the splats of a piece that may be seen in a tile of its bin, in the order of their indices: what
    /// begins as `state` becomes `next(state, depth, index)` with each. `masks` are those of all bins.
    #[inline(always)]
    pub fn fold_entries(
        &self,
        splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
        masks: &[u32],
        piece: u32,
        tile: u32,
        mut state: u32,
        mut next: impl FnMut(u32, f32, u32) -> u32,
    ) -> u32 {
        let bin = self.bin_of_piece(piece);
        let [column, row] = self.tile_of_bin(bin, tile);
        let [mut mask, end] = self.masks_of_piece(piece);
        while mask < end && self.has_tile([column, row]) {
            let mut rest = masks[(mask * self.bin_count() + bin) as usize];
            while rest != 0 {
                let index = mask * MASK_SPLATS + lowest_bit(rest);
                rest &= rest.wrapping_sub(1);
                let splat = splats.fetch(index as usize);
                let pixels = splat.pixels(self.width, self.height);
                if is_reached(&splat, pixels, column, row) {
                    state = next(state, splat.depth, index);
                }
            }
            mask += 1;
        }
        state
    }

    /// Where the list of a tile of a run begins, by its number in the run: behind `before` entries of the runs before
    /// the run `first`, and those from there on. `sums[run][tile]` are the entries up to a tile and with it.
    #[inline(always)]
    pub fn start_of(sums: &(impl Fetch<u32> + ?Sized), before: u32, first: u32, run: u32, tile: u32) -> u32 {
        let (mut start, mut earlier) = (before, first);
        while earlier < run {
            start = saturating(start, sums.fetch((earlier * TILE_RUN + TILE_RUN - 1) as usize));
            earlier += 1;
        }
        if tile > 0 { saturating(start, sums.fetch((run * TILE_RUN + tile - 1) as usize)) } else { start }
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
    let is_before = |[other_depth, other_index]: [u32; 2]| {
        u32::from(other_depth < depth || (other_depth == depth && other_index < index))
    };
    let (mut rank, mut at) = (0, start);
    // Four at a time, so that none is waited for alone.
    while end - at >= 4 {
        let [a, b] = [keys.fetch(at as usize), keys.fetch(at as usize + 1)];
        let [c, d] = [keys.fetch(at as usize + 2), keys.fetch(at as usize + 3)];
        rank += is_before(a) + is_before(b) + is_before(c) + is_before(d);
        at += 4;
    }
    while at < end {
        rank += is_before(keys.fetch(at as usize));
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
