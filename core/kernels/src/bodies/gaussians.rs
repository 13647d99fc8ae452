//! Gaussians: projected, composited in tiles, and the derivatives of both.

use crate::gaussians::blend::BlendedLanes;
use crate::gaussians::blend_gradient::{SplatGradient, TileGradient};
use crate::gaussians::project_gradient;
use crate::gaussians::shown::{shown_pixel, surface_depth};
use crate::gaussians::{SPLAT_TILE, SplatBlock, TileBlock};
use crate::store::Store;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::{GaussianBlock, ProjectedGaussian, project_as};

/// A Gaussian as the camera sees it.
#[inline(always)]
pub fn project_gaussians(
    block: &SplatBlock,
    gaussians: &(impl Fetch<GaussianBlock> + ?Sized),
    splats: &mut (impl Store<ProjectedGaussian> + ?Sized),
    gaussian: u32,
) {
    let at = gaussian as usize;
    let is_antialiased = block.is_antialiased != 0;
    splats.store(at, project_as(&gaussians.fetch(at), &block.camera, block.near, is_antialiased));
}

/// The pixels of a tile.
#[inline(always)]
pub fn blend_splats(
    block: &TileBlock,
    starts: &[u32],
    entries: &[u32],
    splats: &(impl Fetch<ProjectedGaussian> + ?Sized),
    colours: &mut (impl Store<[f32; 4]> + ?Sized),
    depths: &mut (impl Store<f32> + ?Sized),
    tile: u32,
) {
    let mut pixel = 0;
    while pixel < (SPLAT_TILE * SPLAT_TILE) as u32 {
        if let Some([column, row]) = block.pixel_of_tile(tile, pixel) {
            let blended = BlendedLanes::<1>::of(block, starts, entries, splats, [column, row]);
            let at = (row * block.width + column) as usize;
            colours.store(at, blended.pixel(0));
            depths.store(at, blended.depth[0]);
        }
        pixel += 1;
    }
}

/// A pixel as it is shown.
#[inline(always)]
pub fn show_pixels(
    least_opacity: &f32,
    colours: &(impl Fetch<[f32; 4]> + ?Sized),
    depths: &[f32],
    shown: &mut (impl Store<u32> + ?Sized),
    surfaces: &mut (impl Store<f32> + ?Sized),
    pixel: u32,
) {
    let at = pixel as usize;
    let colour = colours.fetch(at);
    shown.store(at, shown_pixel(colour));
    surfaces.store(at, surface_depth(depths[at], colour[3], *least_opacity));
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
        let mut gradient = SplatGradient::ZERO;
        if !is_over {
            gradient = through.next(&splats.fetch(entries[entry as usize] as usize));
            if entry % SPLAT_TILE as u32 == 0 {
                is_over = through.is_over();
            }
        }
        sums.store(entry as usize, gradient);
        entry += 1;
    }
}

/// The derivative by a Gaussian, from the entries that are its splat's,
/// `uses[use_starts[gaussian]..use_starts[gaussian + 1]]`, in their order.
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
    let mut all = SplatGradient::ZERO;
    let (mut index, end) = (use_starts[at], use_starts[at + 1]);
    while index < end {
        all.add(&sums.fetch(uses[index as usize] as usize));
        index += 1;
    }
    let gradient = project_gradient::project_gradient(block, &gaussians.fetch(at), &splats.fetch(at), &all);
    gradients.store(at, gradient);
}
