//! The views become one, samples become a pixel.

use super::{Vulkan, count_of};
use crate::kernels::light::{LightKernels, Pixels};
use bytemuck::bytes_of;
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_vulkan::kernel::Kernel;
use viewfuse_vulkan::{Buffer, VulkanError};

impl LightKernels for Vulkan {
    fn fuse_views(
        &self,
        block: &FuseBlock,
        element_count: u32,
        weights: &Buffer<f32>,
        latents: &Buffer<f32>,
        fused: &mut Buffer<f32>,
    ) -> Result<(), VulkanError> {
        let arrays = [weights.bind(), latents.bind(), fused.bind()];
        self.gpu.dispatch(Kernel::FuseViews, bytes_of(block), 0..element_count, &arrays)
    }

    fn composite(
        &self,
        block: &CompositeBlock,
        samples: &Buffer<[f32; 4]>,
        sample_depths: &Buffer<f32>,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), VulkanError> {
        let arrays = [samples.bind(), sample_depths.bind(), pixels.colours.bind(), pixels.depths.bind()];
        self.gpu.dispatch(Kernel::Composite, bytes_of(block), 0..count_of(pixels.depths.len()), &arrays)
    }
}
