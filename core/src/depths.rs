//! Depth samples along rays.
//!
//! Depths are distances along the ray in world units. NeRF's two kinds: stratified (one jittered sample in each of `N`
//! equal parts of the interval) and importance samples by inverting the distribution that a first pass found; and
//! PixelNeRF's third: samples around the depth that the first pass found.

use crate::fetch::Fetch;
use crate::math::clamp;
use crate::random::{normal, uniform_from, uniform_pair};
use crate::rays::TargetRay;
use bytemuck::{Pod, Zeroable};

/// The sample in part `part` of `count` equal parts of `[near, far]`, at the fraction `jitter` in `[0, 1]` of its part
/// (0.5: the middle). The result never leaves `[near, far]`; `count` 0 is taken as 1.
#[inline]
pub fn stratified_depth(near: f32, far: f32, part: u32, count: u32, jitter: f32) -> f32 {
    let fraction = (part as f32 + jitter) / count.max(1) as f32;
    clamp(near + (far - near) * fraction, near, far)
}

/// Added to every coarse weight, so that no part of the ray has probability 0 (as in NeRF).
pub const PROBABILITY_FLOOR: f32 = 1.0e-5;

/// The depth at which the distribution given by `weights` over `N` equal parts of `[near, far]` reaches `u`.
///
/// Within a part the distribution is uniform. Negative and NaN weights count as 0, weights above 1e30 as 1e30. `u` is
/// limited to `[0, 1]`. The cumulative sum is compared with `u` times its own total, so the result never leaves
/// `[near, far]` (in the published code a sum that rounds below 1 puts samples beyond `far`). Increasing in `u`.
#[inline]
pub fn inverse_cdf<const N: usize>(near: f32, far: f32, weights: &[f32; N], u: f32) -> f32 {
    const { assert!(N > 0) };
    let (part, inside) = part_at(weights, N, u);
    stratified_depth(near, far, part as u32, N as u32, inside)
}

/// The part, of `count` parts of these weights, in which their distribution reaches `u`, and the share of the part
/// below.
#[inline]
fn part_at(weights: &(impl Fetch<f32> + ?Sized), count: usize, u: f32) -> (usize, f32) {
    let mut total = 0.0;
    let mut part = 0;
    while part < count {
        total += mass_of(weights.fetch(part));
        part += 1;
    }
    let wanted = clamp(u, 0.0, 1.0) * total;
    let mut below = 0.0;
    part = 0;
    let mut mass = mass_of(weights.fetch(0));
    while part + 1 < count && below + mass <= wanted {
        below += mass;
        part += 1;
        mass = mass_of(weights.fetch(part));
    }
    (part, clamp((wanted - below) / mass, 0.0, 1.0))
}

/// Probability of a part before normalising; bounded, so that sums stay finite.
#[inline]
fn mass_of(weight: f32) -> f32 {
    clamp(weight, 0.0, 1.0e30) + PROBABILITY_FLOOR
}

/// A dispatch of [`coarse_depth`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct CoarseBlock {
    /// Low and high word of the seed.
    pub seed: [u32; 2],
    /// Samples on each ray.
    pub sample_count: u32,
    /// Jitter of a sample in its part: 0 puts it at the middle, 1 anywhere in the part.
    pub jitter: f32,
}

/// Depth of sample number `sample` on the ray of a pixel: one in each of `sample_count` equal parts.
#[inline]
pub fn coarse_depth(ray: &TargetRay, pixel: u32, sample: u32, block: &CoarseBlock) -> f32 {
    let inside = 0.5 + block.jitter * (uniform_from(block.seed, pixel, sample) - 0.5);
    stratified_depth(ray.near, ray.far, sample, block.sample_count, inside)
}

/// A dispatch of [`random_draw`] or [`fine_depth`], as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct FineBlock {
    /// Low and high word of the seed.
    pub seed: [u32; 2],
    /// Samples on each ray of the first pass: equal parts.
    pub coarse_count: u32,
    /// Samples placed by the weights of the first pass.
    pub importance_count: u32,
    /// Samples placed around the depth of the first pass.
    pub depth_count: u32,
    /// Standard deviation of those, world units.
    pub depth_deviation: f32,
    /// 1: around the sum of weights times depths, as published, which is too near where a ray is not opaque; 0: around
    /// their mean.
    pub depth_times_opacity: u32,
}

impl FineBlock {
    /// Samples that the second pass adds on each ray.
    #[inline]
    pub fn fine_count(&self) -> u32 {
        self.importance_count + self.depth_count
    }
}

/// The random numbers that place fine sample `index` of a pixel's ray: for importance samples where in the distribution
/// (one in each of as many equal parts as there are samples, in `[0, 1]`: the sum may round up) and where in the part
/// that it hits, in `[0, 1)`; for depth samples a normal number and 0. A ray has fewer than 2^32 samples.
#[inline]
pub fn random_draw(pixel: u32, index: u32, block: &FineBlock) -> [f32; 2] {
    let counter = block.coarse_count + index;
    if index < block.importance_count {
        let [first, second] = uniform_pair(block.seed, pixel, counter);
        [(index as f32 + first) / block.importance_count as f32, second]
    } else {
        [normal(block.seed, pixel, counter), 0.0]
    }
}

/// Depth of fine sample `index` on a ray, limited to the ray's near and far bounds. Importance samples come first: they
/// lie in the coarse part in which the distribution of `seen[part]` (weight, transmittance) reaches the first random
/// number, at the fraction that the second one gives. Then depth samples: normally distributed around `depth`, the mean
/// depth of the first pass on a ray of this `opacity`. Where that is NaN they lie at `near`. There is at least one coarse
/// part, with its number in `seen`.
#[inline]
pub fn fine_depth(
    seen: &(impl Fetch<[f32; 2]> + ?Sized),
    ray: &TargetRay,
    depth: f32,
    opacity: f32,
    draw: [f32; 2],
    index: u32,
    block: &FineBlock,
) -> f32 {
    if index < block.importance_count {
        let (part, _) = part_at(&FirstOf(seen), block.coarse_count as usize, draw[0]);
        return stratified_depth(ray.near, ray.far, part as u32, block.coarse_count, draw[1]);
    }
    let centre = if block.depth_times_opacity != 0 { depth * opacity } else { depth };
    clamp(centre + draw[0] * block.depth_deviation, ray.near, ray.far)
}

/// The first numbers of pairs.
struct FirstOf<'a, F: ?Sized>(&'a F);

impl<F: Fetch<[f32; 2]> + ?Sized> Fetch<f32> for FirstOf<'_, F> {
    #[inline(always)]
    fn fetch(&self, index: usize) -> f32 {
        self.0.fetch(index)[0]
    }
}

/// Depth number `index` of a ray's coarse and fine depths behind one another, and its place when all are sorted. Equal
/// depths keep their order. A depth that is NaN has no place of its own.
#[inline]
pub fn merged_depth(
    coarse: &(impl Fetch<f32> + ?Sized),
    fine: &(impl Fetch<f32> + ?Sized),
    coarse_count: u32,
    fine_count: u32,
    index: u32,
) -> (f32, u32) {
    let at = |index: u32| {
        if index < coarse_count { coarse.fetch(index as usize) } else { fine.fetch((index - coarse_count) as usize) }
    };
    let depth_here = at(index);
    let (mut place, mut other) = (0, 0);
    while other < coarse_count + fine_count {
        let depth = at(other);
        if depth < depth_here || (depth == depth_here && other < index) {
            place += 1;
        }
        other += 1;
    }
    (depth_here, place)
}
