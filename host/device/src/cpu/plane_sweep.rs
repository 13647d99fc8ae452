//! The training-free field for any scene.

use crate::parallel::{for_each_row, for_each_rows};
use pulp::Arch;
use std::sync::Mutex;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::blend::{self, BlendBlock};
use viewfuse_kernels::plane_sweep::census;
use viewfuse_kernels::plane_sweep::disparity;
use viewfuse_kernels::plane_sweep::evidence::{self, ViewPair};
use viewfuse_kernels::plane_sweep::frustum::{FrustumBlock, SweptView};
use viewfuse_kernels::plane_sweep::path::{self, CostBlock, Line};
use viewfuse_kernels::plane_sweep::window::{self, WindowBlock};

pub(super) fn compare_views(
    block: &FrustumBlock,
    views: &[SweptView],
    pairs: &[ViewPair],
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    grey: &mut [Planes],
    evidence: &mut [Planes],
) {
    let groups = block.group_count as usize;
    let row_len = block.camera.width as usize * groups;
    let slice = block.row_count as usize * row_len;
    // A row of the evidence, and the same row of each view's grey.
    let mut views_of_row: Vec<Vec<&mut [Planes]>> = (0..block.row_count).map(|_| Vec::new()).collect();
    for view in grey[..slice * block.view_count as usize].chunks_exact_mut(slice) {
        views_of_row.iter_mut().zip(view.chunks_exact_mut(row_len)).for_each(|(rows, row)| rows.push(row));
    }
    let views_of_row: Vec<Mutex<Vec<&mut [Planes]>>> = views_of_row.into_iter().map(Mutex::new).collect();
    for_each_row(&mut evidence[..4 * slice], 4 * row_len, 512, |row, evidence| {
        let Ok(mut grey) = views_of_row[row].lock() else { return };
        Arch::new().dispatch(|| {
            for (at, evidence) in evidence.chunks_exact_mut(4).enumerate() {
                let pixel = (block.first_row as usize + row) * block.camera.width as usize + at / groups;
                let group = (at % groups) as u32;
                let found = evidence::evidence(block, views, pairs, texels, disparities, pixel as u32, group);
                evidence.copy_from_slice(&[found.difference, found.weight, found.dissent, found.hull]);
                grey.iter_mut().zip(&found.grey).for_each(|(row, grey)| row[at] = *grey);
            }
        });
    });
}

pub(super) fn census_cost(
    block: &FrustumBlock,
    first_row: u32,
    row_count: u32,
    pairs: &[ViewPair],
    grey: &[Planes],
    evidence: &[Planes],
    costs: &mut [Planes],
) {
    let (width, groups) = (block.camera.width as usize, block.group_count as usize);
    let row_len = 2 * width * groups;
    let first = (block.first_row + first_row) as usize * row_len;
    for_each_row(&mut costs[first..][..row_count as usize * row_len], row_len, 256, |row, costs| {
        Arch::new().dispatch(|| {
            for (at, costs) in costs.chunks_exact_mut(2).enumerate() {
                let pixel = (first_row as usize + row) * width + at / groups;
                let found = census::census_cost(block, pairs, grey, evidence, pixel as u32, (at % groups) as u32);
                costs.copy_from_slice(&found);
            }
        });
    });
}

pub(super) fn row_sums(block: &WindowBlock, costs: &[Planes], sums: &mut [Planes]) {
    for_each_group(block.width, block.height, block.group_count, 6, sums, |pixel, group, sums| {
        let [[a, b], [c, d], [e, f]] = window::row_sums(block, costs, pixel, group);
        sums.copy_from_slice(&[a, b, c, d, e, f]);
    });
}

pub(super) fn window_cost(block: &WindowBlock, sums: &[Planes], means: &mut [Planes]) {
    for_each_group(block.width, block.height, block.group_count, 1, means, |pixel, group, means| {
        means[0] = window::window_cost(block, sums, pixel, group);
    });
}

pub(super) fn follow_paths(block: &CostBlock, means: &[Planes], paths: &mut [Planes]) {
    let groups = block.group_count as usize;
    let half = 2 * (block.width * block.height) as usize * groups;
    let (horizontal, vertical) = paths[..2 * half].split_at_mut(half);
    let halves = [(horizontal, block.width, 0), (vertical, block.height, 2 * block.height)];
    for (paths, step_count, first_line) in halves {
        for_each_row(paths, step_count as usize * groups, 512, |line, paths| {
            Arch::new().dispatch(|| {
                let (direction, number, _) = block.line(first_line + line as u32);
                let mut state = Line::START;
                for (step, paths) in paths.chunks_exact_mut(groups).enumerate() {
                    let pixel = block.pixel(direction, number, step as u32) as usize;
                    state.advance(means, pixel * groups, groups);
                    paths.iter_mut().enumerate().for_each(|(group, path)| *path = state.costs(group));
                }
            });
        });
    }
}

pub(super) fn join_paths(block: &CostBlock, paths: &[Planes], costs: &mut [Planes]) {
    for_each_group(block.width, block.height, block.group_count, 1, costs, |pixel, group, costs| {
        costs[0] = path::joined_cost(block, paths, pixel, group);
    });
}

pub(super) fn pick_disparity(block: &FrustumBlock, costs: &[Planes], disparities: &mut [[f32; 2]]) {
    let camera = &block.camera;
    let width = camera.width as usize;
    let map = &mut disparities[camera.first_texel as usize..][..width * camera.height as usize];
    for_each_row(map, width, 64, |row, map| {
        Arch::new().dispatch(|| {
            for (column, value) in map.iter_mut().enumerate() {
                *value = disparity::pick_disparity(block, costs, (row * width + column) as u32);
            }
        });
    });
}

#[allow(clippy::too_many_arguments)]
pub(super) fn blend_planes(
    block: &BlendBlock,
    first_row: u32,
    row_count: u32,
    views: &[SweptView],
    texels: &[[f32; 4]],
    disparities: &[[f32; 2]],
    costs: &[Planes],
    colours: &mut [[f32; 4]],
    pixel_depths: &mut [f32],
    confidences: &mut [f32],
) {
    let width = block.target.width as usize;
    let band = first_row as usize * width..(first_row + row_count) as usize * width;
    let depths =
        pixel_depths[band.clone()].chunks_exact_mut(width).zip(confidences[band.clone()].chunks_exact_mut(width));
    let others: Vec<_> = depths.map(Mutex::new).collect();
    for_each_row(&mut colours[band], width, 64, |row, colours| {
        let Ok(mut others) = others[row].lock() else { return };
        let (depths, confidences) = &mut *others;
        Arch::new().dispatch(|| {
            for (column, colour) in colours.iter_mut().enumerate() {
                let at = [column as f32 + 0.5, (first_row as usize + row) as f32 + 0.5];
                let seen = blend::blend(block, views, texels, disparities, costs, at);
                *colour = seen.colour;
                depths[column] = seen.depth;
                confidences[column] = seen.confidence;
            }
        });
    });
}

/// Runs a kernel for every group of planes of every pixel, some rows at a time; `count` values are one group's.
fn for_each_group(
    width: u32,
    height: u32,
    groups: u32,
    count: usize,
    values: &mut [Planes],
    kernel: impl Fn(u32, u32, &mut [Planes]) + Sync,
) {
    let row_len = (width * groups) as usize * count;
    for_each_rows(&mut values[..row_len * height as usize], row_len, 1024, &|first, rows| {
        Arch::new().dispatch(|| {
            for (at, values) in rows.chunks_exact_mut(count).enumerate() {
                let at = (first * (width * groups) as usize + at) as u32;
                kernel(at / groups, at % groups, values);
            }
        });
    });
}
