//! A source pixel's disparity: the plane of least cost, and its confidence.

use super::frustum::FrustumBlock;
use super::{MAX_GROUPS, PLANES, Planes};
use viewfuse_core::math::{clamp, exp, max, min};

/// Temperature of the softmax over planes.
pub const TEMPERATURE: f32 = 0.008;
/// Planes to each side of the best one that count as the same disparity.
pub const NEAR_PLANES: usize = 3;
/// A cost at which a match is as likely wrong as right.
pub const DOUBTFUL_COST: f32 = 0.12;
/// Width of the logistic step of the confidence, in cost.
pub const DOUBT_WIDTH: f32 = 0.02;

/// Disparity and confidence in `[0, 1]` of a pixel, from `costs[row][column][group]`. The disparity is that of the plane of
/// least cost, moved to the vertex of the parabola through it and its neighbours; the confidence is the share of the softmax
/// within [`NEAR_PLANES`] of it, times a logistic step on the least cost.
#[inline(always)]
pub fn pick_disparity(frustum: &FrustumBlock, costs: &[Planes], pixel: u32) -> [f32; 2] {
    let groups = frustum.group_count as usize;
    let first = pixel as usize * groups;
    let plane_count = groups * PLANES;
    let cost = |plane: usize| costs[first + plane / PLANES][plane % PLANES];
    let (mut best, mut least) = (0, f32::MAX);
    let mut plane = 0;
    while plane < plane_count {
        if cost(plane) < least {
            least = cost(plane);
            best = plane;
        }
        plane += 1;
    }
    let (mut near, mut all) = (0.0, 0.0);
    let mut plane = 0;
    while plane < plane_count {
        let share = exp((least - cost(plane)) * (1.0 / TEMPERATURE));
        all += share;
        if plane + NEAR_PLANES >= best && plane <= best + NEAR_PLANES {
            near += share;
        }
        plane += 1;
    }
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

const _: () = assert!(MAX_GROUPS * PLANES == super::MAX_PLANES);
