//! Weights of the source views.

use crate::parallel::for_each_row;
use viewfuse_core::attention::{self, EMBEDDING, FourierEmbedding, PoseEmbedding};
use viewfuse_core::pose::{Pose, PoseBlock};
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{self, MAX_WEIGHED, WeighBlock};

pub(super) fn weigh(
    block: &WeighBlock,
    target_count: u32,
    sources: &[PoseBlock],
    targets: &[PoseBlock],
    weights: &mut [f32],
) {
    let mut poses = [Pose::IDENTITY; MAX_WEIGHED];
    poses.iter_mut().zip(sources).for_each(|(pose, source)| *pose = source.pose());
    let sources = Sources::from_array(poses, block.source_count);
    for_each_row(&mut weights[..target_count as usize * MAX_WEIGHED], MAX_WEIGHED, 256, |target, row| {
        let weights = weighting::weigh(block.scheme.scheme(), &sources, &targets[target].pose());
        row.copy_from_slice(weights.values());
    });
}

pub(super) fn embed_pose(pose_count: u32, embedding: &[f32], poses: &[PoseBlock], embedded: &mut [f32]) {
    let embedding = FourierEmbedding::from_flat(embedding);
    for_each_row(&mut embedded[..pose_count as usize * EMBEDDING], EMBEDDING, 4 * EMBEDDING, |pose, row| {
        row.copy_from_slice(&embedding.embed(&poses[pose].pose()));
    });
}

pub(super) fn attend(source_count: &u32, target_count: u32, queries: &[f32], keys: &[f32], weights: &mut [f32]) {
    for_each_row(&mut weights[..target_count as usize * MAX_WEIGHED], MAX_WEIGHED, 256, |target, row| {
        let query = &queries[target * EMBEDDING..][..EMBEDDING];
        row.copy_from_slice(attention::attend::<MAX_WEIGHED>(query, keys, *source_count).values());
    });
}
