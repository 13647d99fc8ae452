//! A picture's tiles, and which splats each shows, the nearest first.

use viewfuse_kernels::gaussians::{SPLAT_TILE, TileBlock};
use viewfuse_kernels::rows::ProjectedGaussian;

/// The lists of a picture's tiles.
#[derive(Clone, Debug, Default)]
pub struct Tiles {
    /// Where each tile's part of the entries begins, and behind the last one their number.
    pub starts: Vec<u32>,
    /// Indices of splats: tile by tile, front to back; of the same depth, by index.
    pub entries: Vec<u32>,
}

impl Tiles {
    /// The lists for these splats. Those that are not drawn are in none.
    pub fn of(block: &TileBlock, splats: &[ProjectedGaussian]) -> Tiles {
        let side = SPLAT_TILE as u32;
        // Depths are positive, so their bits are in their order.
        let mut order: Vec<(u64, [u32; 4])> = Vec::with_capacity(splats.len());
        for (index, splat) in splats.iter().enumerate().filter(|(_, splat)| splat.opacity > 0.0) {
            let [left, right, top, bottom] = splat.pixels(block.width, block.height);
            if left < right && top < bottom {
                let tiles = [left / side, (right - 1) / side, top / side, (bottom - 1) / side];
                order.push((u64::from(splat.depth.to_bits()) << 32 | index as u64, tiles));
            }
        }
        order.sort_unstable_by_key(|(key, _)| *key);
        let mut starts = vec![0_u32; block.tile_count() as usize + 1];
        for_each_tile(block, &order, |_, tile| starts[tile + 1] += 1);
        for tile in 1..starts.len() {
            starts[tile] += starts[tile - 1];
        }
        let mut entries = vec![0; starts.last().copied().unwrap_or_default() as usize];
        let mut next = starts.clone();
        for_each_tile(block, &order, |splat, tile| {
            entries[next[tile] as usize] = splat;
            next[tile] += 1;
        });
        Tiles { starts, entries }
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

/// `work(splat, tile)` for each tile of each splat, in this order.
fn for_each_tile(block: &TileBlock, order: &[(u64, [u32; 4])], mut work: impl FnMut(u32, usize)) {
    for (key, [left, right, top, bottom]) in order {
        for row in *top..=*bottom {
            for column in *left..=*right {
                work(*key as u32, (row * block.tile_columns + column) as usize);
            }
        }
    }
}
