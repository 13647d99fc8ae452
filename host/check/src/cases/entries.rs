//! [`Kernel::MarkBins`] to [`Kernel::SortEntries`]: the lists of a picture's tiles, of splats of several sizes on a
//! picture of three bins; capacities that suffice and that do not. Whole numbers, undecided where it depends on
//! rounding whether a splat's box or ellipse reaches a tile.

use super::gaussians::splat;
use super::*;
use crate::list_oracle::{is_reached, pixels};
use crate::world::Numbers;
use viewfuse_device::Memory;
use viewfuse_kernels::gaussians::SPLAT_TILE;
use viewfuse_kernels::gaussians::lists::{BIN_TILES, MASK_SPLATS, TILES_OF_BIN};

const EXACT: Limits = Limits { tolerance: 0.0, least: 0.5 };
const REASON: &str = "whole numbers: exact; undecided where it depends on rounding which pixels a splat's box has, or \
    whether the least value of the exponent's form in a tile is below what the opacity allows";

/// A picture's splats, with lists as the kernels before the one under test would make them.
struct Lists {
    block: ListBlock,
    splats: Vec<ProjectedGaussian>,
    masks: Vec<u32>,
    before: Vec<u32>,
    sums: Vec<u32>,
    starts: Vec<u32>,
}

impl Lists {
    fn new(seed: u64, size: u32) -> Lists {
        let numbers = &mut Numbers::new(seed);
        let [width, height] = [131 + size % 7, 20 + size / 40];
        let splat_count = 33 + size / 4;
        let splats: Vec<ProjectedGaussian> = (0..splat_count)
            .map(|_| {
                // Some of the same depth.
                let depth = 1.0 + 0.25 * numbers.between(0.0, 40.0).floor();
                let splat = splat(numbers, [width, height], depth);
                ProjectedGaussian { opacity: if depth == 3.0 { 0.0 } else { splat.opacity }, ..splat }
            })
            .collect();
        let mut block = ListBlock { width, height, splat_count, capacity: 0 };
        let masks: Vec<u32> =
            (0..block.bin_count() * block.mask_count()).map(|mask| block.mask(&splats[..], mask)).collect();
        let count = |slot: u32| {
            let (piece, tile) = (slot / TILES_OF_BIN, slot % TILES_OF_BIN);
            block.fold_entries(&splats[..], &masks, piece, tile, 0, |count, _, _| count + 1)
        };
        let counts: Vec<u32> = (0..block.piece_count() * TILES_OF_BIN).map(count).collect();
        let (before, sums) = summed(&block, &counts);
        let mut starts = vec![0];
        for run in sums.chunks(TILE_RUN as usize).zip(0..) {
            let (first, tiles) = (starts[starts.len() - 1], block.tiles_of_run(run.1) as usize);
            starts.extend(run.0[..tiles].iter().map(|sum| first + sum));
        }
        block.capacity = starts[starts.len() - 1] + 5;
        Lists { block, splats, masks, before, sums, starts }
    }
}

/// The outputs of `sum_entries`.
fn summed(block: &ListBlock, counts: &[u32]) -> (Vec<u32>, Vec<u32>) {
    let (mut before, mut sums) = (vec![0; (block.run_count() * block.part_count() * TILE_RUN) as usize], Vec::new());
    let bin_columns = block.width.div_ceil(BIN_TILES * SPLAT_TILE as u32);
    for run in 0..block.run_count() {
        let (row, bin_column) = (run / bin_columns, run % bin_columns);
        let bin = row / BIN_TILES * bin_columns + bin_column;
        let mut all = 0;
        for tile in 0..TILE_RUN {
            let mut of_tile = 0;
            for part in 0..block.part_count() {
                before[((run * block.part_count() + part) * TILE_RUN + tile) as usize] = of_tile;
                let of_piece = &counts[((bin * block.part_count() + part) * TILES_OF_BIN) as usize..];
                of_tile += of_piece[(row % BIN_TILES * BIN_TILES + tile) as usize];
            }
            all += of_tile;
            sums.push(all);
        }
    }
    (before, sums)
}

/// The splats of a part that a tile shows, by the masks; `None` where that depends on rounding.
fn shown(
    block: &ListBlock,
    splats: &[ProjectedGaussian],
    masks: &[u32],
    [column, row]: [u32; 2],
    part: u32,
) -> Option<Vec<u32>> {
    let bin_columns = block.width.div_ceil(BIN_TILES * SPLAT_TILE as u32);
    let bin = row / BIN_TILES * bin_columns + column / BIN_TILES;
    let of_part = block.mask_count().div_ceil(block.part_count()) * MASK_SPLATS;
    let listed = (part * of_part..((part + 1) * of_part).min(block.splat_count)).filter(|index| {
        let mask = masks[(index / MASK_SPLATS * block.bin_count() + bin) as usize];
        mask >> (index % MASK_SPLATS) & 1 != 0
    });
    let reached = |index: u32| is_reached(&splats[index as usize], [block.width, block.height], column, row);
    let shown = listed.map(|index| reached(index).map(|shows| shows.then_some(index)));
    Some(shown.collect::<Option<Vec<Option<u32>>>>()?.into_iter().flatten().collect())
}

/// Clears every second bit.
fn unmark(masks: &mut [u32]) {
    masks.iter_mut().for_each(|mask| *mask &= 0x5555_5555);
}

impl Case for MarkBins {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("splats", |case| increase(case.splats.iter_mut().flat_map(|splat| &mut splat.mean)))];

    /// Several pictures, for one has few masks.
    fn inputs(seed: u64, size: u32) -> Vec<MarkBins> {
        let picture = |picture: u64| {
            let Lists { block, splats, masks, .. } = Lists::new(seed.wrapping_mul(4) + picture, size);
            MarkBins { block, splats, masks: Output::Zeros(masks.len()) }
        };
        (0..4).map(picture).collect()
    }

    /// Of each mask its lower half, and its upper one.
    fn expected(&self) -> Vec<Option<Bounded>> {
        let MarkBins { block, splats, .. } = self;
        let side = BIN_TILES * SPLAT_TILE as u32;
        let columns = block.width.div_ceil(side);
        let half = |half: u32| {
            let (mask, first) = (half / 2, half % 2 * 16);
            let (bin, of_bin) = (mask % block.bin_count(), mask / block.bin_count());
            let (column, row) = (bin % columns * side, bin / columns * side);
            let reaches = |splat: &ProjectedGaussian| {
                let [left, right, top, bottom] = pixels(splat, block.width, block.height)?;
                let is_there = left < right && top < bottom;
                Some(is_there && left < column + side && right > column && top < row + side && bottom > row)
            };
            let bits = (0..16).filter_map(|bit| Some((bit, splats.get((of_bin * 32 + first + bit) as usize)?)));
            let sum = bits.map(|(bit, splat)| Some(u32::from(reaches(splat)?) << bit)).sum::<Option<u32>>();
            sum.map(Bounded::from)
        };
        (0..2 * block.bin_count() * block.mask_count()).map(half).collect()
    }

    fn read_one<D: Device>(device: &D, (_, masks): &Self::Loaded<D>, index: usize) -> Result<Vec<f32>, DeviceError> {
        let Some(masks) = &masks[index] else { return Ok(Vec::new()) };
        let halves = |mask: u32| [(mask & 0xffff) as f32, (mask >> 16) as f32];
        Ok(Memory::download(device, masks)?.into_iter().flat_map(halves).collect())
    }
}

impl Case for CountEntries {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("splats", |case| increase(case.splats.iter_mut().flat_map(|splat| &mut splat.mean))),
        ("masks", |case| unmark(&mut case.masks)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<CountEntries> {
        let Lists { block, splats, masks, .. } = Lists::new(seed, size);
        let counts = Output::Zeros((block.piece_count() * TILES_OF_BIN) as usize);
        vec![CountEntries { block, splats, masks, counts }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let CountEntries { block, splats, masks, .. } = self;
        let bin_columns = block.width.div_ceil(BIN_TILES * SPLAT_TILE as u32);
        let [columns, rows] = [block.width, block.height].map(|side| side.div_ceil(SPLAT_TILE as u32));
        let count = |slot: usize| {
            let (piece, tile) = (slot as u32 / TILES_OF_BIN, slot as u32 % TILES_OF_BIN);
            let (bin, part) = (piece / block.part_count(), piece % block.part_count());
            let column = bin % bin_columns * BIN_TILES + tile % BIN_TILES;
            let row = bin / bin_columns * BIN_TILES + tile / BIN_TILES;
            if column >= columns || row >= rows {
                return Some(Bounded::ZERO);
            }
            shown(block, splats, masks, [column, row], part).map(|list| Bounded::from(list.len() as u32))
        };
        map((block.piece_count() * TILES_OF_BIN) as usize, 16, count)
    }
}

impl Case for SumEntries {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("counts", |case| case.counts.iter_mut().for_each(|count| *count += 1))];

    /// Of a picture with many runs of tiles.
    fn inputs(seed: u64, size: u32) -> Vec<SumEntries> {
        let numbers = &mut Numbers::new(seed);
        let block = ListBlock { width: 331 + size % 7, height: 201, splat_count: 64 + size, capacity: 0 };
        let count = block.piece_count() * TILES_OF_BIN;
        let counts: Vec<u32> = (0..count).map(|_| numbers.between(0.0, 9.0) as u32).collect();
        let before = Output::Zeros((block.run_count() * block.part_count() * TILE_RUN) as usize);
        vec![SumEntries { block, counts, before, sums: Output::Zeros((block.run_count() * TILE_RUN) as usize) }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let (before, sums) = summed(&self.block, &self.counts);
        decided(before.into_iter().chain(sums).map(Bounded::from), 0)
    }
}

impl Case for StartTiles {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("sums", |case| case.sums.iter_mut().for_each(|sum| *sum += 1)), ("status", |case| case.status[1] += 1)];

    /// With room for all entries, for one too few, and after a picture that had too few.
    fn inputs(seed: u64, size: u32) -> Vec<StartTiles> {
        let Lists { block, sums, starts, .. } = Lists::new(seed, size);
        let total = starts[starts.len() - 1];
        let dispatch = |(capacity, status): (u32, [u32; 3])| StartTiles {
            block: ListBlock { capacity, ..block },
            sums: sums.clone(),
            status: status.to_vec(),
            starts: Output::Zeros(starts.len() + 1),
            next_status: Output::Zeros(STATUS_NUMBERS as usize),
        };
        [(total, [0, 3, 7]), (total - 1, [0, 4, total + 9]), (total, [1, 5, 0])].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let StartTiles { block, sums, .. } = self;
        let mut starts = vec![0];
        for (run, of_run) in (0..).zip(sums.chunks(TILE_RUN as usize)) {
            let (first, tiles) = (starts[starts.len() - 1], block.tiles_of_run(run) as usize);
            starts.extend(of_run[..tiles - 1].iter().chain(of_run.last()).map(|sum| first + sum));
        }
        let total = starts[starts.len() - 1];
        let is_over = total > self.block.capacity || self.status[0] != 0;
        starts.iter_mut().for_each(|start| *start *= u32::from(!is_over));
        let status = [u32::from(is_over), self.status[1] + u32::from(!is_over), self.status[2].max(total)];
        decided(starts.into_iter().chain([0]).chain(status).map(Bounded::from), 0)
    }
}

impl Case for ListEntries {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("splats", |case| increase(case.splats.iter_mut().map(|splat| &mut splat.depth))),
        ("masks", |case| unmark(&mut case.masks)),
        ("starts", |case| case.starts.fill(0)),
        ("before", |case| case.before.fill(0)),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<ListEntries> {
        let Lists { block, splats, masks, before, starts, .. } = Lists::new(seed, size);
        let keys = Output::Zeros(block.capacity as usize);
        vec![ListEntries { block, splats, masks, starts, before, keys }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let ListEntries { block, splats, masks, starts, before, .. } = self;
        let columns = block.width.div_ceil(SPLAT_TILE as u32);
        let keys = map(block.tile_count() as usize, 16, |tile| {
            let place = [tile as u32 % columns, tile as u32 / columns];
            let at = |part: u32| block.before_at(block.run_of(place), part, place[0] % TILE_RUN) as usize;
            let parts = (0..block.part_count()).map(|part| before[at(part)]);
            let ends = (1..block.part_count()).map(|part| before[at(part)]).chain([starts[tile + 1] - starts[tile]]);
            let list = |(part, (first, end)): (u32, (u32, u32))| {
                let count = (end - first) as usize;
                // Where a decision depends on rounding the counts may have the other one.
                let list = shown(block, splats, masks, place, part).filter(|list| list.len() == count);
                let key = |index: u32| [Some(splats[index as usize].depth.into()), Some(Bounded::from(index))];
                list.map_or_else(|| vec![[None; 2]; count], |list| list.into_iter().map(key).collect())
            };
            (0..).zip(parts.zip(ends)).flat_map(list).collect::<Vec<[Option<Bounded>; 2]>>()
        });
        let mut keys: Vec<[Option<Bounded>; 2]> = keys.into_iter().flatten().collect();
        keys.resize(block.capacity as usize, [Some(Bounded::ZERO); 2]);
        keys.into_flattened()
    }
}

impl Case for SortEntries {
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = EXACT;
    const REASON: &'static str = REASON;
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("starts", |case| case.starts.fill(0)), ("keys", |case| case.keys.reverse())];

    fn inputs(seed: u64, size: u32) -> Vec<SortEntries> {
        let random = &mut random(71, seed, size);
        let tile_count = Lists::new(seed, size).block.tile_count();
        let mut starts = vec![0];
        // Some lists are empty.
        (0..tile_count).for_each(|_| starts.push(starts[starts.len() - 1] + random.below(12).saturating_sub(2) as u32));
        let count = starts[starts.len() - 1];
        let block = ListBlock { capacity: count + 3, ..Lists::new(seed, size).block };
        let key = |entry: u32| [(1.0 + 0.5 * random.below(5) as f32).to_bits(), 1 + entry];
        let keys = (0..block.capacity).map(key).collect();
        vec![SortEntries { block, starts, keys, entries: Output::Zeros(block.capacity as usize) }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let mut entries = Vec::new();
        for tile in self.starts.windows(2) {
            let mut list = self.keys[tile[0] as usize..tile[1] as usize].to_vec();
            list.sort_by(|a, b| f32::from_bits(a[0]).total_cmp(&f32::from_bits(b[0])).then(a[1].cmp(&b[1])));
            entries.extend(list.into_iter().map(|[_, index]| Bounded::from(index)));
        }
        decided(entries, 3)
    }
}
