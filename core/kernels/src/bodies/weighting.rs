//! Weights of the source views: by formula and by attention.

use crate::store::Store;
use viewfuse_core::attention::{self, EMBEDDING, FourierEmbedding, PoseEmbedding};
use viewfuse_core::fetch::StartingAt;
use viewfuse_core::pose::{Pose, PoseBlock};
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{self, MAX_WEIGHED, WeighBlock};

/// Weights of the sources for a target, by formula.
#[inline]
pub fn weigh(
    block: &WeighBlock,
    sources: &[PoseBlock],
    targets: &[PoseBlock],
    weights: &mut (impl Store<[f32; MAX_WEIGHED]> + ?Sized),
    target: u32,
) {
    let mut poses = [Pose::IDENTITY; MAX_WEIGHED];
    let mut view = 0;
    while view < MAX_WEIGHED && view < block.source_count as usize {
        poses[view] = sources[view].pose();
        view += 1;
    }
    let sources = Sources::from_array(poses, block.source_count);
    let weighed = weighting::weigh(block.scheme.scheme(), &sources, &targets[target as usize].pose());
    weights.store(target as usize, *weighed.values());
}

/// The embedding of a pose.
#[inline]
pub fn embed_pose(
    embedding: &FourierEmbedding,
    poses: &[PoseBlock],
    embedded: &mut (impl Store<[f32; EMBEDDING]> + ?Sized),
    pose: u32,
) {
    embedded.store(pose as usize, embedding.embed(&poses[pose as usize].pose()));
}

/// Weights of the sources for a target, by attention.
#[inline]
pub fn attend(
    source_count: &u32,
    queries: &[f32],
    keys: &[f32],
    weights: &mut (impl Store<[f32; MAX_WEIGHED]> + ?Sized),
    target: u32,
) {
    let query = StartingAt { all: queries, first: target as usize * EMBEDDING };
    weights.store(target as usize, *attention::attend::<MAX_WEIGHED>(&query, keys, *source_count).values());
}
