//! The CPU: every kernel a loop over its elements, spread over all cores.

use super::{Device, Element, MarchTarget, PhotoScene, Pixels};
use rayon::prelude::*;
use std::convert::Infallible;
use std::ops::Range;
use viewfuse_core::photo::hull::hull_entry;
use viewfuse_core::photo::march::march;
use viewfuse_core::photo::sweep::{SweepBlock, match_cost, mean_column, pick_depth, sum_row};

/// All cores of this machine. Buffers are vectors.
#[derive(Clone, Copy, Debug, Default)]
pub struct Cpu;

impl Device for Cpu {
    type Buffer<T: Element> = Vec<T>;
    type Error = Infallible;

    fn name(&self) -> String {
        format!("cpu ({} threads)", rayon::current_num_threads())
    }

    fn upload<T: Element>(&self, values: &[T]) -> Result<Vec<T>, Infallible> {
        Ok(values.to_vec())
    }

    fn zeros<T: Element>(&self, count: usize) -> Result<Vec<T>, Infallible> {
        Ok(vec![T::default(); count])
    }

    fn download<T: Element>(&self, buffer: &Vec<T>) -> Result<Vec<T>, Infallible> {
        Ok(buffer.clone())
    }

    fn hull_entry(&self, scene: &PhotoScene<Self>, view: u32, entries: &mut Vec<f32>) -> Result<(), Infallible> {
        let width = scene.cameras[view as usize].width as usize;
        let rows = of_view_mut(scene, view, entries).par_chunks_mut(width);
        rows.enumerate().for_each(|(row, entries)| {
            for (column, entry) in entries.iter_mut().enumerate() {
                let pixel = (row * width + column) as u32;
                *entry = hull_entry(&scene.object, &scene.views, &scene.texels, view, pixel);
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
        let width = scene.cameras[sweep.view as usize].width;
        for_each_pixel(sweep, width, costs, |pixel, plane, cost| {
            let pixel = sweep.first_row * width + pixel;
            *cost = match_cost(&scene.object, sweep, &scene.views, &scene.texels, entries, pair_weights, pixel, plane);
        });
        Ok(())
    }

    fn sum_row(
        &self,
        sweep: &SweepBlock,
        width: u32,
        costs: &Vec<f32>,
        row_sums: &mut Vec<[f32; 2]>,
    ) -> Result<(), Infallible> {
        for_each_pixel(sweep, width, row_sums, |pixel, plane, sums| {
            *sums = sum_row(sweep, width, costs, pixel, plane);
        });
        Ok(())
    }

    fn mean_column(
        &self,
        sweep: &SweepBlock,
        width: u32,
        costs: &Vec<f32>,
        row_sums: &Vec<[f32; 2]>,
        means: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        for_each_pixel(sweep, width, means, |pixel, plane, mean| {
            *mean = mean_column(sweep, width, costs, row_sums, pixel, plane);
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
                *depth = pick_depth(&scene.object, sweep, width, means, entries, guess, pixel);
            }
        });
        Ok(())
    }

    fn march(
        &self,
        scene: &PhotoScene<Self>,
        depths: &Vec<f32>,
        weights: &Vec<f32>,
        target: &MarchTarget,
        first_row: u32,
        row_count: u32,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), Infallible> {
        let width = target.camera.width as usize;
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
                    &scene.texels,
                    depths,
                    weights,
                    &target.camera,
                    at,
                    &target.background,
                    target.settled,
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

/// Runs a kernel for every pixel and plane of a band, rows in parallel.
fn for_each_pixel<T: Send>(sweep: &SweepBlock, width: u32, values: &mut [T], kernel: impl Fn(u32, u32, &mut T) + Sync) {
    let plane_count = sweep.plane_count as usize;
    values.par_chunks_mut(plane_count * width as usize).enumerate().for_each(|(row, values)| {
        for (column, values) in values.chunks_exact_mut(plane_count).enumerate() {
            let pixel = row as u32 * width + column as u32;
            for (plane, value) in values.iter_mut().enumerate() {
                kernel(pixel, plane as u32, value);
            }
        }
    });
}
