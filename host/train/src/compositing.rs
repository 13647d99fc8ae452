//! Samples on rays, and their compositing.

use super::operations::{Apply, RectifiedDensity};
use candle_core::{D, Result, Tensor};
use viewfuse_core::rays::{RayPoint, TargetRay, place_point};

/// Depths `[ray][sample]`, one in each of equal parts of a ray, at a given share of the part (a number in `[0, 1)` for
/// ray and sample).
pub(crate) fn coarse_depths(rays: &[TargetRay], count: usize, share: impl Fn(usize, usize) -> f32) -> Vec<f32> {
    let mut depths = Vec::with_capacity(rays.len() * count);
    for (ray, TargetRay { near, far, .. }) in rays.iter().enumerate() {
        let part = (far - near) / count as f32;
        depths.extend((0..count).map(|sample| near + part * (sample as f32 + share(ray, sample))));
    }
    depths
}

/// `depths[ray][sample]` with `more` a ray, drawn where `weights[ray][sample]` of even parts are; sorted.
pub(crate) fn fine_depths(
    rays: &[TargetRay],
    depths: &[f32],
    weights: &[f32],
    more: usize,
    share: impl Fn(usize, usize) -> f32,
) -> Vec<f32> {
    /// Added to every weight, as published, so that no part has probability 0.
    const FLOOR: f32 = 1.0e-5;
    let count = depths.len() / rays.len();
    let mut all = Vec::with_capacity(rays.len() * (count + more));
    for (index, ray) in rays.iter().enumerate() {
        let own = index * count..(index + 1) * count;
        let weights = &weights[own.clone()];
        let total: f32 = weights.iter().map(|weight| weight + FLOOR).sum();
        let part = (ray.far - ray.near) / count as f32;
        let mut row = depths[own].to_vec();
        for draw in 0..more {
            // Stratified: one number in each of `more` equal parts.
            let mut left = total * (draw as f32 + share(index, draw)) / more as f32;
            let mut place = 0;
            while place + 1 < count && left >= weights[place] + FLOOR {
                left -= weights[place] + FLOOR;
                place += 1;
            }
            row.push(ray.near + part * (place as f32 + (left / (weights[place] + FLOOR)).min(1.0)));
        }
        row.sort_by(f32::total_cmp);
        all.extend(row);
    }
    all
}

/// The points of `depths[ray][sample]`.
pub(crate) fn points(rays: &[TargetRay], depths: &[f32]) -> Vec<RayPoint> {
    let count = (depths.len() / rays.len()) as u32;
    (0..depths.len()).map(|sample| place_point(rays, depths, count, sample as u32)).collect()
}

/// Compositing weights of the samples on rays, `[ray][sample]`, from densities (rectified here) and lengths of that
/// shape.
pub(crate) fn weights(densities: &Tensor, lengths: &Tensor) -> Result<Tensor> {
    let rectified = RectifiedDensity { shape: densities.dims().to_vec() };
    let passed = (densities.contiguous()?.apply_op1(Apply(rectified))? * lengths)?.cumsum(D::Minus1)?;
    let behind = passed.neg()?.exp()?;
    let before = behind.narrow(1, 0, behind.dim(1)? - 1)?.pad_with_zeros(1, 1, 0)?;
    // The transmittance in front of the first sample is 1.
    let first =
        Tensor::ones((behind.dim(0)?, 1), behind.dtype(), behind.device())?.pad_with_zeros(1, 0, behind.dim(1)? - 1)?;
    (before + first)? - behind
}
