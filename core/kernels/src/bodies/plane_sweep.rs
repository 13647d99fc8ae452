//! The plane sweep: views compared on planes, costs averaged and joined along lines, disparities picked, pixels
//! blended.

use crate::plane_sweep::Planes;
use crate::plane_sweep::blend::{self, BlendBlock};
use crate::plane_sweep::census;
use crate::plane_sweep::consistency::{self, ConfirmBlock};
use crate::plane_sweep::disparity;
use crate::plane_sweep::evidence::{self, ViewPair};
use crate::plane_sweep::front::{self, Front, FrontBlock};
use crate::plane_sweep::frustum::{FrustumBlock, SweptView};
use crate::plane_sweep::path::{self, CostBlock, LINES_TOGETHER, Line};
use crate::plane_sweep::window::{self, WindowBlock};
use crate::store::Store;
use viewfuse_core::fetch::Fetch;

/// What the views show on a group of planes of a pixel of the band.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn compare_views(
    block: &FrustumBlock,
    views: &(impl Fetch<SweptView> + ?Sized),
    pairs: &[ViewPair],
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    grey: &mut (impl Store<Planes> + ?Sized),
    evidence: &mut (impl Store<Planes> + ?Sized),
    group: u32,
) {
    let band = block.row_count * block.camera.width * block.group_count;
    let pixel = block.first_row * block.camera.width + group / block.group_count;
    let found = evidence::evidence(block, views, pairs, texels, disparities, pixel, group % block.group_count);
    let mut view = 0;
    while view < block.view_count {
        grey.store((view * band + group) as usize, found.grey[view as usize]);
        view += 1;
    }
    let at = 4 * group as usize;
    evidence.store(at, found.difference);
    evidence.store(at + 1, found.weight);
    evidence.store(at + 2, found.dissent);
    evidence.store(at + 3, found.hull);
}

/// The costs of a group of planes of a pixel of the band.
#[inline(always)]
pub fn census_cost(
    block: &FrustumBlock,
    pairs: &[ViewPair],
    grey: &[Planes],
    evidence: &[Planes],
    costs: &mut (impl Store<Planes> + ?Sized),
    group: u32,
) {
    let (pixel, group_of_pixel) = (group / block.group_count, group % block.group_count);
    let [cost, weight] = census::census_cost(block, pairs, grey, evidence, pixel, group_of_pixel);
    let first = block.first_row * block.camera.width * block.group_count;
    let at = 2 * (first + group) as usize;
    costs.store(at, cost);
    costs.store(at + 1, weight);
}

/// Costs summed over a row's part of the windows around a group of planes of a pixel.
#[inline(always)]
pub fn row_sums(block: &WindowBlock, costs: &[Planes], sums: &mut (impl Store<Planes> + ?Sized), group: u32) {
    let found = window::row_sums(block, costs, group / block.group_count, group % block.group_count);
    let mut window = 0;
    while window < 3 {
        let at = 6 * group as usize + 2 * window;
        sums.store(at, found[window][0]);
        sums.store(at + 1, found[window][1]);
        window += 1;
    }
}

/// The cost of a group of planes of a pixel, averaged over the windows.
#[inline(always)]
pub fn window_cost(block: &WindowBlock, sums: &[Planes], means: &mut (impl Store<Planes> + ?Sized), group: u32) {
    let mean = window::window_cost(block, sums, group / block.group_count, group % block.group_count);
    means.store(group as usize, mean);
}

/// How opaque a group of planes of a pixel is.
#[inline(always)]
pub fn plane_opacity(
    block: &FrustumBlock,
    views: &(impl Fetch<SweptView> + ?Sized),
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    opacities: &mut (impl Store<Planes> + ?Sized),
    group: u32,
) {
    let (pixel, group_of_pixel) = (group / block.group_count, group % block.group_count);
    opacities.store(group as usize, front::plane_opacity(block, views, disparities, pixel, group_of_pixel));
}

/// The costs of a pixel's planes, with the preference for the first opaque one.
#[inline(always)]
pub fn front_cost(
    block: &FrontBlock,
    opacities: &(impl Fetch<Planes> + ?Sized),
    means: &(impl Fetch<Planes> + ?Sized),
    costs: &mut (impl Store<Planes> + ?Sized),
    pixel: u32,
) {
    let mut front = Front::START;
    let mut group = block.group_count;
    while group > 0 {
        group -= 1;
        let joined = front.advance(block, opacities, means, pixel, group);
        costs.store((pixel * block.group_count + group) as usize, joined);
    }
}

/// The joined costs of some lines.
#[inline(always)]
pub fn follow_paths(
    block: &CostBlock,
    means: &(impl Fetch<Planes> + ?Sized),
    paths: &mut (impl Store<Planes> + ?Sized),
    lines: u32,
) {
    let (mut line, end) = (lines * LINES_TOGETHER, (lines + 1) * LINES_TOGETHER);
    while line < end && line < block.line_count() {
        follow_path(block, means, paths, line);
        line += 1;
    }
}

/// The joined costs of a line.
#[inline(always)]
fn follow_path(
    block: &CostBlock,
    means: &(impl Fetch<Planes> + ?Sized),
    paths: &mut (impl Store<Planes> + ?Sized),
    line: u32,
) {
    let groups = block.group_count as usize;
    let first = block.first_of_line(line);
    let (direction, number, step_count) = block.line(line);
    let mut state = Line::START;
    let mut step = 0;
    while step < step_count {
        state.advance(means, block.pixel(direction, number, step) as usize * groups, groups);
        let mut group = 0;
        while group < groups {
            paths.store(first + step as usize * groups + group, state.costs(group));
            group += 1;
        }
        step += 1;
    }
}

/// The cost of a group of planes of a pixel: the mean of the directions' costs.
#[inline(always)]
pub fn join_paths(block: &CostBlock, paths: &[Planes], costs: &mut (impl Store<Planes> + ?Sized), group: u32) {
    let cost = path::joined_cost(block, paths, group / block.group_count, group % block.group_count);
    costs.store(group as usize, cost);
}

/// Disparity and confidence of a pixel of a view.
#[inline(always)]
pub fn pick_disparity(
    block: &FrustumBlock,
    costs: &[Planes],
    disparities: &mut (impl Store<[f32; 2]> + ?Sized),
    pixel: u32,
) {
    let picked = disparity::pick_disparity(block, costs, pixel);
    disparities.store((block.camera.first_texel + pixel) as usize, picked);
}

/// Disparity and confidence of a pixel of a view, by what other views say of it.
#[inline(always)]
pub fn confirm_disparities(
    block: &ConfirmBlock,
    others: &(impl Fetch<SweptView> + ?Sized),
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    confirmed: &mut (impl Store<[f32; 2]> + ?Sized),
    pixel: u32,
) {
    let found = consistency::confirmed(block, others, disparities, pixel);
    confirmed.store((block.camera.first_texel + pixel) as usize, found);
}

/// A pixel of the target, blended from the planes.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
pub fn blend_planes(
    block: &BlendBlock,
    views: &(impl Fetch<SweptView> + ?Sized),
    texels: &(impl Fetch<[f32; 4]> + ?Sized),
    disparities: &(impl Fetch<[f32; 2]> + ?Sized),
    costs: &(impl Fetch<Planes> + ?Sized),
    colours: &mut (impl Store<[f32; 4]> + ?Sized),
    pixel_depths: &mut (impl Store<f32> + ?Sized),
    confidences: &mut (impl Store<f32> + ?Sized),
    pixel: u32,
) {
    let width = block.target.width;
    let at = [(pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5];
    let seen = blend::blend(block, views, texels, disparities, costs, at);
    colours.store(pixel as usize, seen.colour);
    pixel_depths.store(pixel as usize, seen.depth);
    confidences.store(pixel as usize, seen.confidence);
}
