//! Costs by colour and census, and their means over windows.

use super::{BoundedPlanes, exact};
use crate::bounded::Bounded;
use crate::camera_oracle::window;
use viewfuse_kernels::plane_sweep::census::{
    CENSUS_SHARE, COLOUR_SHARE, CONTRAST, FULL_TEXTURE, GREY_STEPS, MAX_GREY, MIN_TOLD, OUTSIDE_COST, REACH,
    WEIGHT_STEPS,
};
use viewfuse_kernels::plane_sweep::evidence::ViewPair;
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;
use viewfuse_kernels::plane_sweep::window::{PRIOR_COST, PRIOR_WEIGHT, SHARE, WindowBlock};
use viewfuse_kernels::plane_sweep::{PLANES, Planes};

/// Cost of a plane times its weight, and the weight, from the colours' difference and the census of all pairs.
fn cost(frustum: &FrustumBlock, evidence: [f32; 4], census: Bounded, texture: Bounded) -> [Bounded; 2] {
    let [difference, weight, dissent, inside] = evidence.map(Bounded::from);
    let colour = difference / weight.greater(1.0e-6.into());
    let matched = Bounded::from(COLOUR_SHARE) * colour
        + Bounded::from(CENSUS_SHARE) * census
        + Bounded::from(frustum.dissent_share) * dissent;
    let least = Bounded::from(MIN_TOLD);
    let told = least + (Bounded::ONE - least) * (texture / Bounded::from(FULL_TEXTURE)).lesser(Bounded::ONE);
    let (weight, outside) = (weight * told, Bounded::ONE - inside);
    [matched * weight * inside + Bounded::from(OUTSIDE_COST) * outside, weight * inside + outside]
}

/// Costs of a group of planes at a pixel of a band, times their weights, and the weights.
pub fn census_cost(
    frustum: &FrustumBlock,
    pairs: &[ViewPair],
    grey: &[Planes],
    evidence: &[Planes],
    pixel: u32,
    group: u32,
) -> [BoundedPlanes; 2] {
    let (width, groups) = (i64::from(frustum.camera.width), frustum.group_count as usize);
    let slice = (frustum.camera.width * frustum.row_count) as usize * groups;
    let (column, row) = (i64::from(pixel) % width, i64::from(pixel) / width);
    let place = |column: i64, row: i64| (row * width + column) as usize * groups + group as usize;
    let here = place(column, row);
    let reach = i64::from(REACH);
    // Rows above, and what is to the left.
    let window = (-reach..=0).flat_map(|y| (-reach..=reach).map(move |x| (x, y))).filter(|(x, y)| *y < 0 || *x < 0);
    let around: Vec<usize> = window
        .map(|(x, y)| (column + x, row + y))
        .filter(|(x, y)| (0..width).contains(x) && *y >= 0)
        .map(|(x, y)| place(x, y))
        .collect();
    let mut costs = [[Bounded::ZERO; PLANES]; 2];
    for plane in 0..PLANES {
        // Whole numbers, which `f64` holds exactly.
        let grey = |view: u32, at: usize| {
            (f64::from(grey[view as usize * slice + at][plane]) * f64::from(GREY_STEPS)).trunc().min(MAX_GREY.into())
        };
        let lighter = |view: u32, there: usize| {
            let most = f64::from(CONTRAST);
            let difference = (grey(view, here) - grey(view, there)).clamp(-most, most);
            (grey(view, here).min(grey(view, there)) >= 0.0).then_some(difference)
        };
        let (mut sum, mut count, mut texture) = (0.0, 0.0, 0.0);
        for there in &around {
            for pair in pairs {
                let (Some(a), Some(b)) = (lighter(pair.first, *there), lighter(pair.second, *there)) else { continue };
                let share = (f64::from(pair.weight) * f64::from(WEIGHT_STEPS)).trunc();
                sum += share * (a - b).abs().min(CONTRAST.into());
                texture += share * a.abs().max(b.abs());
                count += share;
            }
        }
        // Below 2^24, so exact in `f32`.
        let [sum, texture, count] = [sum, texture, count.max(1.0)].map(|sum: f64| Bounded::from(sum as f32));
        let all = count * Bounded::from(CONTRAST);
        let evidence = [0, 1, 2, 3].map(|part| evidence[4 * here + part][plane]);
        [costs[0][plane], costs[1][plane]] = cost(frustum, evidence, sum / all, texture / all);
    }
    costs
}

/// Sums over a row's parts of the windows: `[window][cost times weight, weight]`.
pub fn row_sums(block: &WindowBlock, costs: &[Planes], pixel: u32, group: u32) -> Vec<BoundedPlanes> {
    let (column, first) = (pixel % block.width, pixel - pixel % block.width);
    let place = |x: u32, part: usize| 2 * ((first + x) * block.group_count + group) as usize + part;
    let sum = |reach: u32, part: usize| {
        let sum = |plane: usize| {
            Bounded::sum(window(column, reach, block.width).map(|x| f64::from(costs[place(x, part)][plane])))
        };
        std::array::from_fn(sum)
    };
    block.reach.into_iter().flat_map(|reach| [sum(reach, 0), sum(reach, 1)]).collect()
}

/// The mean cost over the windows, from sums over rows.
pub fn window_cost(block: &WindowBlock, sums: &[Planes], pixel: u32, group: u32) -> BoundedPlanes {
    let (column, row) = (pixel % block.width, pixel / block.width);
    let plane_count = Bounded::from(block.group_count * PLANES as u32);
    std::array::from_fn(|plane| {
        let number = Bounded::from(group * PLANES as u32 + plane as u32);
        let mut total = Bounded::from(block.near_cost) * number / plane_count;
        for (index, reach) in block.reach.into_iter().enumerate() {
            let rows = window(row, reach, block.height);
            let area = rows.clone().count() * window(column, reach, block.width).count();
            let place = |y: u32| 6 * ((y * block.width + column) * block.group_count + group) as usize + 2 * index;
            let sum = |part: usize| Bounded::sum(rows.clone().map(|y| f64::from(sums[place(y) + part][plane])));
            let prior = Bounded::from(PRIOR_WEIGHT) * Bounded::from(area as u32);
            let mean = (sum(0) + prior * Bounded::from(PRIOR_COST)) / (sum(1) + prior);
            total = total + Bounded::from(SHARE[index]) * mean;
        }
        total
    })
}

/// The mean of four directions' costs.
pub(super) fn mean_of_four(four: [&Planes; 4]) -> BoundedPlanes {
    let four = four.map(exact);
    std::array::from_fn(|plane| {
        let sum = four.iter().fold(Bounded::ZERO, |sum, costs| sum + costs[plane]);
        sum / Bounded::from(4.0)
    })
}
