//! Target rays, samples along them, and their weights.

use crate::parallel::{for_each, for_each_row};
use viewfuse_core::depths::{CoarseBlock, FineBlock, coarse_depth, fine_depth, merged_depth, random_draw};
use viewfuse_core::rays::{CastBlock, PlaceBlock, RayPoint, TargetRay, cast_ray, place_point};
use viewfuse_kernels::sample_mask::{RaysBlock, SampleMaskBlock, is_sampled, weigh_sample};

/// Runs a kernel for every sample of every ray, rays in parallel; it gets ray, sample and where to write.
fn for_each_sample<T: Send>(
    ray_count: u32,
    sample_count: u32,
    values: &mut [T],
    kernel: impl Fn(u32, u32, &mut T) + Sync,
) {
    let count = sample_count as usize;
    for_each_row(&mut values[..ray_count as usize * count], count, 1024, |ray, values| {
        for (value, sample) in values.iter_mut().zip(0..) {
            kernel(ray as u32, sample, value);
        }
    });
}

pub(super) fn cast_rays(block: &CastBlock, ray_count: u32, pixels: &[u32], rays: &mut [TargetRay]) {
    for_each(&mut rays[..ray_count as usize], 1024, |ray, value| *value = cast_ray(block, pixels[ray]));
}

pub(super) fn coarse_depths(
    block: &CoarseBlock,
    ray_count: u32,
    rays: &[TargetRay],
    pixels: &[u32],
    depths: &mut [f32],
) {
    for_each_sample(ray_count, block.sample_count, depths, |ray, sample, depth| {
        let ray = ray as usize;
        *depth = coarse_depth(&rays[ray], pixels[ray], sample, block);
    });
}

pub(super) fn random_draws(block: &FineBlock, ray_count: u32, pixels: &[u32], draws: &mut [[f32; 2]]) {
    for_each_sample(ray_count, block.fine_count(), draws, |ray, sample, draw| {
        *draw = random_draw(pixels[ray as usize], sample, block);
    });
}

#[allow(clippy::too_many_arguments)]
pub(super) fn fine_depths(
    block: &FineBlock,
    ray_count: u32,
    seen: &[[f32; 2]],
    rays: &[TargetRay],
    colours: &[[f32; 4]],
    pixel_depths: &[f32],
    draws: &[[f32; 2]],
    depths: &mut [f32],
) {
    for_each_sample(ray_count, block.fine_count(), depths, |ray, sample, depth| {
        let index = ray as usize;
        let draw = draws[index * block.fine_count() as usize + sample as usize];
        let seen = &seen[index * block.coarse_count as usize..];
        let (centre, opacity) = (pixel_depths[index], colours[index][3]);
        *depth = fine_depth(seen, &rays[index], centre, opacity, draw, sample, block);
    });
}

pub(super) fn merge_depths(block: &FineBlock, ray_count: u32, coarse: &[f32], fine: &[f32], merged: &mut [f32]) {
    let (coarse_count, fine_count) = (block.coarse_count as usize, block.fine_count() as usize);
    let count = coarse_count + fine_count;
    for_each_row(&mut merged[..ray_count as usize * count], count, 1024, |ray, merged| {
        let (coarse, fine) = (&coarse[ray * coarse_count..], &fine[ray * fine_count..]);
        for index in 0..count as u32 {
            let (depth, place) = merged_depth(coarse, fine, block.coarse_count, block.fine_count(), index);
            merged[place as usize] = depth;
        }
    });
}

pub(super) fn sample_mask(
    block: &SampleMaskBlock,
    ray_count: u32,
    seen: &[[f32; 2]],
    rays: &[TargetRay],
    pixels: &[u32],
    depths: &[f32],
    mask: &mut [u32],
) {
    for_each_sample(ray_count, block.sample_count, mask, |ray, sample, mask| {
        let index = ray as usize;
        let depth = depths[index * block.sample_count as usize + sample as usize];
        *mask = u32::from(is_sampled(seen, &rays[index], depth, ray, pixels[index], block));
    });
}

pub(super) fn place_points(
    block: &PlaceBlock,
    point_count: u32,
    samples: Option<&[u32]>,
    rays: &[TargetRay],
    depths: &[f32],
    points: &mut [RayPoint],
) {
    let block = PlaceBlock { has_samples: u32::from(samples.is_some()), ..*block };
    for_each(&mut points[..point_count as usize], 1024, |point, value| {
        let sample = block.sample(samples.unwrap_or(&[]), point as u32);
        *value = place_point(rays, depths, block.sample_count, sample);
    });
}

pub(super) fn weigh_samples(block: &RaysBlock, ray_count: u32, samples: &[[f32; 4]], seen: &mut [[f32; 2]]) {
    let count = block.sample_count as usize;
    let seen = &mut seen[block.first_ray as usize * count..][..ray_count as usize * count];
    for_each_row(seen, count, 2048, |ray, seen| {
        let mut optical_depth = 0.0;
        for (seen, sample) in seen.iter_mut().zip(&samples[ray * count..]) {
            (*seen, optical_depth) = weigh_sample(optical_depth, sample[3]);
        }
    });
}
