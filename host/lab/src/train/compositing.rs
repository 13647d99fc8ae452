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

/// Depths `[ray][sample]` of `more` samples a ray, drawn where the `weights[ray][sample]` of `count` even parts are.
pub(crate) fn fine_depths(
    rays: &[TargetRay],
    count: usize,
    weights: &[f32],
    more: usize,
    share: impl Fn(usize, usize) -> f32,
) -> Vec<f32> {
    /// Added to every weight, as published, so that no part has probability 0.
    const FLOOR: f32 = 1.0e-5;
    let mut all = Vec::with_capacity(rays.len() * more);
    for (index, (ray, weights)) in rays.iter().zip(weights.chunks_exact(count)).enumerate() {
        let total: f32 = weights.iter().map(|weight| weight + FLOOR).sum();
        let part = (ray.far - ray.near) / count as f32;
        for draw in 0..more {
            // Stratified: one number in each of `more` equal parts.
            let mut left = total * (draw as f32 + share(index, draw)) / more as f32;
            let mut place = 0;
            while place + 1 < count && left >= weights[place] + FLOOR {
                left -= weights[place] + FLOOR;
                place += 1;
            }
            all.push(ray.near + part * (place as f32 + (left / (weights[place] + FLOOR)).min(1.0)));
        }
    }
    all
}

/// The samples of two passes, each `[object][ray][sample]`, sorted by depth on every ray: their numbers among all
/// samples, the first pass's before the second's, and their depths.
pub(crate) fn merged(first: &[Vec<f32>], second: &[Vec<f32>], ray_count: usize) -> (Vec<u32>, Vec<Vec<f32>>) {
    let [before, behind] = [first, second].map(|pass| pass.first().map_or(0, |depths| depths.len() / ray_count));
    let first_count = first.iter().map(Vec::len).sum::<usize>();
    let mut order = Vec::new();
    let mut merge = |(object, (first, second)): (usize, (&Vec<f32>, &Vec<f32>))| {
        let mut depths = Vec::with_capacity(first.len() + second.len());
        for ray in 0..ray_count {
            let numbered = |depths: &[f32], count: usize, start: usize| -> Vec<(f32, u32)> {
                let number = start + (object * ray_count + ray) * count;
                depths[ray * count..][..count].iter().copied().zip(number as u32..).collect()
            };
            let mut samples = [numbered(first, before, 0), numbered(second, behind, first_count)].concat();
            samples.sort_by(|a, b| a.0.total_cmp(&b.0));
            order.extend(samples.iter().map(|(_, number)| *number));
            depths.extend(samples.iter().map(|(depth, _)| *depth));
        }
        depths
    };
    let depths = first.iter().zip(second).enumerate().map(&mut merge).collect();
    (order, depths)
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
