//! The training-free field.

use crate::parallel::{for_each_row, for_each_row_of_two};
use viewfuse_core::camera::CameraBlock;
use viewfuse_kernels::visual_hull::ObjectBlock;
use viewfuse_kernels::visual_hull::hull;
use viewfuse_kernels::visual_hull::ray_marching::{self, MarchBlock};
use viewfuse_kernels::visual_hull::sweep::{self, OUTSIDE, SweepBlock, SweptPixel};

pub(super) fn hull_entry(
    view: &u32,
    pixel_count: u32,
    object: &[ObjectBlock],
    views: &[CameraBlock],
    texels: &[[f32; 4]],
    entries: &mut [f32],
) {
    let camera = &views[*view as usize];
    let (first, width) = (camera.first_texel as usize, camera.width as usize);
    for_each_row(&mut entries[first..first + pixel_count as usize], width, 64, |row, entries| {
        for (column, entry) in entries.iter_mut().enumerate() {
            let pixel = (row * width + column) as u32;
            *entry = hull::hull_entry(&object[0], views, texels, *view, pixel);
        }
    });
}

pub(super) fn match_cost(
    sweep: &SweepBlock,
    object: &[ObjectBlock],
    views: &[CameraBlock],
    texels: &[[f32; 4]],
    entries: &[f32],
    pair_weights: &[f32],
    costs: &mut [f32],
) {
    let (object, width) = (&object[0], sweep.width);
    for_each_pixel(sweep, costs, 512, |pixel, costs| {
        let swept = SweptPixel::new(sweep, views, texels, entries, sweep.first_row * width + pixel);
        let (first, end) = swept.planes(object, sweep);
        costs.fill(OUTSIDE);
        for (cost, plane) in costs[first as usize..end as usize].iter_mut().zip(first..) {
            *cost = swept.match_cost(object, sweep, views, texels, entries, pair_weights, plane);
        }
    });
}

pub(super) fn sum_row(sweep: &SweepBlock, costs: &[f32], row_sums: &mut [[f32; 2]]) {
    for_each_plane(sweep, row_sums, |pixel, plane, sums| {
        *sums = sweep::sum_row(sweep, costs, pixel, plane);
    });
}

pub(super) fn mean_column(sweep: &SweepBlock, costs: &[f32], row_sums: &[[f32; 2]], means: &mut [f32]) {
    for_each_plane(sweep, means, |pixel, plane, mean| {
        *mean = sweep::mean_column(sweep, costs, row_sums, pixel, plane);
    });
}

#[allow(clippy::too_many_arguments)]
pub(super) fn pick_depth(
    sweep: &SweepBlock,
    first_row: u32,
    row_count: u32,
    object: &[ObjectBlock],
    views: &[CameraBlock],
    means: &[f32],
    entries: &[f32],
    guess: &[f32],
    picked: &mut [f32],
) {
    let camera = &views[sweep.view as usize];
    let width = camera.width;
    let first = (camera.first_texel + sweep.first_row * width) as usize;
    let band = first..first + (sweep.row_count * width) as usize;
    let (entries, guess) = (&entries[band.clone()], &guess[band]);
    let first = first + (first_row * width) as usize;
    for_each_row(&mut picked[first..][..(row_count * width) as usize], width as usize, 64, |row, depths| {
        for (column, depth) in depths.iter_mut().enumerate() {
            let pixel = (first_row + row as u32) * width + column as u32;
            *depth = sweep::pick_depth(&object[0], sweep, means, entries, guess, pixel);
        }
    });
}

#[allow(clippy::too_many_arguments)]
pub(super) fn march_rays(
    target: &MarchBlock,
    first_row: u32,
    row_count: u32,
    object: &[ObjectBlock],
    views: &[CameraBlock],
    footprints: &[f32],
    texels: &[[f32; 4]],
    depths: &[f32],
    weights: &[f32],
    colours: &mut [[f32; 4]],
    pixel_depths: &mut [f32],
) {
    let width = target.target.width as usize;
    let band = first_row as usize * width..(first_row + row_count) as usize * width;
    let (colours, pixel_depths) = (&mut colours[band.clone()], &mut pixel_depths[band]);
    for_each_row_of_two(colours, pixel_depths, width, 16, |row, colours, pixel_depths| {
        for (column, (colour, depth)) in colours.iter_mut().zip(pixel_depths).enumerate() {
            let at = [column as f32 + 0.5, (first_row as usize + row) as f32 + 0.5];
            let seen = ray_marching::march_ray(&object[0], views, footprints, texels, depths, weights, target, at);
            *colour = [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity];
            *depth = seen.depth;
        }
    });
}

/// Runs a kernel for every pixel of a band, rows in parallel; it gets the values of all planes. `least` values are enough
/// work for a part.
fn for_each_pixel<T: Send>(sweep: &SweepBlock, values: &mut [T], least: usize, kernel: impl Fn(u32, &mut [T]) + Sync) {
    let (plane_count, width) = (sweep.plane_count as usize, sweep.width);
    for_each_row(values, plane_count * width as usize, least, |row, values| {
        for (column, values) in values.chunks_exact_mut(plane_count).enumerate() {
            kernel(row as u32 * width + column as u32, values);
        }
    });
}

/// Runs a kernel for every pixel and plane of a band.
fn for_each_plane<T: Send>(sweep: &SweepBlock, values: &mut [T], kernel: impl Fn(u32, u32, &mut T) + Sync) {
    for_each_pixel(sweep, values, 4096, |pixel, values| {
        for (value, plane) in values.iter_mut().zip(0..) {
            kernel(pixel, plane, value);
        }
    });
}
