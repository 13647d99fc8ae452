//! The list of kernels: what each is called, what it binds and what it is told.
//!
//! A kernel is a function of one output element in `viewfuse-core`; its entry point in `vulkan/shaders` has the same name,
//! unpacks its arguments and calls it. Everything about the entry point that this crate relies on stands here, and a
//! test reads it back from the compiled module.
//!
//! All arrays are storage buffers of descriptor set 0, numbered in the order given here. An array in [`Layout::Pages`]
//! takes [`MOST_PAGES`](viewfuse_core::pages::MOST_PAGES) bindings. Push constants are the kernel's parameters, then the
//! [`Piece`]. The specialisation constant 0, where a kernel binds pages, is the binary logarithm of a page's length, or 0
//! if all of the scene lies on first pages: choosing pages is then left out of the pipeline.

mod arrays;
mod parameters;

pub use arrays::{Access, Array, Layout};

use bytemuck::{Pod, Zeroable};

/// Invocations of a workgroup, along its only axis.
pub const WORKGROUP: u32 = 64;

/// Rows and columns of the outputs that a workgroup of a product computes together, each invocation 8 times 8 of them.
pub use viewfuse_core::network::tile::TILE;

/// Bytes of memory that every device has for a workgroup.
pub const SHARED_BYTES: usize = 16 << 10;

/// Elements of a product with so many outputs: whole tiles.
pub const fn tile_elements(row_count: u32, column_count: u32) -> u32 {
    row_count.div_ceil(TILE) * column_count.div_ceil(TILE) * WORKGROUP
}

/// The elements of one dispatch: large work is cut into several.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Piece {
    /// The first element.
    pub first: u32,
    /// How many there are.
    pub count: u32,
}

/// A kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kernel {
    /// Weights of the sources for targets, by formula. An element is a target.
    Weigh,
    /// Embeddings of poses. An element is a pose.
    EmbedPose,
    /// Weights of the sources for targets, by attention. An element is a target.
    Attend,
    /// Rays of a target's pixels. An element is a ray.
    CastRays,
    /// Evenly spread depths on rays. An element is a sample.
    CoarseDepths,
    /// Points of samples. An element is a point.
    PlacePoints,
    /// Features of points in the axes of views. An element is a feature of a point in a view.
    EmbedPoints,
    /// Weights of views at points. An element is a view of a point.
    VisibleWeights,
    /// Latents where points appear in a view. An element is a channel of a point.
    GatherLatents,
    /// Features where points lie in a view's volume. An element is a feature of a point.
    GatherVolume,
    /// A volume in numbers of 16 bits, two in a word. An element is a word.
    PackHalves,
    /// Features where points lie in a view's volume of 16 bits. An element is a feature of a point.
    GatherHalves,
    /// Convolutions of an image. An element is an 8x8 part of a tile of [`TILE`] pixels and channels.
    Convolve,
    /// Convolutions of every channel by itself. An element is a channel of an output pixel.
    ConvolveDepthwise,
    /// Transposed convolutions. An element is an 8x8 part of a tile of [`TILE`] input pixels and what they become.
    ConvolveTransposed,
    /// Largest numbers of windows. An element is a channel of an output pixel.
    MaxPool,
    /// Enlarged images. An element is an input channel of an output pixel.
    Upsample,
    /// Matrix products. An element is an 8x8 part of a tile of [`TILE`] rows and columns.
    Product,
    /// Means of an image's channels. An element is a channel.
    ChannelMeans,
    /// Moments of parts of an image. An element is a group of channels in a part.
    PartMoments,
    /// Moments of an image from those of its parts. An element is a group of channels.
    MergeMoments,
    /// Normalised images. An element is a channel of a pixel.
    Normalise,
    /// Products of two computed matrices. An element is an 8x8 part of a tile of [`TILE`] rows and columns.
    MultiplyMatrices,
    /// Softmax over rows. An element is a row.
    SoftmaxRows,
    /// Weighted sums over views. An element is a channel of a point.
    FuseViews,
    /// Colour and optical depth of points. An element is a point.
    Radiance,
    /// Rays from their samples. An element is a ray.
    Composite,
    /// Weights of samples on rays. An element is a ray.
    WeighSamples,
    /// Random numbers for fine samples. An element is a fine sample.
    DrawChances,
    /// Depths where a first pass saw something. An element is a fine sample.
    FineDepths,
    /// Depths of two passes in order. An element is a sample of either.
    MergeDepths,
    /// Which samples to look at. An element is a sample.
    WantedSamples,
    /// Weights of samples on rays of features. An element is a ray.
    WeighFeatures,
    /// Sums of features along rays. An element is a feature of a ray.
    SumFeatures,
    /// What the denoiser is given. An element is a channel of a pixel.
    DenoiserInput,
    /// Where a source pixel's ray enters the hull. An element is a pixel of the view.
    HullEntry,
    /// How badly other views match, at all planes. An element is a pixel of the band.
    MatchCost,
    /// Costs summed over a window's columns. An element is a plane of a pixel of the band.
    SumRow,
    /// Costs averaged over a window. An element is a plane of a pixel of the band.
    MeanColumn,
    /// Depths of least cost. An element is a pixel of the band.
    PickDepth,
    /// Rays through the solid. An element is a pixel of the target.
    March,
    /// Linear combinations of pictures. An element is a channel of a pixel.
    MixPictures,
    /// Pictures with noise. An element is a channel of a pixel.
    AddNoise,
}

impl Kernel {
    /// Every kernel, in the order of the data.
    pub const ALL: [Kernel; 43] = [
        Kernel::Weigh,
        Kernel::EmbedPose,
        Kernel::Attend,
        Kernel::CastRays,
        Kernel::CoarseDepths,
        Kernel::PlacePoints,
        Kernel::EmbedPoints,
        Kernel::VisibleWeights,
        Kernel::GatherLatents,
        Kernel::GatherVolume,
        Kernel::PackHalves,
        Kernel::GatherHalves,
        Kernel::Convolve,
        Kernel::ConvolveDepthwise,
        Kernel::ConvolveTransposed,
        Kernel::MaxPool,
        Kernel::Upsample,
        Kernel::Product,
        Kernel::ChannelMeans,
        Kernel::PartMoments,
        Kernel::MergeMoments,
        Kernel::Normalise,
        Kernel::MultiplyMatrices,
        Kernel::SoftmaxRows,
        Kernel::FuseViews,
        Kernel::Radiance,
        Kernel::Composite,
        Kernel::WeighSamples,
        Kernel::DrawChances,
        Kernel::FineDepths,
        Kernel::MergeDepths,
        Kernel::WantedSamples,
        Kernel::WeighFeatures,
        Kernel::SumFeatures,
        Kernel::DenoiserInput,
        Kernel::HullEntry,
        Kernel::MatchCost,
        Kernel::SumRow,
        Kernel::MeanColumn,
        Kernel::PickDepth,
        Kernel::March,
        Kernel::MixPictures,
        Kernel::AddNoise,
    ];

    /// Name of its entry point, and of the method of a device that runs it.
    pub const fn name(self) -> &'static str {
        match self {
            Kernel::Weigh => "weigh",
            Kernel::EmbedPose => "embed_pose",
            Kernel::Attend => "attend",
            Kernel::CastRays => "cast_rays",
            Kernel::CoarseDepths => "coarse_depths",
            Kernel::PlacePoints => "place_points",
            Kernel::EmbedPoints => "embed_points",
            Kernel::VisibleWeights => "visible_weights",
            Kernel::GatherLatents => "gather_latents",
            Kernel::GatherVolume => "gather_volume",
            Kernel::PackHalves => "pack_halves",
            Kernel::GatherHalves => "gather_halves",
            Kernel::Convolve => "convolve",
            Kernel::ConvolveDepthwise => "convolve_depthwise",
            Kernel::ConvolveTransposed => "convolve_transposed",
            Kernel::MaxPool => "max_pool",
            Kernel::Upsample => "upsample",
            Kernel::Product => "product",
            Kernel::ChannelMeans => "channel_means",
            Kernel::PartMoments => "part_moments",
            Kernel::MergeMoments => "merge_moments",
            Kernel::Normalise => "normalise",
            Kernel::MultiplyMatrices => "multiply_matrices",
            Kernel::SoftmaxRows => "softmax_rows",
            Kernel::FuseViews => "fuse_views",
            Kernel::Radiance => "radiance",
            Kernel::Composite => "composite",
            Kernel::WeighSamples => "weigh_samples",
            Kernel::DrawChances => "draw_chances",
            Kernel::FineDepths => "fine_depths",
            Kernel::MergeDepths => "merge_depths",
            Kernel::WantedSamples => "wanted_samples",
            Kernel::WeighFeatures => "weigh_features",
            Kernel::SumFeatures => "sum_features",
            Kernel::DenoiserInput => "denoiser_input",
            Kernel::HullEntry => "hull_entry",
            Kernel::MatchCost => "match_cost",
            Kernel::SumRow => "sum_row",
            Kernel::MeanColumn => "mean_column",
            Kernel::PickDepth => "pick_depth",
            Kernel::March => "march",
            Kernel::MixPictures => "mix_pictures",
            Kernel::AddNoise => "add_noise",
        }
    }

    /// Whether its workgroups compute tiles together: only those have memory of their own, and barriers.
    pub const fn is_tiled(self) -> bool {
        matches!(self, Kernel::Convolve | Kernel::ConvolveTransposed | Kernel::Product | Kernel::MultiplyMatrices)
    }

    /// Whether it binds pages, and so has the specialisation constant 0.
    pub fn has_pages(self) -> bool {
        self.arrays().iter().any(|array| array.layout == Layout::Pages)
    }
}
