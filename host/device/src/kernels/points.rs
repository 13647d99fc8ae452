//! What goes into PixelNeRF's network for points, and what comes out.

use super::super::memory::Memory;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::pixelnerf::{EmbedBlock, GatherBlock};
use viewfuse_core::rays::RayPoint;

/// Kernels of [`viewfuse_core::pixelnerf`]. Buffers may be longer than a block says.
pub trait PointKernels: Memory {
    /// Kernel `embed_points` for every number of `embedded[view][point][feature]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn embed_points(
        &self,
        block: &EmbedBlock,
        view_count: u32,
        views: &Self::Buffer<CameraBlock>,
        points: &Self::Buffer<RayPoint>,
        embedded: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `visible_weights` for every view of every point: `visible[point][view]`.
    ///
    /// # Errors
    /// If the device is lost.
    #[allow(clippy::too_many_arguments)]
    fn visible_weights(
        &self,
        view_count: u32,
        point_count: u32,
        views: &Self::Buffer<CameraBlock>,
        weights: &Self::Buffer<f32>,
        points: &Self::Buffer<RayPoint>,
        visible: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `gather_latents` for every channel of every point: writes a view's part of
    /// `gathered[view][point][channel]`, from the view's `grid[row][column][channel]`.
    ///
    /// # Errors
    /// If the device is lost.
    #[allow(clippy::too_many_arguments)]
    fn gather_latents(
        &self,
        block: &GatherBlock,
        views: &Self::Buffer<CameraBlock>,
        points: &Self::Buffer<RayPoint>,
        grid: &Self::Buffer<f32>,
        addend: Option<&Self::Buffer<f32>>,
        gathered: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `radiance` for every point: writes its sample of `samples[ray][sample]` (red, green, blue, optical depth),
    /// from `raw[point][4]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn radiance(
        &self,
        point_count: u32,
        raw: &Self::Buffer<f32>,
        points: &Self::Buffer<RayPoint>,
        samples: &mut Self::Buffer<[f32; 4]>,
    ) -> Result<(), Self::Error>;
}
