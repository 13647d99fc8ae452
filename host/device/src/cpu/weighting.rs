//! How relevant each source is.

use super::Cpu;
use crate::kernels::weighting::WeightingKernels;
use rayon::prelude::*;
use std::convert::Infallible;
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding, PoseEmbedding, attend};
use viewfuse_core::pose::{Pose, PoseBlock};
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{MOST_WEIGHED, WeighBlock, weigh};

impl WeightingKernels for Cpu {
    fn weigh(
        &self,
        block: &WeighBlock,
        sources: &Vec<PoseBlock>,
        targets: &Vec<PoseBlock>,
        weights: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let mut poses = [Pose::IDENTITY; MOST_WEIGHED];
        poses.iter_mut().zip(sources).for_each(|(pose, source)| *pose = source.pose());
        let sources = Sources::from_array(poses, block.source_count);
        weights.par_chunks_mut(MOST_WEIGHED).zip(targets).for_each(|(row, target)| {
            row.copy_from_slice(weigh(block.scheme.scheme(), &sources, &target.pose()).values());
        });
        Ok(())
    }

    fn embed_pose(
        &self,
        embedding: &Vec<f32>,
        poses: &Vec<PoseBlock>,
        embedded: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        let embedding = FourierEmbedding::from_flat(embedding);
        embedded.par_chunks_mut(EMBEDDING).zip(poses).for_each(|(row, pose)| {
            row.copy_from_slice(&embedding.embed(&pose.pose()));
        });
        Ok(())
    }

    fn attend(
        &self,
        source_count: u32,
        queries: &Vec<f32>,
        keys: &Vec<f32>,
        weights: &mut Vec<f32>,
    ) -> Result<(), Infallible> {
        weights.par_chunks_mut(MOST_WEIGHED).zip(queries.par_chunks(EMBEDDING)).for_each(|(row, query)| {
            row.copy_from_slice(attend::<MOST_WEIGHED>(query, &keys[..], source_count).values());
        });
        Ok(())
    }
}
