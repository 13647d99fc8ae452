//! Channel means and group norm of images.

use crate::Push;
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_kernels::network::group_norm::{self, GroupNormBlock, MeanBlock};

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
    means[channel] = group_norm::channel_mean(inputs, &push.parameters, channel);
}

/// Mean and squared deviations of a group of channels in a part of the image, number `first + id.x`, flat in
/// `[part][group]`.
#[spirv(compute(threads(64), entry_point_name = "group_norm_partials"))]
pub fn group_norm_partials(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<GroupNormBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] partials: &mut [[f32; 2]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    partials[element] = group_norm::group_norm_partials(inputs, &push.parameters, element);
}

/// Mean and factor of group number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "group_norm_statistics"))]
pub fn group_norm_statistics(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<GroupNormBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] partials: &[[f32; 2]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] statistics: &mut [[f32; 2]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let group = (push.piece.first + id.x) as usize;
    statistics[group] = group_norm::group_norm_statistics(partials, &push.parameters, group);
}

/// Channel of a pixel number `first + id.x`, flat in `[pixel][channel]`.
#[spirv(compute(threads(64), entry_point_name = "group_norm"))]
#[allow(clippy::too_many_arguments)]
pub fn group_norm(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<GroupNormBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] inputs: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] statistics: &[[f32; 2]],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] weights: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] bias: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] outputs: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    outputs[element] = group_norm::group_norm_element(inputs, statistics, weights, bias, &push.parameters, element);
}
