//! Costs joined along lines.

use super::BoundedPlanes;
use super::costs::mean_of_four;
use crate::bounded::{Bounded, ROUNDING};
use viewfuse_kernels::plane_sweep::path::{CostBlock, JUMP_COST, STEP_COST};
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// The pixels of a line in a direction: right, left, down, up.
fn pixels(block: &CostBlock, direction: u32, number: u32) -> Vec<u32> {
    let across = |step: u32| number * block.width + step;
    let down = |step: u32| step * block.width + number;
    match direction {
        0 => (0..block.width).map(across).collect(),
        1 => (0..block.width).rev().map(across).collect(),
        2 => (0..block.height).map(down).collect(),
        _ => (0..block.height).rev().map(down).collect(),
    }
}

/// The joined costs of a line: `[step][group][plane]`, flat.
///
/// The least of shifted costs changes by no more than they do, and all alike if they do. Errors therefore do not grow
/// with the costs but only by the roundings of each step: the difference of the largest and the least error, `spread`,
/// by twice them, and an error is at most that difference and the step's roundings.
pub fn follow_path(block: &CostBlock, means: &[Planes], direction: u32, number: u32) -> Vec<Bounded> {
    let plane_count = block.group_count as usize * PLANES;
    let (step_cost, jump_cost) = (f64::from(STEP_COST), f64::from(JUMP_COST));
    let mut before = vec![0.0_f64; plane_count];
    let mut spread = 0.0;
    let mut all = Vec::new();
    for pixel in pixels(block, direction, number) {
        let least = before.iter().copied().fold(f64::MAX, f64::min);
        let cost = |plane: usize| {
            let cost = means[pixel as usize * block.group_count as usize + plane / PLANES][plane % PLANES];
            let beside = [plane.wrapping_sub(1), plane + 1].into_iter().filter_map(|plane| before.get(plane));
            let stepped = beside.fold(f64::MAX, |least, cost| (cost + step_cost).min(least));
            f64::from(cost) + before[plane].min(stepped).min(least + jump_cost) - least
        };
        let joined: Vec<f64> = (0..plane_count).map(cost).collect();
        let largest = before.iter().chain(&joined).fold(0.0_f64, |largest, cost| cost.abs().max(largest));
        // A step to a plane, the difference to the least cost, the sum.
        let rounding = 3.0 * ROUNDING * (largest + jump_cost);
        all.extend(joined.iter().map(|cost| Bounded { value: *cost, error: spread + rounding }));
        spread += 2.0 * rounding;
        before = joined;
    }
    all
}

/// The mean of the four directions' costs at a pixel, from `paths[direction][line][step][group]`.
pub fn joined_cost(block: &CostBlock, paths: &[Planes], pixel: u32, group: u32) -> BoundedPlanes {
    let (width, height) = (block.width, block.height);
    let (column, row) = (pixel % width, pixel / width);
    let places = [
        row * width + column,
        row * width + width - 1 - column,
        column * height + row,
        column * height + height - 1 - row,
    ];
    let at = |direction: usize| {
        let before = direction as u32 * width * height;
        &paths[((before + places[direction]) * block.group_count + group) as usize]
    };
    mean_of_four([at(0), at(1), at(2), at(3)])
}
