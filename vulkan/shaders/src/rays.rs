//! Target rays, samples along them, and their weights.

use crate::Push;
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::depths::{self, CoarseBlock, FineBlock};
use viewfuse_core::fetch::StartingAt;
use viewfuse_core::rays::{self, CastBlock, PlaceBlock, RayPoint, TargetRay};
use viewfuse_kernels::sample_mask::{self, RaysBlock, SampleMaskBlock};

/// Ray number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "cast_rays"))]
pub fn cast_rays(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<CastBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] pixels: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] rays: &mut [TargetRay],
) {
    if id.x >= push.piece.count {
        return;
    }
    let ray = (push.piece.first + id.x) as usize;
    rays[ray] = rays::cast_ray(&push.parameters, pixels[ray]);
}

/// Depth of coarse sample number `first + id.x`, flat in `[ray][sample]`.
#[spirv(compute(threads(64), entry_point_name = "coarse_depths"))]
pub fn coarse_depths(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<CoarseBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] rays: &[TargetRay],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] pixels: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] depths: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = push.piece.first + id.x;
    let ray = (element / block.sample_count) as usize;
    depths[element as usize] = depths::coarse_depth(&rays[ray], pixels[ray], element % block.sample_count, block);
}

/// Point number `first + id.x` of a list of samples.
#[spirv(compute(threads(64), entry_point_name = "place_points"))]
pub fn place_points(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<PlaceBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] samples: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] rays: &[TargetRay],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] depths: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] points: &mut [RayPoint],
) {
    if id.x >= push.piece.count {
        return;
    }
    let (block, point) = (&push.parameters, push.piece.first + id.x);
    points[point as usize] = rays::place_point(rays, depths, block.sample_count, block.sample(samples, point));
}

/// Weights and transmittances of the samples on ray number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "weigh_samples"))]
pub fn weigh_samples(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<RaysBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] samples: &[[f32; 4]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] seen: &mut [[f32; 2]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let RaysBlock { sample_count, first_ray } = push.parameters;
    let ray = push.piece.first + id.x;
    let mut optical_depth = 0.0;
    let mut sample = 0;
    while sample < sample_count {
        let at = (ray * sample_count + sample) as usize;
        let (weighed, sum) = sample_mask::weigh_sample(optical_depth, samples[at][3]);
        seen[at + (first_ray * sample_count) as usize] = weighed;
        optical_depth = sum;
        sample += 1;
    }
}

/// Random draws of fine sample number `first + id.x`, flat in `[ray][sample]`.
#[spirv(compute(threads(64), entry_point_name = "random_draws"))]
pub fn random_draws(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FineBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] pixels: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] draws: &mut [[f32; 2]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = push.piece.first + id.x;
    let pixel = pixels[(element / block.fine_count()) as usize];
    draws[element as usize] = depths::random_draw(pixel, element % block.fine_count(), block);
}

/// Depth of fine sample number `first + id.x`, flat in `[ray][sample]`.
#[spirv(compute(threads(64), entry_point_name = "fine_depths"))]
#[allow(clippy::too_many_arguments)]
pub fn fine_depths(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FineBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] seen: &[[f32; 2]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] rays: &[TargetRay],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] colours: &[[f32; 4]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] pixel_depths: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] draws: &[[f32; 2]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 5)] depths: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = push.piece.first + id.x;
    let (ray, sample) = ((element / block.fine_count()) as usize, element % block.fine_count());
    let (centre, opacity) = (pixel_depths[ray], colours[ray][3]);
    let seen = StartingAt { all: seen, first: ray * block.coarse_count as usize };
    let draw = draws[element as usize];
    depths[element as usize] = depths::fine_depth(&seen, &rays[ray], centre, opacity, draw, sample, block);
}

/// The place of sample number `first + id.x` among the coarse and fine ones of its ray.
#[spirv(compute(threads(64), entry_point_name = "merge_depths"))]
pub fn merge_depths(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FineBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] coarse: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] fine: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] merged: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let (coarse_count, fine_count) = (push.parameters.coarse_count, push.parameters.fine_count());
    let count = coarse_count + fine_count;
    let element = push.piece.first + id.x;
    let (ray, index) = (element / count, element % count);
    let coarse = StartingAt { all: coarse, first: (ray * coarse_count) as usize };
    let fine = StartingAt { all: fine, first: (ray * fine_count) as usize };
    let (depth, place) = depths::merged_depth(&coarse, &fine, coarse_count, fine_count, index);
    merged[(ray * count + place) as usize] = depth;
}

/// Whether sample number `first + id.x`, flat in `[ray][sample]`, is in the mask: 1 or 0.
#[spirv(compute(threads(64), entry_point_name = "sample_mask"))]
#[allow(clippy::too_many_arguments)]
pub fn sample_mask(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<SampleMaskBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] seen: &[[f32; 2]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] rays: &[TargetRay],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] pixels: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] depths: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] mask: &mut [u32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = push.piece.first + id.x;
    let ray = element / block.sample_count;
    let (at, depth) = (ray as usize, depths[element as usize]);
    let is_sampled = sample_mask::is_sampled(seen, &rays[at], depth, ray, pixels[at], block);
    mask[element as usize] = is_sampled as u32;
}
