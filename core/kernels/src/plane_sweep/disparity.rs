//! A source pixel's disparity: the plane of least cost, and its confidence.

use super::frustum::FrustumBlock;
use super::{MAX_GROUPS, MAX_PLANES, PLANES, Planes, least_of, lessen};
use viewfuse_core::math::{clamp, exp, max, min};

/// Temperature of the softmax over planes.
pub const TEMPERATURE: f32 = 0.008;
/// Planes to each side of the best one that count as the same disparity.
pub const NEAR_PLANES: usize = 3;
/// A cost at which a match is as likely wrong as right.
pub const DOUBTFUL_COST: f32 = 0.12;
/// Width of the logistic step of the confidence, in cost.
pub const DOUBT_WIDTH: f32 = 0.02;

/// Disparity and confidence in `[0, 1]` of a pixel, from `costs[row][column][group]`. The disparity is that of the
/// plane of least cost, moved to the vertex of the parabola through it and its neighbours; the confidence is the share
/// of the softmax within [`NEAR_PLANES`] of it, times a logistic step on the least cost. Of equal costs the farthest
/// plane's is the least. The softmax is summed over the groups for each place in a group, then over the places.
#[inline(always)]
pub fn pick_disparity(frustum: &FrustumBlock, costs: &[Planes], pixel: u32) -> [f32; 2] {
    let groups = frustum.group_count as usize;
    let first = pixel as usize * groups;
    let plane_count = groups * PLANES;
    let cost = |plane: usize| costs[first + plane / PLANES][plane % PLANES];
    let least = least_cost(costs, first, groups);
    let best = first_plane_of(costs, first, groups, least);
    let (mut near, mut all) = ([0.0; PLANES], [0.0; PLANES]);
    let mut group = 0;
    while group < groups {
        let cost = &costs[first + group];
        let mut plane = 0;
        while plane < PLANES {
            let share = exp((least - cost[plane]) * (1.0 / TEMPERATURE));
            let away = (group * PLANES + plane) as i32 - best as i32;
            let is_near = (away >= -(NEAR_PLANES as i32)) & (away <= NEAR_PLANES as i32);
            all[plane] += share;
            near[plane] += if is_near { share } else { 0.0 };
            plane += 1;
        }
        group += 1;
    }
    let (near, all) = (sum(&near), sum(&all));
    let mut offset = 0.0;
    if best > 0 && best + 1 < plane_count {
        let (before, after) = (cost(best - 1), cost(best + 1));
        let curvature = (before - least) + (after - least);
        if curvature > 1.0e-9 {
            offset = clamp(0.5 * (before - after) / curvature, -0.5, 0.5);
        }
    }
    let sure = 1.0 / (1.0 + exp(min((least - DOUBTFUL_COST) / DOUBT_WIDTH, 80.0)));
    [max(frustum.disparity(best) + offset * frustum.disparity_step, 0.0), near / all * sure]
}

/// The least cost of a pixel's planes.
#[inline(always)]
fn least_cost(costs: &[Planes], first: usize, groups: usize) -> f32 {
    let mut least = [f32::MAX; PLANES];
    let mut group = 0;
    while group < groups {
        lessen(&mut least, &costs[first + group]);
        group += 1;
    }
    least_of(&least)
}

/// The first of a pixel's planes whose cost is this.
#[inline(always)]
fn first_plane_of(costs: &[Planes], first: usize, groups: usize, least: f32) -> usize {
    let mut found = [MAX_PLANES as i32; PLANES];
    let mut group = groups;
    while group > 0 {
        group -= 1;
        let cost = &costs[first + group];
        let mut plane = 0;
        while plane < PLANES {
            found[plane] = if cost[plane] == least { (group * PLANES + plane) as i32 } else { found[plane] };
            plane += 1;
        }
    }
    let mut of_all = MAX_PLANES as i32;
    let mut plane = 0;
    while plane < PLANES {
        of_all = if found[plane] < of_all { found[plane] } else { of_all };
        plane += 1;
    }
    // Where no cost is a number.
    if of_all < MAX_PLANES as i32 { of_all as usize } else { 0 }
}

#[inline(always)]
fn sum(planes: &Planes) -> f32 {
    let mut sum = 0.0;
    let mut plane = 0;
    while plane < PLANES {
        sum += planes[plane];
        plane += 1;
    }
    sum
}

const _: () = assert!(MAX_GROUPS * PLANES == MAX_PLANES);
