//! A picture's tiles, and which splats each shows, the nearest first.

use viewfuse_device::parallel::map;
use viewfuse_kernels::gaussians::lists::is_reached;
use viewfuse_kernels::gaussians::{SPLAT_TILE, TileBlock};
use viewfuse_kernels::rows::ProjectedGaussian;

/// Splats that are listed at once.
const PIECE: usize = 4096;

/// The lists of a picture's tiles.
#[derive(Clone, Debug, Default)]
pub struct Tiles {
    /// Where each tile's part of the entries begins, and behind the last one their number.
    pub starts: Vec<u32>,
    /// Indices of splats: tile by tile, front to back; of the same depth, by index.
    pub entries: Vec<u32>,
    /// Whether each splat's box has pixels of the picture.
    pub in_sight: Vec<bool>,
}

impl Tiles {
    /// The lists for these splats: each is in those of the tiles where it may be seen. Those that are not drawn are in
    /// none.
    pub fn of(block: &TileBlock, splats: &[ProjectedGaussian]) -> Tiles {
        let mut in_sight = vec![false; splats.len()];
        // Depths are positive, so their bits are in their order.
        let mut order: Vec<u64> = Vec::with_capacity(splats.len());
        for ((index, splat), in_sight) in splats.iter().enumerate().zip(&mut in_sight) {
            let [left, right, top, bottom] = splat.pixels(block.width, block.height);
            *in_sight = left < right && top < bottom;
            if *in_sight {
                order.push(u64::from(splat.depth.to_bits()) << 32 | index as u64);
            }
        }
        order.sort_unstable();
        let pieces: Vec<&[u64]> = order.chunks(PIECE).collect();
        let pieces: Vec<Vec<[u32; 2]>> = map(pieces.len(), 1, |piece| {
            let mut listed = Vec::with_capacity(4 * PIECE);
            for key in pieces[piece] {
                let index = *key as u32;
                for_each_tile(block, &splats[index as usize], |tile| listed.push([tile, index]));
            }
            listed
        });
        let mut starts = vec![0_u32; block.tile_count() as usize + 1];
        pieces.iter().flatten().for_each(|[tile, _]| starts[*tile as usize + 1] += 1);
        for tile in 1..starts.len() {
            starts[tile] += starts[tile - 1];
        }
        let mut entries = vec![0; starts.last().copied().unwrap_or_default() as usize];
        let mut next = starts.clone();
        for [tile, splat] in pieces.iter().flatten() {
            let next = &mut next[*tile as usize];
            entries[*next as usize] = *splat;
            *next += 1;
        }
        Tiles { starts, entries, in_sight }
    }

    /// The entries of each of `count` splats, ascending: where each one's part begins, and the numbers of its entries.
    pub(super) fn uses(&self, count: usize) -> (Vec<u32>, Vec<u32>) {
        let mut starts = vec![0_u32; count + 1];
        self.entries.iter().for_each(|splat| starts[*splat as usize + 1] += 1);
        for splat in 1..starts.len() {
            starts[splat] += starts[splat - 1];
        }
        let (mut uses, mut next) = (vec![0; self.entries.len()], starts.clone());
        for (entry, splat) in self.entries.iter().enumerate() {
            let next = &mut next[*splat as usize];
            uses[*next as usize] = entry as u32;
            *next += 1;
        }
        (starts, uses)
    }
}

/// `work(tile)` for each tile, row by row, of which a splat may be seen at a pixel.
fn for_each_tile(block: &TileBlock, splat: &ProjectedGaussian, mut work: impl FnMut(u32)) {
    let side = SPLAT_TILE as u32;
    let [left, right, top, bottom] = splat.pixels(block.width, block.height);
    for row in top / side..=(bottom - 1) / side {
        for column in left / side..=(right - 1) / side {
            if is_reached(splat, [left, right, top, bottom], column, row) {
                work(row * block.tile_columns + column);
            }
        }
    }
}
