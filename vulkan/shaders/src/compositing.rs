//! Fusion of views, compositing of samples.

use crate::Push;
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::composite::{CompositeBlock, composite_samples};
use viewfuse_core::fetch::StartingAt;
use viewfuse_core::fuse::{FuseBlock, fuse_element};

/// The weighted sum over the views of channel number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "fuse_views"))]
pub fn fuse_views(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FuseBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] latents: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] fused: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    let block = &push.parameters;
    let weights = StartingAt { all: weights, first: block.first_weight(element) };
    fused[element] = fuse_element(&weights, &StartingAt { all: latents, first: element }, block);
}

/// The pixel of ray number `first + id.x` from its samples.
#[spirv(compute(threads(64), entry_point_name = "composite"))]
pub fn composite(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<CompositeBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] samples: &[[f32; 4]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] sample_depths: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] colours: &mut [[f32; 4]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] depths: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let ray = (push.piece.first + id.x) as usize;
    let first = ray * push.parameters.sample_count as usize;
    let seen = composite_samples(
        &StartingAt { all: samples, first },
        &StartingAt { all: sample_depths, first },
        &push.parameters,
    );
    colours[ray] = [seen.channels[0], seen.channels[1], seen.channels[2], seen.opacity];
    depths[ray] = seen.depth;
}
