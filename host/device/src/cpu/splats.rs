//! Pixels from the splats of their tile, a tile's part of a row at a time: eight lanes, each of which has the body's
//! operations in their order, so the results are the same bits.

use crate::parallel::{Rest, for_each_piece};
use pulp::Arch;
use std::ops::Range;
use viewfuse_kernels::gaussians::blend::BlendedLanes;
use viewfuse_kernels::gaussians::{SPLAT_TILE, TileBlock};
use viewfuse_kernels::rows::ProjectedGaussian;
use viewfuse_kernels::store::Store;

pub(super) fn blend_splats(
    block: &TileBlock,
    starts: &[u32],
    entries: &[u32],
    splats: &[ProjectedGaussian],
    colours: &mut [[f32; 4]],
    depths: &mut [f32],
) {
    let (mut colours, mut depths) = (Rest::new(colours), Rest::new(depths));
    let take = move |parts: Range<u32>| {
        let [start, end] = [parts.start, parts.end].map(|part| block.first_pixel(part) as usize);
        (colours.take(start, end), depths.take(start, end))
    };
    for_each_piece(0..block.part_count(), 16, take, |parts, (mut colours, mut depths)| {
        Arch::new().dispatch(
            #[inline(always)]
            || {
                for part in parts {
                    let (column, row) = (part % block.tile_columns * SPLAT_TILE as u32, part / block.tile_columns);
                    let blended = BlendedLanes::<SPLAT_TILE>::of(block, starts, entries, splats, [column, row]);
                    let first = block.first_pixel(part) as usize;
                    for lane in 0..block.columns_in(part % block.tile_columns) as usize {
                        colours.store(first + lane, blended.pixel(lane));
                        depths.store(first + lane, blended.depth[lane]);
                    }
                }
            },
        );
    });
}
