//! Pixels from the splats of their tile, front to back.

use super::lanes::{Lanes, SplatLanes, greatest};
use super::{MIN_TRANSMITTANCE, SPLAT_TILE, TileBlock};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;
use viewfuse_core::math::abs;

/// After so many splats it is seen whether any pixel still needs more.
const CHECK: u32 = 8;

/// A tile's part of a row of pixels.
#[derive(Clone, Copy, Debug)]
pub struct BlendedRow {
    /// Red, green, blue, over the background.
    pub colour: [Lanes; 3],
    /// Weighted sums of the depths.
    pub depth: Lanes,
    /// What is seen behind.
    pub transmittance: Lanes,
}

/// Composites the splats of a part's tile, `entries[starts[tile]..starts[tile + 1]]`, front to back. A pixel behind whose splats less
/// than [`MIN_TRANSMITTANCE`] is seen takes no more.
#[inline(always)]
pub fn blend_row(
    block: &TileBlock,
    starts: &[u32],
    entries: &[u32],
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    part: u32,
) -> BlendedRow {
    let (row, tile_column) = (part / block.tile_columns, part % block.tile_columns);
    let tile = (row / SPLAT_TILE as u32 * block.tile_columns + tile_column) as usize;
    let (x, y) = ((tile_column * SPLAT_TILE as u32) as f32 + 0.5, row as f32 + 0.5);
    let mut own =
        BlendedRow { colour: [[0.0; SPLAT_TILE]; 3], depth: [0.0; SPLAT_TILE], transmittance: [1.0; SPLAT_TILE] };
    let end = starts[tile + 1];
    let mut entry = starts[tile];
    let mut seen = 0;
    while entry < end {
        let splat = splats.fetch(entries[entry as usize] as usize);
        entry += 1;
        if abs(y - splat.mean[1]) <= splat.extent[1] {
            own.add(&splat, x, y);
            seen += 1;
            if seen == CHECK {
                seen = 0;
                if greatest(&own.transmittance) < MIN_TRANSMITTANCE {
                    entry = end;
                }
            }
        }
    }
    let mut channel = 0;
    while channel < 3 {
        let mut lane = 0;
        while lane < SPLAT_TILE {
            own.colour[channel][lane] += own.transmittance[lane] * block.background[channel];
            lane += 1;
        }
        channel += 1;
    }
    own
}

impl BlendedRow {
    #[inline(always)]
    fn add(&mut self, splat: &ProjectedGaussian, x: f32, y: f32) {
        let seen = SplatLanes::of(splat, x, y);
        let mut lane = 0;
        while lane < SPLAT_TILE {
            let before = self.transmittance[lane];
            let weight = if before >= MIN_TRANSMITTANCE { seen.alpha[lane] * before } else { 0.0 };
            self.colour[0][lane] += weight * splat.colour[0];
            self.colour[1][lane] += weight * splat.colour[1];
            self.colour[2][lane] += weight * splat.colour[2];
            self.depth[lane] += weight * splat.depth;
            self.transmittance[lane] = before - weight;
            lane += 1;
        }
    }
}
