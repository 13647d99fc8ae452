//! The inputs of PixelNeRF's network at points, and radiance from its outputs.

use crate::{Piece, Push};
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pages::StartingAt;
use viewfuse_core::pixelnerf::{self, EmbedBlock, GatherBlock};
use viewfuse_core::rays::RayPoint;

/// Feature number `first + id.x`, flat in `[view][point][feature]`.
#[spirv(compute(threads(64), entry_point_name = "embed_points"))]
pub fn embed_points(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<EmbedBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraBlock],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[RayPoint],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] embedded: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    embedded[element] = pixelnerf::embedded_value(views, points, &push.parameters, element);
}

/// Weight number `first + id.x`, flat in `[point][view]`; the parameter is how many views there are.
#[spirv(compute(threads(64), entry_point_name = "visible_weights"))]
pub fn visible_weights(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraBlock],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] points: &[RayPoint],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] visible: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let view_count = push.parameters;
    let element = push.piece.first + id.x;
    let point = &points[(element / view_count) as usize];
    visible[element as usize] = pixelnerf::visible_weight(views, weights, view_count, point, element % view_count);
}

/// Channel number `first + id.x` of a view's part of the latents, flat in `[point][channel]`.
#[spirv(compute(threads(64), entry_point_name = "gather_latents"))]
#[allow(clippy::too_many_arguments)]
pub fn gather_latents(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<GatherBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraBlock],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[RayPoint],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] grid: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] gathered: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = (push.piece.first + id.x) as usize;
    let residual = StartingAt { all: residual, first: block.first() };
    gathered[block.first() + element] = pixelnerf::gathered_value(views, points, grid, &residual, block, element);
}

/// Radiance of point number `first + id.x`, stored at the point's sample.
#[spirv(compute(threads(64), entry_point_name = "radiance"))]
pub fn radiance(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] piece: &Piece,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] raw: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[RayPoint],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] samples: &mut [[f32; 4]],
) {
    if id.x >= piece.count {
        return;
    }
    let element = (piece.first + id.x) as usize;
    let point = &points[element];
    let raw = StartingAt { all: raw, first: element * 4 };
    samples[point.sample as usize] = pixelnerf::radiance(&raw, point);
}
