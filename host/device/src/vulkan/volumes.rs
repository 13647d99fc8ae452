//! From volumes to a feature image, and the denoiser's inputs.

use super::Vulkan;
use crate::kernels::volumes::VolumeKernels;
use bytemuck::bytes_of;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::genvs::{DenoiserInputBlock, FeatureBlock, VolumeBlock};
use viewfuse_core::half::word_count;
use viewfuse_core::rays::RayPoint;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, VulkanError};

impl VolumeKernels for Vulkan {
    fn gather_volume(
        &self,
        block: &VolumeBlock,
        views: &Buffer<CameraBlock>,
        points: &Buffer<RayPoint>,
        volume: &Buffer<f32>,
        gathered: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [views.bind(), points.bind(), volume.bind(), gathered.bind()];
        let elements = block.point_count * block.feature_count;
        self.gpu.dispatch(Kernel::GatherVolume, bytes_of(block), 0..elements, &arrays)
    }

    fn pack_halves(
        &self,
        number_count: u32,
        numbers: &Buffer<f32>,
        words: &mut Buffer<u32>,
    ) -> Result<(), VulkanError> {
        let arrays = [numbers.bind(), words.bind()];
        let elements = word_count(number_count);
        self.gpu.dispatch(Kernel::PackHalves, bytes_of(&number_count), 0..elements, &arrays)
    }

    fn gather_halves(
        &self,
        block: &VolumeBlock,
        views: &Buffer<CameraBlock>,
        points: &Buffer<RayPoint>,
        volume: &Buffer<u32>,
        gathered: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [views.bind(), points.bind(), volume.bind(), gathered.bind()];
        let elements = block.point_count * block.feature_count;
        self.gpu.dispatch(Kernel::GatherHalves, bytes_of(block), 0..elements, &arrays)
    }

    fn weigh_features(
        &self,
        block: &FeatureBlock,
        ray_count: u32,
        raw: &Buffer<f32>,
        points: &Buffer<RayPoint>,
        weights: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [raw.bind(), points.bind(), weights.bind()];
        self.gpu.dispatch(Kernel::WeighFeatures, bytes_of(block), 0..ray_count, &arrays)
    }

    fn sum_features(
        &self,
        block: &FeatureBlock,
        ray_count: u32,
        weights: &Buffer<f32>,
        fused: &Buffer<f32>,
        raw: &Buffer<f32>,
        summed: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [weights.bind(), fused.bind(), raw.bind(), summed.bind()];
        let elements = ray_count * block.feature_count;
        self.gpu.dispatch(Kernel::SumFeatures, bytes_of(block), 0..elements, &arrays)
    }

    fn denoiser_input(
        &self,
        block: &DenoiserInputBlock,
        pixel_count: u32,
        noisy: &Buffer<f32>,
        condition: &Buffer<f32>,
        inputs: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [noisy.bind(), condition.bind(), inputs.bind()];
        let elements = pixel_count * (block.picture_channels + block.condition_channels);
        self.gpu.dispatch(Kernel::DenoiserInput, bytes_of(block), 0..elements, &arrays)
    }
}
