//! The training-free field inside silhouettes: where rays enter the hull, the plane sweep behind it, and ray marching.

use crate::store::Store;
use crate::visual_hull::ray_marching::{self, MarchBlock};
use crate::visual_hull::sweep::{OUTSIDE, SweepBlock, SweptPixel};
use crate::visual_hull::{ObjectBlock, hull, sweep};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::{Fetch, StartingAt};

/// Where the ray of a view's pixel enters the hull.
#[inline]
pub fn hull_entry(
    view: &u32,
    object: &ObjectBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    entries: &mut (impl Store<f32> + ?Sized),
    pixel: u32,
) {
    let entry = hull::hull_entry(object, views, texels, *view, pixel);
    entries.store((views.fetch(*view as usize).first_texel + pixel) as usize, entry);
}

/// Matching costs of the other views at all planes of a pixel of the band.
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn match_cost(
    block: &SweepBlock,
    object: &ObjectBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    entries: &(impl Fetch<f32> + ?Sized),
    pair_weights: &[f32],
    costs: &mut (impl Store<f32> + ?Sized),
    pixel: u32,
) {
    let swept = SweptPixel::new(block, views, texels, entries, block.first_row * block.width + pixel);
    let (first, end) = swept.planes(object, block);
    let costs_of_pixel = pixel * block.plane_count;
    let mut plane = 0;
    while plane < first {
        costs.store((costs_of_pixel + plane) as usize, OUTSIDE);
        plane += 1;
    }
    while plane < end {
        let cost = swept.match_cost(object, block, views, texels, entries, pair_weights, plane);
        costs.store((costs_of_pixel + plane) as usize, cost);
        plane += 1;
    }
    while plane < block.plane_count {
        costs.store((costs_of_pixel + plane) as usize, OUTSIDE);
        plane += 1;
    }
}

/// Costs summed over a window's columns at a plane of a pixel of the band.
#[inline]
pub fn sum_row(block: &SweepBlock, costs: &[f32], row_sums: &mut (impl Store<[f32; 2]> + ?Sized), plane: u32) {
    let (pixel, plane_of_pixel) = (plane / block.plane_count, plane % block.plane_count);
    row_sums.store(plane as usize, sweep::sum_row(block, costs, pixel, plane_of_pixel));
}

/// Costs averaged over a window at a plane of a pixel of the band.
#[inline]
pub fn mean_column(
    block: &SweepBlock,
    costs: &[f32],
    row_sums: &[[f32; 2]],
    means: &mut (impl Store<f32> + ?Sized),
    plane: u32,
) {
    let (pixel, plane_of_pixel) = (plane / block.plane_count, plane % block.plane_count);
    means.store(plane as usize, sweep::mean_column(block, costs, row_sums, pixel, plane_of_pixel));
}

/// The depth of least cost of a pixel of the band. `entries`, `guess` and `picked` are maps of all views, of which the
/// band is a part.
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn pick_depth(
    block: &SweepBlock,
    object: &ObjectBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    means: &[f32],
    entries: &(impl Fetch<f32> + ?Sized),
    guess: &(impl Fetch<f32> + ?Sized),
    picked: &mut (impl Store<f32> + ?Sized),
    pixel: u32,
) {
    let first = (views.fetch(block.view as usize).first_texel + block.first_row * block.width) as usize;
    let (entries, guess) = (StartingAt { all: entries, first }, StartingAt { all: guess, first });
    picked.store(first + pixel as usize, sweep::pick_depth(object, block, means, &entries, &guess, pixel));
}

/// The ray of a target's pixel through the solid.
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn march_rays(
    block: &MarchBlock,
    object: &ObjectBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    footprints: &[f32],
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    depths: &(impl Fetch<f32> + ?Sized),
    weights: &[f32],
    colours: &mut (impl Store<[f32; 4]> + ?Sized),
    pixel_depths: &mut (impl Store<f32> + ?Sized),
    pixel: u32,
) {
    let width = block.target.width;
    let at = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    let seen = ray_marching::march_ray(object, views, footprints, texels, depths, weights, block, at);
    colours.store(pixel as usize, [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity]);
    pixel_depths.store(pixel as usize, seen.depth);
}
