//! Devices: where kernels run.
//!
//! A device holds buffers and runs kernels on them, one method per kernel, so that a kernel that exists on one device
//! only does not compile. The body of every kernel is a function in `viewfuse-core`; a device decides how its elements
//! are spread over cores or invocations. Nothing is downloaded before the end of a render.

pub mod choice;
pub mod cpu;
pub mod vulkan;

use bytemuck::Pod;
use std::ops::Range;
use std::time::Duration;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::photo::ObjectBlock;
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::weighting::WeighBlock;

/// What a buffer can hold: plain data.
pub trait Element: Pod + Default + Send + Sync {}
impl<T: Pod + Default + Send + Sync> Element for T {}

/// Views and object of the weight-free field in a device's memory; see [`viewfuse_core::photo`].
pub struct PhotoScene<D: Device + ?Sized> {
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

/// A target picture in a device's memory.
pub struct Pixels<D: Device + ?Sized> {
    /// `[row][column]`: red, green, blue, opacity.
    pub colours: D::Buffer<[f32; 4]>,
    /// `[row][column]`: depth along the principal axis; 0 where nothing is met.
    pub depths: D::Buffer<f32>,
}

/// What a kernel took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KernelTime {
    /// Its name.
    pub kernel: &'static str,
    /// How many times it was dispatched.
    pub dispatches: u64,
    /// How many elements it computed.
    pub elements: u64,
    /// Its time on the device.
    pub time: Duration,
}

/// Something that runs kernels.
pub trait Device {
    /// Memory of the device that holds `T`s.
    type Buffer<T: Element>;
    /// What can go wrong.
    type Error: std::error::Error + Send + Sync + 'static;

    /// What the run record calls it.
    fn name(&self) -> String;

    /// A buffer with these values.
    ///
    /// # Errors
    /// If the device has no room.
    fn upload<T: Element>(&self, values: &[T]) -> Result<Self::Buffer<T>, Self::Error>;

    /// A buffer of `count` default values.
    ///
    /// # Errors
    /// If the device has no room.
    fn zeros<T: Element>(&self, count: usize) -> Result<Self::Buffer<T>, Self::Error>;

    /// Most elements of a buffer that is bound as a whole: what grows with the work is cut so that it fits.
    fn most_elements<T: Element>(&self) -> usize;

    /// Fewest elements of a kernel that keep the device busy: work between two looks at the interrupt flag is not cut
    /// finer.
    fn busy_elements(&self) -> usize;

    /// Waits until everything that was asked for is done, so that its time can be told.
    ///
    /// # Errors
    /// If the device is lost, or a kernel took too long.
    fn finish(&self) -> Result<(), Self::Error>;

    /// What each kernel took so far, kernels that never ran left out; nothing for devices that do not tell.
    fn kernel_times(&self) -> Vec<KernelTime>;

    /// The values of a buffer.
    ///
    /// # Errors
    /// If the device is lost.
    fn download<T: Element>(&self, buffer: &Self::Buffer<T>) -> Result<Vec<T>, Self::Error>;

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

    /// Kernel `fuse_views` for every element: `fused[element]` from `weights[view]` and `latents[view][element]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn fuse_views(
        &self,
        block: &FuseBlock,
        weights: &Self::Buffer<f32>,
        latents: &Self::Buffer<f32>,
        fused: &mut Self::Buffer<f32>,
    ) -> Result<(), Self::Error>;

    /// Kernel `composite` for every ray, from `samples[ray][sample]` (red, green, blue, optical depth) and
    /// `sample_depths[ray][sample]`.
    ///
    /// # Errors
    /// If the device is lost.
    fn composite(
        &self,
        block: &CompositeBlock,
        samples: &Self::Buffer<[f32; 4]>,
        sample_depths: &Self::Buffer<f32>,
        pixels: &mut Pixels<Self>,
    ) -> Result<(), Self::Error>;

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
