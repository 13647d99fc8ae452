//! How relevant each source is.

use super::{Vulkan, count_of};
use crate::kernels::weighting::WeightingKernels;
use bytemuck::bytes_of;
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::weighting::WeighBlock;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, VulkanError};

impl WeightingKernels for Vulkan {
    fn weigh(
        &self,
        block: &WeighBlock,
        sources: &Buffer<PoseBlock>,
        targets: &Buffer<PoseBlock>,
        weights: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [sources.bind(), targets.bind(), weights.bind()];
        self.gpu.dispatch(Kernel::Weigh, bytes_of(block), 0..count_of(targets.len()), &arrays)
    }

    fn embed_pose(
        &self,
        embedding: &Buffer<f32>,
        poses: &Buffer<PoseBlock>,
        embedded: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [embedding.bind(), poses.bind(), embedded.bind()];
        self.gpu.dispatch(Kernel::EmbedPose, &[], 0..count_of(poses.len()), &arrays)
    }

    fn attend(
        &self,
        source_count: u32,
        queries: &Buffer<f32>,
        keys: &Buffer<f32>,
        weights: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let targets = count_of(weights.len() / viewfuse_core::weighting::MOST_WEIGHED);
        let arrays = [queries.bind(), keys.bind(), weights.bind()];
        self.gpu.dispatch(Kernel::Attend, bytes_of(&source_count), 0..targets, &arrays)
    }
}
