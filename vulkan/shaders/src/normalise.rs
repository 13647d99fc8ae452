//! Means of images and normalisation by them.

use crate::Push;
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::network::normalise::{self, MeanBlock, NormaliseBlock};

/// The mean of channel number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "channel_means"))]
pub fn channel_means(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<MeanBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] means: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let channel = (push.piece.first + id.x) as usize;
    means[channel] = normalise::channel_mean(inputs, &push.parameters, channel);
}

/// Moments of a group of channels in a part of the image, number `first + id.x`, flat in `[part][group]`.
#[spirv(compute(threads(64), entry_point_name = "part_moments"))]
pub fn part_moments(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<NormaliseBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] parts: &mut [[f32; 2]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    parts[element] = normalise::part_moments(inputs, &push.parameters, element);
}

/// Mean and factor of group number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "merge_moments"))]
pub fn merge_moments(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<NormaliseBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] parts: &[[f32; 2]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] moments: &mut [[f32; 2]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let group = (push.piece.first + id.x) as usize;
    moments[group] = normalise::merged_moments(parts, &push.parameters, group);
}

/// Channel of a pixel number `first + id.x`, flat in `[pixel][channel]`.
#[spirv(compute(threads(64), entry_point_name = "normalise"))]
#[allow(clippy::too_many_arguments)]
pub fn normalise(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<NormaliseBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] moments: &[[f32; 2]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    outputs[element] = normalise::normalised_element(inputs, moments, weights, bias, &push.parameters, element);
}
