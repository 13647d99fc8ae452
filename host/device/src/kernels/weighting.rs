//! How relevant each source is.

use super::super::memory::Memory;
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::weighting::WeighBlock;

/// Kernels of `viewfuse_core`, see there.
pub trait WeightingKernels: Memory {
    /// Kernel `weigh` for every target: `weights[target][MOST_WEIGHED]`, zeros beyond the sources.
    ///
    /// # Errors
    /// If the device is lost.
    fn weigh(
        &self,
        block: &WeighBlock,
        sources: &Self::Buffer<PoseBlock>,
        targets: &Self::Buffer<PoseBlock>,
        weights: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `embed_pose` for every pose: `embedded[pose][EMBEDDING]`. `embedding` holds the parameters of a
    /// [`viewfuse_core::attention::FourierEmbedding`], flat.
    ///
    /// # Errors
    /// If the device is lost.
    fn embed_pose(
        &self,
        embedding: &Self::Buffer<f32>,
        poses: &Self::Buffer<PoseBlock>,
        embedded: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `attend` for every target: `weights[target][MOST_WEIGHED]` from `queries[target][EMBEDDING]` and
    /// `keys[source][EMBEDDING]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn attend(
        &self,
        source_count: u32,
        queries: &Self::Buffer<f32>,
        keys: &Self::Buffer<f32>,
        weights: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;
}
