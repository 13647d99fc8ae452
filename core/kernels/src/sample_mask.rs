//! The sample mask: the samples of a ray at which a network is evaluated. It follows from weights that are known
//! already: of a coarser pass along the same ray, or of neighbouring rays.
//!
//! These are a row `[part]` of weight and transmittance in front of it, over equal parts of a ray.

use bytemuck::{Pod, Zeroable};
use viewfuse_core::fetch::Fetch;
use viewfuse_core::math::{clamp, exp, max};
use viewfuse_core::rays::TargetRay;

/// Weight of a sample, and the transmittance in front of it, as `[weight, transmittance]`; then the optical depth up to
/// and including it. Same arithmetic as [`viewfuse_core::composite::Compositor::add`].
#[inline]
pub fn weigh_sample(optical_depth_before: f32, optical_depth: f32) -> ([f32; 2], f32) {
    let before = exp(-optical_depth_before);
    if !(optical_depth > 0.0) {
        return ([0.0, before], optical_depth_before);
    }
    let sum = optical_depth_before + optical_depth;
    ([before - exp(-sum), before], sum)
}

/// Rays among the samples of more rays, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RaysBlock {
    /// Samples on each ray.
    pub sample_count: u32,
    /// Where the first ray's results go, counted in rays.
    pub first_ray: u32,
}

/// A dispatch of [`is_sampled`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SampleMaskBlock {
    /// Samples on each ray.
    pub sample_count: u32,
    /// Parts of each known ray, at least 1.
    pub part_count: u32,
    /// Samples are in the mask where the same part or a neighbouring one has at least this opacity (its weight over the
    /// transmittance in front of it). 0: everywhere.
    pub least_share: f32,
    /// Samples are in the mask up to one part behind where the transmittance falls to this. Negative: everywhere.
    pub termination: f32,
    /// Samples are in the mask on rays of at least this opacity. 0: on all.
    pub least_opacity: f32,
    /// Pixels from one known ray to the next, in both directions; 0 if every ray is known.
    pub step: u32,
    /// Known rays in a row of the picture.
    pub seen_columns: u32,
    /// Known rays in a column of the picture.
    pub seen_rows: u32,
    /// Width of the picture.
    pub width: u32,
}

/// Whether a sample at `depth` on `ray`, which is number `index` of the rays at hand and belongs to pixel `pixel`, is
/// in the mask: if the ray itself (`step` 0), or one of the four known rays around it, says so by `seen[ray][part]`. A
/// depth outside the near and far bounds counts as the nearer bound, NaN as `near`.
#[inline]
pub fn is_sampled(
    seen: &(impl Fetch<[f32; 2]> + ?Sized),
    ray: &TargetRay,
    depth: f32,
    index: u32,
    pixel: u32,
    block: &SampleMaskBlock,
) -> bool {
    let last_part = block.part_count - 1;
    let share = (depth - ray.near) / (ray.far - ray.near);
    let part = clamp(share * block.part_count as f32, 0.0, last_part as f32) as u32;
    let (first, last) = (part.max(1) - 1, (part + 1).min(last_part));
    if block.step == 0 {
        return says_so(seen, index, first, last, block);
    }
    let (column, row) = (pixel % block.width / block.step, pixel / block.width / block.step);
    let mut corner = 0;
    while corner < 4 {
        let column = (column + corner % 2).min(block.seen_columns - 1);
        let row = (row + corner / 2).min(block.seen_rows - 1);
        if says_so(seen, row * block.seen_columns + column, first, last, block) {
            return true;
        }
        corner += 1;
    }
    false
}

#[inline]
fn says_so(seen: &(impl Fetch<[f32; 2]> + ?Sized), ray: u32, first: u32, last: u32, block: &SampleMaskBlock) -> bool {
    let row = (ray * block.part_count) as usize;
    let [end_weight, end_transmittance] = seen.fetch(row + block.part_count as usize - 1);
    // What rounding leaves below 0 counts as 0 here and below, or a threshold of 0 would leave something out.
    let opacity = max(1.0 - (end_transmittance - end_weight), 0.0);
    let reaches = seen.fetch(row + first as usize)[1] > block.termination;
    if !(opacity >= block.least_opacity) || !reaches {
        return false;
    }
    let mut part = first;
    while part <= last {
        let [weight, transmittance] = seen.fetch(row + part as usize);
        if max(weight, 0.0) >= block.least_share * transmittance {
            return true;
        }
        part += 1;
    }
    false
}
