//! The inputs of PixelNeRF's network at points, and radiance from its outputs.

use crate::loads::{CameraWords, Cameras, PointWords, Points};
use crate::{Piece, Push};
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::fetch::{Fetch, StartingAt};
use viewfuse_core::half_precision::Halves;
use viewfuse_kernels::pixelnerf::{self, EmbedBlock, GatherBlock, GridPlace};

/// Feature number `first + id.x`, flat in `[view][point][feature]`.
#[spirv(compute(threads(64), entry_point_name = "embed_points"))]
pub fn embed_points(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<EmbedBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[PointWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] embedded: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    embedded[element] = pixelnerf::embedded_value(&Cameras(views), &Points(points), &push.parameters, element);
}

/// Weight number `first + id.x`, flat in `[point][view]`; the parameter is how many views there are.
#[spirv(compute(threads(64), entry_point_name = "visible_weights"))]
pub fn visible_weights(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] points: &[PointWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] visible: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let view_count = push.parameters;
    let element = push.piece.first + id.x;
    let point = Points(points).fetch((element / view_count) as usize);
    visible[element as usize] =
        pixelnerf::visible_weight(&Cameras(views), weights, view_count, &point, element % view_count);
}

/// Four channels, number `first + id.x` of a view's part of the latents, flat in `[point][four of channels]`.
#[spirv(compute(threads(64), entry_point_name = "gather_latents"))]
#[allow(clippy::too_many_arguments)]
pub fn gather_latents(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<GatherBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[PointWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] grid: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] gathered: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    gather_four(push, id, views, points, grid, residual, gathered);
}

/// As [`gather_latents`], from a grid in half precision.
#[spirv(compute(threads(64), entry_point_name = "gather_latents_f16"))]
#[allow(clippy::too_many_arguments)]
pub fn gather_latents_f16(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<GatherBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[PointWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] grid: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] residual: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] gathered: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    gather_four(push, id, views, points, &Halves(grid), residual, gathered);
}

/// Four channels of a point, with the residual if there is one.
#[inline(always)]
fn gather_four(
    push: &Push<GatherBlock>,
    id: UVec3,
    views: &[CameraWords],
    points: &[PointWords],
    grid: &(impl Fetch<f32> + ?Sized),
    residual: &[f32],
    gathered: &mut [f32],
) {
    let block = &push.parameters;
    let element = push.piece.first + id.x;
    let (point, four) = (element / block.four_count(), element % block.four_count());
    let place = GridPlace::of(&Cameras(views).fetch(block.view as usize), &Points(points).fetch(point as usize), block);
    let row = block.first() + (point * block.channel_count) as usize;
    let mut channel = 4 * four;
    while channel < block.channel_count && channel < 4 * four + 4 {
        let value = place.value(grid, channel as usize);
        let at = row + channel as usize;
        gathered[at] = if block.has_residual != 0 { residual[at] + value } else { value };
        channel += 1;
    }
}

/// Radiance of point number `first + id.x`, stored at the point's sample.
#[spirv(compute(threads(64), entry_point_name = "radiance"))]
pub fn radiance(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] piece: &Piece,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] raw: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[PointWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] samples: &mut [[f32; 4]],
) {
    if id.x >= piece.count {
        return;
    }
    let element = (piece.first + id.x) as usize;
    let point = Points(points).fetch(element);
    let raw = StartingAt { all: raw, first: element * 4 };
    samples[point.sample as usize] = pixelnerf::radiance(&raw, &point);
}
