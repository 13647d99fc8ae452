//! Pixels from the splats of their tile, front to back.

use super::lanes::{Lanes, SplatLanes, greatest};
use super::{MIN_TRANSMITTANCE, TileBlock};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::ProjectedGaussian;
use viewfuse_core::math::abs;

/// After so many splats it is seen whether any pixel still needs more.
const CHECK: u32 = 8;

/// Pixels of a row.
#[derive(Clone, Copy, Debug)]
pub struct BlendedLanes<const N: usize> {
    /// Red, green, blue, over the background.
    pub colour: [Lanes<N>; 3],
    /// Weighted sums of the depths.
    pub depth: Lanes<N>,
    /// What is seen behind.
    pub transmittance: Lanes<N>,
}

impl<const N: usize> BlendedLanes<N> {
    /// Before the first splat.
    pub const BEGUN: BlendedLanes<N> = BlendedLanes { colour: [[0.0; N]; 3], depth: [0.0; N], transmittance: [1.0; N] };

    /// Composites the splats of a tile, `entries[starts[tile]..starts[tile + 1]]`, front to back, at pixels of it: the
    /// first one's column and row. A pixel behind whose splats less than [`MIN_TRANSMITTANCE`] is seen takes no more.
    #[inline(always)]
    pub fn of(
        block: &TileBlock,
        starts: &[u32],
        entries: &[u32],
        splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
        [column, row]: [u32; 2],
    ) -> BlendedLanes<N> {
        let tile = block.tile_of(column, row) as usize;
        let (x, y) = (column as f32 + 0.5, row as f32 + 0.5);
        let mut blended = BlendedLanes::BEGUN;
        let end = starts[tile + 1];
        let mut entry = starts[tile];
        let mut seen = 0;
        while entry < end {
            let splat = splats.fetch(entries[entry as usize] as usize);
            entry += 1;
            if blended.add(&splat, x, y) {
                seen += 1;
                if seen == CHECK {
                    seen = 0;
                    if greatest(&blended.transmittance) < MIN_TRANSMITTANCE {
                        entry = end;
                    }
                }
            }
        }
        blended.finish(block);
        blended
    }

    /// Adds the background.
    #[inline(always)]
    pub fn finish(&mut self, block: &TileBlock) {
        let mut channel = 0;
        while channel < 3 {
            let mut lane = 0;
            while lane < N {
                self.colour[channel][lane] += self.transmittance[lane] * block.background[channel];
                lane += 1;
            }
            channel += 1;
        }
    }

    /// A pixel's colour and opacity.
    #[inline(always)]
    pub fn pixel(&self, lane: usize) -> [f32; 4] {
        [self.colour[0][lane], self.colour[1][lane], self.colour[2][lane], 1.0 - self.transmittance[lane]]
    }

    /// Puts the next splat behind what is there, at pixels the first of which has its centre at image coordinates `x`
    /// and `y`; `false` if it covers nothing of their row.
    #[inline(always)]
    pub fn add(&mut self, splat: &ProjectedGaussian, x: f32, y: f32) -> bool {
        if !(abs(y - splat.mean[1]) <= splat.extent[1]) {
            return false;
        }
        let seen = SplatLanes::<N>::of(splat, x, y);
        let mut lane = 0;
        while lane < N {
            let before = self.transmittance[lane];
            let weight = if before >= MIN_TRANSMITTANCE { seen.alpha[lane] * before } else { 0.0 };
            self.colour[0][lane] += weight * splat.colour[0];
            self.colour[1][lane] += weight * splat.colour[1];
            self.colour[2][lane] += weight * splat.colour[2];
            self.depth[lane] += weight * splat.depth;
            self.transmittance[lane] = before - weight;
            lane += 1;
        }
        true
    }
}
