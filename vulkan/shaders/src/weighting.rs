//! Weights of the source views: by formula and by attention.

use crate::{Piece, Push};
use spirv_std::glam::UVec3;
use spirv_std::spirv;
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding, PoseEmbedding};
use viewfuse_core::fetch::StartingAt;
use viewfuse_core::pose::{Pose, PoseBlock};
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{MAX_WEIGHED, WeighBlock};

/// Weights of the sources for target number `first + id.x`, by formula.
#[spirv(compute(threads(64), entry_point_name = "weigh"))]
pub fn weigh(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<WeighBlock>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] sources: &[PoseBlock],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] targets: &[PoseBlock],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] weights: &mut [[f32; MAX_WEIGHED]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let target = (push.piece.first + id.x) as usize;
    let mut poses = [Pose::IDENTITY; MAX_WEIGHED];
    let mut view = 0;
    while view < MAX_WEIGHED && view < push.parameters.source_count as usize {
        poses[view] = sources[view].pose();
        view += 1;
    }
    let sources = Sources::from_array(poses, push.parameters.source_count);
    let scheme = push.parameters.scheme.scheme();
    weights[target] = *viewfuse_core::weighting::weigh(scheme, &sources, &targets[target].pose()).values();
}

/// The embedding of pose number `first + id.x`.
#[spirv(compute(threads(64), entry_point_name = "embed_pose"))]
pub fn embed_pose(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] piece: &Piece,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] embedding: &FourierEmbedding,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] poses: &[PoseBlock],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] embedded: &mut [[f32; EMBEDDING]],
) {
    if id.x >= piece.count {
        return;
    }
    let pose = (piece.first + id.x) as usize;
    embedded[pose] = embedding.embed(&poses[pose].pose());
}

/// Weights of the sources for target number `first + id.x`, by attention; the parameter is how many sources there are.
#[spirv(compute(threads(64), entry_point_name = "attend"))]
pub fn attend(
    #[spirv(global_invocation_id)] id: UVec3,
    #[spirv(push_constant)] push: &Push<u32>,
    #[spirv(storage_buffer, descriptor_set = 0, binding = 0)] queries: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 1)] keys: &[f32],
    #[spirv(storage_buffer, descriptor_set = 0, binding = 2)] weights: &mut [[f32; MAX_WEIGHED]],
) {
    if id.x >= push.piece.count {
        return;
    }
    let target = (push.piece.first + id.x) as usize;
    let query = StartingAt { all: queries, first: target * EMBEDDING };
    let attended = viewfuse_core::attention::attend::<MAX_WEIGHED>(&query, keys, push.parameters);
    weights[target] = *attended.values();
}
