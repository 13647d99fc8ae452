//! Gaussians: projected, composited in tiles, and the derivatives of both.

use crate::gaussians::blend;
use crate::gaussians::blend_gradient::{SplatGradient, TileGradient};
use crate::gaussians::project_gradient;
use crate::gaussians::{SPLAT_TILE, SplatBlock, TileBlock};
use crate::store::Store;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::{GaussianBlock, ProjectedGaussian, project};

/// A Gaussian as the camera sees it.
#[inline(always)]
pub fn project_gaussians(
    block: &SplatBlock,
    gaussians: &(impl Fetch<GaussianBlock> + ?Sized),
    splats: &mut (impl Store<ProjectedGaussian> + ?Sized),
    gaussian: u32,
) {
    let at = gaussian as usize;
    splats.store(at, project(&gaussians.fetch(at), &block.camera, block.near));
}

/// A tile's part of a row of pixels.
#[inline(always)]
pub fn blend_splats(
    block: &TileBlock,
    starts: &[u32],
    entries: &[u32],
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    colours: &mut (impl Store<[f32; 4]> + ?Sized),
    depths: &mut (impl Store<f32> + ?Sized),
    part: u32,
) {
    let row = blend::blend_row(block, starts, entries, splats, part);
    let columns = block.columns_in(part % block.tile_columns) as usize;
    let first = block.first_pixel(part) as usize;
    let mut lane = 0;
    while lane < columns {
        let [red, green, blue] = [row.colour[0][lane], row.colour[1][lane], row.colour[2][lane]];
        colours.store(first + lane, [red, green, blue, 1.0 - row.transmittance[lane]]);
        depths.store(first + lane, row.depth[lane]);
        lane += 1;
    }
}

/// What a tile's pixels say of each splat of its list.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn blend_gradient(
    block: &TileBlock,
    starts: &[u32],
    entries: &[u32],
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    colours: &(impl Fetch<[f32; 4]> + ?Sized),
    gradients: &(impl Fetch<[f32; 4]> + ?Sized),
    sums: &mut (impl Store<SplatGradient> + ?Sized),
    tile: u32,
) {
    let mut through = TileGradient::begin(block, colours, gradients, tile);
    let (mut entry, end) = (starts[tile as usize], starts[tile as usize + 1]);
    let mut is_over = false;
    while entry < end {
        let mut own = SplatGradient {
            opacity: 0.0,
            along: [0.0; 2],
            padding: 0.0,
            squares: [0.0; 3],
            unused: 0.0,
            colour: [0.0; 3],
            behind: 0.0,
        };
        if !is_over {
            own = through.next(&splats.fetch(entries[entry as usize] as usize));
            if entry % SPLAT_TILE as u32 == 0 {
                is_over = through.is_over();
            }
        }
        sums.store(entry as usize, own);
        entry += 1;
    }
}

/// The derivative by a Gaussian, from the entries that are its splat's, `uses[use_starts[gaussian]..use_starts[gaussian + 1]]`, in their
/// order.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn project_gradients(
    block: &SplatBlock,
    gaussians: &(impl Fetch<GaussianBlock> + ?Sized),
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    use_starts: &[u32],
    uses: &[u32],
    sums: &(impl Fetch<SplatGradient> + ?Sized),
    gradients: &mut (impl Store<GaussianBlock> + ?Sized),
    gaussian: u32,
) {
    let at = gaussian as usize;
    let mut all = SplatGradient {
        opacity: 0.0,
        along: [0.0; 2],
        padding: 0.0,
        squares: [0.0; 3],
        unused: 0.0,
        colour: [0.0; 3],
        behind: 0.0,
    };
    let (mut index, end) = (use_starts[at], use_starts[at + 1]);
    while index < end {
        all.add(&sums.fetch(uses[index as usize] as usize));
        index += 1;
    }
    let own = project_gradient::project_gradient(&gaussians.fetch(at), &block.camera, &splats.fetch(at), &all);
    gradients.store(at, own);
}
