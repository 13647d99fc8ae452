//! The field that needs no weights file.

use super::Cpu;
use crate::kernels::light::Pixels;
use crate::kernels::photo::{PhotoKernels, PhotoScene};
use rayon::prelude::*;
use std::convert::Infallible;
use std::ops::Range;
use viewfuse_core::photo::hull::hull_entry;
use viewfuse_core::photo::march::{MarchBlock, march};
use viewfuse_core::photo::sweep::{OUTSIDE, SweepBlock, SweptPixel, mean_column, pick_depth, sum_row};

impl PhotoKernels for Cpu {
    fn hull_entry(&self, scene: &PhotoScene<Self>, view: u32, entries: &mut Vec<f32>) -> Result<(), Infallible> {
        let width = scene.cameras[view as usize].width as usize;
        let rows = of_view_mut(scene, view, entries).par_chunks_mut(width);
        rows.enumerate().for_each(|(row, entries)| {
            for (column, entry) in entries.iter_mut().enumerate() {
                let pixel = (row * width + column) as u32;
                *entry = hull_entry(&scene.object, &scene.views, &scene.texels[..], view, pixel);
            }
        });
        Ok(())
    }

    fn match_cost(
        &self,
        scene: &PhotoScene<Self>,
        sweep: &SweepBlock,
        entries: &Vec<f32>,
        pair_weights: &Vec<f32>,
        costs: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let (width, texels, entries) = (sweep.width, &scene.texels[..], &entries[..]);
        for_each_pixel(sweep, costs, |pixel, costs| {
            let swept = SweptPixel::new(sweep, &scene.views, texels, entries, sweep.first_row * width + pixel);
            let (first, end) = swept.planes(&scene.object, sweep);
            costs.fill(OUTSIDE);
            for (cost, plane) in costs[first as usize..end as usize].iter_mut().zip(first..) {
                *cost = swept.match_cost(&scene.object, sweep, &scene.views, texels, entries, pair_weights, plane);
            }
        });
        Ok(())
    }

    fn sum_row(&self, sweep: &SweepBlock, costs: &Vec<f32>, row_sums: &mut Vec<[f32; 2]>) -> Result<(), Infallible> {
        for_each_plane(sweep, row_sums, |pixel, plane, sums| {
            *sums = sum_row(sweep, costs, pixel, plane);
        });
        Ok(())
    }

    fn mean_column(
        &self,
        sweep: &SweepBlock,
        costs: &Vec<f32>,
        row_sums: &Vec<[f32; 2]>,
        means: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        for_each_plane(sweep, means, |pixel, plane, mean| {
            *mean = mean_column(sweep, costs, row_sums, pixel, plane);
        });
        Ok(())
    }

    fn pick_depth(
        &self,
        scene: &PhotoScene<Self>,
        sweep: &SweepBlock,
        means: &Vec<f32>,
        entries: &Vec<f32>,
        guess: &Vec<f32>,
        rows: Range<u32>,
        picked: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let camera = &scene.cameras[sweep.view as usize];
        let width = camera.width;
        let first = (camera.first_texel + sweep.first_row * width) as usize;
        let band = first..first + (sweep.row_count * width) as usize;
        let written = first + (rows.start * width) as usize..first + (rows.end * width) as usize;
        let (entries, guess) = (&entries[band.clone()], &guess[band]);
        picked[written].par_chunks_mut(width as usize).enumerate().for_each(|(row, depths)| {
            for (column, depth) in depths.iter_mut().enumerate() {
                let pixel = (rows.start + row as u32) * width + column as u32;
                *depth = pick_depth(&scene.object, sweep, means, entries, guess, pixel);
            }
        });
        Ok(())
    }

    fn march(
        &self,
        scene: &PhotoScene<Self>,
        depths: &Vec<f32>,
        weights: &Vec<f32>,
        target: &MarchBlock,
        first_row: u32,
        row_count: u32,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), Infallible> {
        let width = target.target.width as usize;
        let band = first_row as usize * width..(first_row + row_count) as usize * width;
        let colour_rows = pixels.colours[band.clone()].par_chunks_mut(width);
        let depth_rows = pixels.depths[band].par_chunks_mut(width);
        colour_rows.zip(depth_rows).enumerate().for_each(|(row, (colours, pixel_depths))| {
            for (column, (colour, depth)) in colours.iter_mut().zip(pixel_depths).enumerate() {
                let at = [column as f32 + 0.5, (first_row as usize + row) as f32 + 0.5];
                let seen = march(
                    &scene.object,
                    &scene.views,
                    &scene.footprints,
                    &scene.texels[..],
                    &depths[..],
                    weights,
                    target,
                    at,
                );
                *colour = [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity];
                *depth = seen.depth;
            }
        });
        Ok(())
    }
}

/// The part of a map of all views that belongs to one.
fn of_view_mut<'a>(scene: &PhotoScene<Cpu>, view: u32, map: &'a mut [f32]) -> &'a mut [f32] {
    let camera = &scene.cameras[view as usize];
    let first = camera.first_texel as usize;
    &mut map[first..first + (camera.width * camera.height) as usize]
}

/// Runs a kernel for every pixel of a band, rows in parallel; it gets the values of all planes.
fn for_each_pixel<T: Send>(sweep: &SweepBlock, values: &mut [T], kernel: impl Fn(u32, &mut [T]) + Sync) {
    let (plane_count, width) = (sweep.plane_count as usize, sweep.width);
    values.par_chunks_mut(plane_count * width as usize).enumerate().for_each(|(row, values)| {
        for (column, values) in values.chunks_exact_mut(plane_count).enumerate() {
            kernel(row as u32 * width + column as u32, values);
        }
    });
}

/// Runs a kernel for every pixel and plane of a band.
fn for_each_plane<T: Send>(sweep: &SweepBlock, values: &mut [T], kernel: impl Fn(u32, u32, &mut T) + Sync) {
    for_each_pixel(sweep, values, |pixel, values| {
        for (value, plane) in values.iter_mut().zip(0..) {
            kernel(pixel, plane, value);
        }
    });
}
