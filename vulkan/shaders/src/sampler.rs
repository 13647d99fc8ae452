//! Operations of the denoiser's sampler on pictures.

use crate::Push;
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::sampler::{Mix, NoiseBlock, mixed_element, noisy_element};

/// The linear combination at element number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "mix_pictures"))]
#[allow(clippy::too_many_arguments)]
pub fn mix_pictures(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<Mix>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] state: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] newest: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] second: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 3)] third: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 4)] fourth: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 5)] mixed: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = (push.piece.first + id.x) as usize;
    mixed[element] = mixed_element(&push.parameters, state, newest, second, third, fourth, element);
}

/// The noisy value of element number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "add_noise"))]
pub fn add_noise(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<NoiseBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] picture: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] noisy: &mut [f32],
) {
    if id.x >= push.piece.count {
        return;
    }
    let element = push.piece.first + id.x;
    noisy[element as usize] = noisy_element(&push.parameters, picture[element as usize], element);
}
