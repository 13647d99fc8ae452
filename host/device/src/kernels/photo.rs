//! The field that needs no weights file.

use super::super::memory::Memory;
use super::light::Pixels;
use std::ops::Range;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::photo::ObjectBlock;
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;

/// Views and object of the weight-free field in a device's memory; see [`viewfuse_core::photo`].
pub struct PhotoScene<D: Memory + ?Sized> {
    /// The object's box and the number of views.
    pub object: ObjectBlock,
    /// The same in the device's memory.
    pub object_buffer: D::Buffer<ObjectBlock>,
    /// The source cameras on the host: shapes of the buffers.
    pub cameras: Vec<CameraBlock>,
    /// `[view]`: the source cameras.
    pub views: D::Buffer<CameraBlock>,
    /// `[view]`: a pixel's side at the middle of the object, world units.
    pub footprints: D::Buffer<f32>,
    /// `[view][row][column]`: premultiplied RGBA.
    pub texels: D::Buffer<[f32; 4]>,
}

/// Kernels of `viewfuse_core`, see there.
pub trait PhotoKernels: Memory {
    /// Kernel `hull_entry` for every pixel of one view: writes the view's part of `entries[view][row][column]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn hull_entry(
        &self,
        scene: &PhotoScene<Self>,
        view: u32,
        entries: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `match_cost` for every pixel and plane of a band: `costs[row][column][plane]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn match_cost(
        &self,
        scene: &PhotoScene<Self>,
        sweep: &SweepBlock,
        entries: &Self::Buffer<f32>,
        pair_weights: &Self::Buffer<f32>,
        costs: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `sum_row` for every pixel and plane of a band: `row_sums[row][column][plane]` = sum, count.
    ///
    /// # Errors
    /// If the device is lost.
    fn sum_row(
        &self,
        sweep: &SweepBlock,
        costs: &Self::Buffer<f32>,
        row_sums: &mut Self::Buffer<[f32; 2]>,
    ) -> Result<(), Self::Error>;

    /// Kernel `mean_column` for every pixel and plane of a band: `means[row][column][plane]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn mean_column(
        &self,
        sweep: &SweepBlock,
        costs: &Self::Buffer<f32>,
        row_sums: &Self::Buffer<[f32; 2]>,
        means: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `pick_depth` for the pixels of some rows of a band, counted from its first: writes their part of
    /// `picked[view][row][column]`.
    ///
    /// # Errors
    /// If the device is lost.
    #[allow(clippy::too_many_arguments)]
    fn pick_depth(
        &self,
        scene: &PhotoScene<Self>,
        sweep: &SweepBlock,
        means: &Self::Buffer<f32>,
        entries: &Self::Buffer<f32>,
        guess: &Self::Buffer<f32>,
        rows: Range<u32>,
        picked: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `march` for every pixel of the rows `first_row .. first_row + row_count` of a target.
    ///
    /// # Errors
    /// If the device is lost.
    #[allow(clippy::too_many_arguments)]
    fn march(
        &self,
        scene: &PhotoScene<Self>,
        depths: &Self::Buffer<f32>,
        weights: &Self::Buffer<f32>,
        target: &MarchBlock,
        first_row: u32,
        row_count: u32,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), Self::Error>;
}
