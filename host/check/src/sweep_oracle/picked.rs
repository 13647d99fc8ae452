//! A source pixel's disparity.

use super::disparity;
use crate::bounded::Bounded;
use viewfuse_kernels::plane_sweep::Planes;
use viewfuse_kernels::plane_sweep::disparity::{DOUBT_WIDTH, DOUBTFUL_COST, NEAR_PLANES, TEMPERATURE};
use viewfuse_kernels::plane_sweep::frustum::FrustumBlock;

/// The logistic step from 1 at small costs to 0 at large ones.
pub(super) fn logistic(cost: Bounded, middle: f32, width: f32) -> Bounded {
    let exponent = ((cost - middle.into()) / width.into()).lesser(80.0.into());
    Bounded::ONE / (Bounded::ONE + exponent.exp())
}

/// Disparity and confidence of a pixel, from `costs[row][column][group]`.
pub fn pick_disparity(frustum: &FrustumBlock, costs: &[Planes], pixel: u32) -> [Option<Bounded>; 2] {
    let groups = frustum.group_count as usize;
    let costs = costs[pixel as usize * groups..][..groups].as_flattened();
    let least = costs.iter().copied().fold(f32::MAX, f32::min);
    // Costs are given, so that which one is the least is not a matter of rounding; of equal ones the farthest.
    let best = costs.iter().position(|cost| *cost == least).unwrap_or(0);
    let least = Bounded::from(least);
    let shares: Vec<Bounded> =
        costs.iter().map(|cost| ((least - Bounded::from(*cost)) / Bounded::from(TEMPERATURE)).exp()).collect();
    let sum = |shares: &[Bounded]| shares.iter().fold(Bounded::ZERO, |sum, share| sum + *share);
    let near = sum(&shares[best.saturating_sub(NEAR_PLANES)..(best + NEAR_PLANES + 1).min(shares.len())]);
    let confidence = near / sum(&shares) * logistic(least, DOUBTFUL_COST, DOUBT_WIDTH);
    let plane = disparity(frustum.far_disparity, frustum.disparity_step, best);
    let offset = match (best.checked_sub(1).map(|before| costs[before]), costs.get(best + 1)) {
        (Some(before), Some(after)) => vertex(before.into(), least, (*after).into()),
        _ => Some(Bounded::ZERO),
    };
    let moved = offset.map(|offset| (plane + offset * Bounded::from(frustum.disparity_step)).greater(Bounded::ZERO));
    [moved, Some(confidence)]
}

/// The vertex of the parabola through three costs of which the middle one is the least, in planes.
fn vertex(before: Bounded, least: Bounded, after: Bounded) -> Option<Bounded> {
    let curvature = (before - least) + (after - least);
    if !Bounded::from(1.0e-9).below(curvature)? {
        return Some(Bounded::ZERO);
    }
    Some((Bounded::from(0.5) * (before - after) / curvature).clamped(-0.5, 0.5))
}
