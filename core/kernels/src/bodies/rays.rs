//! Target rays, samples along them, their weights, and the pixels that they make.

use crate::sample_mask::{self, RaysBlock, SampleMaskBlock};
use crate::store::Store;
use viewfuse_core::composite::{CompositeBlock, composite_samples};
use viewfuse_core::depths::{self, CoarseBlock, FineBlock};
use viewfuse_core::fetch::StartingAt;
use viewfuse_core::rays::{self, CastBlock, PlaceBlock, RayPoint, TargetRay};

/// A ray.
#[inline]
pub fn cast_rays(block: &CastBlock, pixels: &[u32], rays: &mut (impl Store<TargetRay> + ?Sized), ray: u32) {
    rays.store(ray as usize, rays::cast_ray(block, pixels[ray as usize]));
}

/// The depth of a coarse sample.
#[inline]
pub fn coarse_depths(
    block: &CoarseBlock,
    rays: &[TargetRay],
    pixels: &[u32],
    depths: &mut (impl Store<f32> + ?Sized),
    sample: u32,
) {
    let ray = (sample / block.sample_count) as usize;
    depths.store(sample as usize, depths::coarse_depth(&rays[ray], pixels[ray], sample % block.sample_count, block));
}

/// A point of the list of samples.
#[inline]
pub fn place_points(
    block: &PlaceBlock,
    samples: &[u32],
    rays: &[TargetRay],
    depths: &[f32],
    points: &mut (impl Store<RayPoint> + ?Sized),
    point: u32,
) {
    points.store(point as usize, rays::place_point(rays, depths, block.sample_count, block.sample(samples, point)));
}

/// The pixel of a ray, from its samples.
#[inline]
pub fn composite(
    block: &CompositeBlock,
    samples: &[[f32; 4]],
    sample_depths: &[f32],
    colours: &mut (impl Store<[f32; 4]> + ?Sized),
    depths: &mut (impl Store<f32> + ?Sized),
    ray: u32,
) {
    let first = (ray * block.sample_count) as usize;
    let seen = composite_samples(&StartingAt { all: samples, first }, &StartingAt { all: sample_depths, first }, block);
    colours.store(ray as usize, [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity]);
    depths.store(ray as usize, seen.depth);
}

/// Weights and transmittances of the samples on a ray.
#[inline]
pub fn weigh_samples(block: &RaysBlock, samples: &[[f32; 4]], seen: &mut (impl Store<[f32; 2]> + ?Sized), ray: u32) {
    let RaysBlock { sample_count, first_ray } = *block;
    let mut optical_depth = 0.0;
    let mut sample = 0;
    while sample < sample_count {
        let at = (ray * sample_count + sample) as usize;
        let (weighed, sum) = sample_mask::weigh_sample(optical_depth, samples[at][3]);
        seen.store(at + (first_ray * sample_count) as usize, weighed);
        optical_depth = sum;
        sample += 1;
    }
}

/// The random draws of a fine sample.
#[inline]
pub fn random_draws(block: &FineBlock, pixels: &[u32], draws: &mut (impl Store<[f32; 2]> + ?Sized), sample: u32) {
    let pixel = pixels[(sample / block.fine_count()) as usize];
    draws.store(sample as usize, depths::random_draw(pixel, sample % block.fine_count(), block));
}

/// The depth of a fine sample.
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn fine_depths(
    block: &FineBlock,
    seen: &[[f32; 2]],
    rays: &[TargetRay],
    colours: &[[f32; 4]],
    pixel_depths: &[f32],
    draws: &[[f32; 2]],
    depths: &mut (impl Store<f32> + ?Sized),
    sample: u32,
) {
    let (ray, index) = ((sample / block.fine_count()) as usize, sample % block.fine_count());
    let (centre, opacity) = (pixel_depths[ray], colours[ray][3]);
    let seen = StartingAt { all: seen, first: ray * block.coarse_count as usize };
    let draw = draws[sample as usize];
    depths.store(sample as usize, depths::fine_depth(&seen, &rays[ray], centre, opacity, draw, index, block));
}

/// A coarse or fine sample, at its place among those of its ray.
#[inline]
pub fn merge_depths(
    block: &FineBlock,
    coarse: &[f32],
    fine: &[f32],
    merged: &mut (impl Store<f32> + ?Sized),
    sample: u32,
) {
    let (coarse_count, fine_count) = (block.coarse_count, block.fine_count());
    let count = coarse_count + fine_count;
    let (ray, index) = (sample / count, sample % count);
    let coarse = StartingAt { all: coarse, first: (ray * coarse_count) as usize };
    let fine = StartingAt { all: fine, first: (ray * fine_count) as usize };
    let (depth, place) = depths::merged_depth(&coarse, &fine, coarse_count, fine_count, index);
    merged.store((ray * count + place) as usize, depth);
}

/// Whether a sample is in the mask: 1 or 0.
#[inline]
pub fn sample_mask(
    block: &SampleMaskBlock,
    seen: &[[f32; 2]],
    rays: &[TargetRay],
    pixels: &[u32],
    depths: &[f32],
    mask: &mut (impl Store<u32> + ?Sized),
    sample: u32,
) {
    let ray = sample / block.sample_count;
    let (at, depth) = (ray as usize, depths[sample as usize]);
    let is_sampled = sample_mask::is_sampled(seen, &rays[at], depth, ray, pixels[at], block);
    mask.store(sample as usize, is_sampled as u32);
}
