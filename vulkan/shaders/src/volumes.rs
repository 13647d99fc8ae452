//! Feature images from volumes, and the denoiser's inputs.

use crate::Push;
use crate::loads::{CameraWords, Cameras, PointWords, Points};
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::half_precision;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::genvs::{self, DenoiserInputBlock, FeatureBlock, VolumeBlock};

/// Feature number `first + id.x` of a view's part of the latents, flat in `[point][feature]`.
#[spirv(compute(threads(64), entry_point_name = "gather_volume"))]
pub fn gather_volume(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<VolumeBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[PointWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] volume: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] gathered: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = (push.piece.first + id.x) as usize;
    gathered[block.first() + element] = genvs::volume_value(&Cameras(views), &Points(points), volume, block, element);
}

/// Word number `first + id.x`: two numbers in half precision.
#[spirv(compute(threads(64), entry_point_name = "pack_f16"))]
pub fn pack_f16(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] numbers: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] words: &mut [u32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    words[element] = half_precision::packed_f16(numbers, push.parameters, element);
}

/// Feature number `first + id.x` of a view's part of the latents, flat in `[point][feature]`.
#[spirv(compute(threads(64), entry_point_name = "gather_volume_f16"))]
pub fn gather_volume_f16(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<VolumeBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] views: &[CameraWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[PointWords],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] volume: &[u32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] gathered: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let block = &push.parameters;
    let element = (push.piece.first + id.x) as usize;
    gathered[block.first() + element] =
        genvs::volume_value_f16(&Cameras(views), &Points(points), volume, block, element);
}

/// Weights of the samples on ray number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "weigh_features"))]
pub fn weigh_features(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FeatureBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] raw: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] points: &[RayPoint],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] weights: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let ray = (push.piece.first + id.x) as usize;
    genvs::weigh_features(raw, points, &push.parameters, ray, move |sample, weight| weights[sample] = weight);
}

/// Feature of a ray number `first + id.x`, flat in `[ray][feature]`.
#[spirv(compute(threads(64), entry_point_name = "sum_features"))]
pub fn sum_features(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<FeatureBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] fused: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] raw: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] summed: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let (block, element) = (&push.parameters, (push.piece.first + id.x) as usize);
    let first = (block.first_ray * block.feature_count) as usize;
    summed[first + element] = genvs::summed_feature(weights, fused, raw, block, element);
}

/// Channel of a pixel number `first + id.x`, flat in `[pixel][channel]`.
#[spirv(compute(threads(64), entry_point_name = "denoiser_input"))]
pub fn denoiser_input(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<DenoiserInputBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] noisy: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] condition: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] inputs: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    inputs[element] = genvs::denoiser_input(noisy, condition, &push.parameters, element);
}
