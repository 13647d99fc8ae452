//! The list of kernels: what each is called, what it binds and what it is told.
//!
//! A kernel is a function of one output element in `viewfuse-core`; its entry point in `vulkan/shaders` has the same name,
//! unpacks its arguments and calls it. Everything about the entry point that this crate relies on stands here, and a
//! test reads it back from the compiled module.
//!
//! All arrays are storage buffers of descriptor set 0, numbered in the order given here. An array in [`Layout::Pages`]
//! takes [`MOST_PAGES`] bindings. Push constants are the kernel's parameters, then the [`Piece`].
//! The specialisation constant 0, where a kernel binds pages, is the binary logarithm of a page's length, or 0 if all of
//! the scene lies on first pages: choosing pages is then left out of the pipeline.

use bytemuck::{Pod, Zeroable};
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding};
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::composite::CompositeBlock;
use viewfuse_core::depths::{CoarseBlock, FineBlock};
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::genvs::{DenoiserInputBlock, FeatureBlock, VolumeBlock};
use viewfuse_core::network::attend::MatrixBlock;
use viewfuse_core::network::convolve::ConvolveBlock;
use viewfuse_core::network::depthwise::DepthwiseBlock;
use viewfuse_core::network::normalise::{MeanBlock, NormaliseBlock};
use viewfuse_core::network::product::ProductBlock;
use viewfuse_core::network::resample::{PoolBlock, UpsampleBlock};
use viewfuse_core::network::transpose::TransposedBlock;
use viewfuse_core::pages::MOST_PAGES;
use viewfuse_core::photo::ObjectBlock;
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_core::pixelnerf::{EmbedBlock, GatherBlock};
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::rays::{CastBlock, RayPoint, TargetRay};
use viewfuse_core::sampler::{Mix, NoiseBlock};
use viewfuse_core::wanted::WantedBlock;
use viewfuse_core::weighting::{MOST_WEIGHED, WeighBlock};

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

/// What a kernel does with an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// It only reads.
    Read,
    /// It writes each of its elements, and reads nothing that it writes.
    Write,
}

/// How an array is bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// As one buffer.
    Whole,
    /// As [`MOST_PAGES`] buffers.
    Pages,
}

/// An array that a kernel binds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Array {
    /// Its name in the entry point; pages have `_a` to `_d` behind it.
    pub name: &'static str,
    /// What is done with it.
    pub access: Access,
    /// How it is bound.
    pub layout: Layout,
    /// Bytes of an element.
    pub stride: usize,
    /// Bytes that the kernel reads without looking at the length; 0 where it looks.
    pub least_bytes: usize,
}

impl Array {
    const fn read<T>(name: &'static str) -> Array {
        Array { name, access: Access::Read, layout: Layout::Whole, stride: size_of::<T>(), least_bytes: 0 }
    }

    /// One struct `S` that is made of `T`s.
    const fn one<S, T>(name: &'static str) -> Array {
        Array { least_bytes: size_of::<S>(), ..Array::read::<T>(name) }
    }

    const fn write<T>(name: &'static str) -> Array {
        Array { access: Access::Write, ..Array::read::<T>(name) }
    }

    const fn not_empty(self) -> Array {
        Array { least_bytes: self.stride, ..self }
    }

    const fn in_pages(self) -> Array {
        Array { layout: Layout::Pages, ..self }
    }

    /// How many bindings it takes.
    pub const fn binding_count(&self) -> usize {
        match self.layout {
            Layout::Whole => 1,
            Layout::Pages => MOST_PAGES,
        }
    }
}

type Texel = [f32; 4];
type WeightRow = [f32; MOST_WEIGHED];

impl Kernel {
    /// Every kernel, in the order of the data.
    pub const ALL: [Kernel; 41] = [
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

    /// What it binds, in the order of the bindings.
    pub const fn arrays(self) -> &'static [Array] {
        const OBJECT: Array = Array::one::<ObjectBlock, ObjectBlock>("object");
        const VIEWS: Array = Array::read::<CameraBlock>("views");
        const TEXELS: Array = Array::read::<Texel>("texels").in_pages();
        const ENTRIES: Array = Array::read::<f32>("entries").in_pages();
        const PIXELS: Array = Array::read::<u32>("pixels");
        const RAYS: Array = Array::read::<TargetRay>("rays");
        const POINTS: Array = Array::read::<RayPoint>("points");
        const SEEN: Array = Array::read::<[f32; 2]>("seen");
        const INPUTS: Array = Array::read::<f32>("inputs").not_empty();
        const WEIGHTS: Array = Array::read::<f32>("weights").not_empty();
        const BIAS: Array = Array::read::<f32>("bias").not_empty();
        const ADDEND: Array = Array::read::<f32>("addend").not_empty();
        const OUTPUTS: Array = Array::write::<f32>("outputs");
        match self {
            Kernel::Weigh => {
                const {
                    &[
                        Array::read::<PoseBlock>("sources"),
                        Array::read::<PoseBlock>("targets"),
                        Array::write::<WeightRow>("weights"),
                    ]
                }
            }
            Kernel::EmbedPose => {
                const {
                    &[
                        Array::one::<FourierEmbedding, f32>("embedding"),
                        Array::read::<PoseBlock>("poses"),
                        Array::write::<[f32; EMBEDDING]>("embedded"),
                    ]
                }
            }
            Kernel::Attend => {
                const { &[Array::read::<f32>("queries"), Array::read::<f32>("keys"), Array::write::<WeightRow>("weights")] }
            }
            Kernel::CastRays => const { &[PIXELS, Array::write::<TargetRay>("rays")] },
            Kernel::CoarseDepths => const { &[RAYS, PIXELS, Array::write::<f32>("depths")] },
            Kernel::PlacePoints => {
                const {
                    &[
                        Array::read::<u32>("samples"),
                        RAYS,
                        Array::read::<f32>("depths"),
                        Array::write::<RayPoint>("points"),
                    ]
                }
            }
            Kernel::EmbedPoints => const { &[VIEWS, POINTS, Array::write::<f32>("embedded")] },
            Kernel::VisibleWeights => {
                const { &[VIEWS, Array::read::<f32>("weights"), POINTS, Array::write::<f32>("visible")] }
            }
            Kernel::GatherLatents => {
                const { &[VIEWS, POINTS, Array::read::<f32>("grid"), ADDEND, Array::write::<f32>("gathered")] }
            }
            Kernel::GatherVolume => {
                const { &[VIEWS, POINTS, Array::read::<f32>("volume"), Array::write::<f32>("gathered")] }
            }
            Kernel::Convolve => const { &[INPUTS, WEIGHTS, BIAS, ADDEND, OUTPUTS] },
            Kernel::ConvolveDepthwise => const { &[INPUTS, WEIGHTS, OUTPUTS] },
            Kernel::ConvolveTransposed => const { &[INPUTS, WEIGHTS, BIAS, OUTPUTS] },
            Kernel::MaxPool => const { &[INPUTS, OUTPUTS] },
            Kernel::Upsample => const { &[INPUTS, OUTPUTS] },
            Kernel::Product => const { &[INPUTS, WEIGHTS, BIAS, ADDEND, OUTPUTS] },
            Kernel::ChannelMeans => const { &[INPUTS, Array::write::<f32>("means")] },
            Kernel::PartMoments => const { &[INPUTS, Array::write::<[f32; 2]>("parts")] },
            Kernel::MergeMoments => const { &[Array::read::<[f32; 2]>("parts"), Array::write::<[f32; 2]>("moments")] },
            Kernel::Normalise => const { &[INPUTS, Array::read::<[f32; 2]>("moments"), WEIGHTS, BIAS, OUTPUTS] },
            Kernel::MultiplyMatrices => {
                const { &[Array::read::<f32>("left").not_empty(), Array::read::<f32>("right").not_empty(), OUTPUTS] }
            }
            Kernel::SoftmaxRows => const { &[Array::read::<f32>("scores"), Array::write::<f32>("weights")] },
            Kernel::FuseViews => {
                const { &[Array::read::<f32>("weights"), Array::read::<f32>("latents"), Array::write::<f32>("fused")] }
            }
            Kernel::Radiance => const { &[Array::read::<f32>("raw"), POINTS, Array::write::<Texel>("samples")] },
            Kernel::Composite => {
                const {
                    &[
                        Array::read::<Texel>("samples"),
                        Array::read::<f32>("sample_depths"),
                        Array::write::<Texel>("colours"),
                        Array::write::<f32>("depths"),
                    ]
                }
            }
            Kernel::WeighSamples => const { &[Array::read::<Texel>("samples"), Array::write::<[f32; 2]>("seen")] },
            Kernel::DrawChances => const { &[PIXELS, Array::write::<[f32; 2]>("chances")] },
            Kernel::FineDepths => {
                const {
                    &[
                        SEEN,
                        RAYS,
                        Array::read::<Texel>("colours"),
                        Array::read::<f32>("pixel_depths"),
                        Array::read::<[f32; 2]>("chances"),
                        Array::write::<f32>("depths"),
                    ]
                }
            }
            Kernel::MergeDepths => {
                const { &[Array::read::<f32>("coarse"), Array::read::<f32>("fine"), Array::write::<f32>("merged")] }
            }
            Kernel::WantedSamples => {
                const { &[SEEN, RAYS, PIXELS, Array::read::<f32>("depths"), Array::write::<u32>("wanted")] }
            }
            Kernel::WeighFeatures => const { &[Array::read::<f32>("raw"), POINTS, Array::write::<f32>("weights")] },
            Kernel::SumFeatures => {
                const {
                    &[
                        Array::read::<f32>("weights"),
                        Array::read::<f32>("fused"),
                        Array::read::<f32>("raw"),
                        Array::write::<f32>("summed"),
                    ]
                }
            }
            Kernel::DenoiserInput => {
                const { &[Array::read::<f32>("noisy"), Array::read::<f32>("condition"), Array::write::<f32>("inputs")] }
            }
            Kernel::HullEntry => const { &[OBJECT, VIEWS, TEXELS, Array::write::<f32>("entries").in_pages()] },
            Kernel::MatchCost => {
                const { &[OBJECT, VIEWS, TEXELS, ENTRIES, Array::read::<f32>("pair_weights"), Array::write::<f32>("costs")] }
            }
            Kernel::SumRow => const { &[Array::read::<f32>("costs"), Array::write::<[f32; 2]>("row_sums")] },
            Kernel::MeanColumn => {
                const { &[Array::read::<f32>("costs"), Array::read::<[f32; 2]>("row_sums"), Array::write::<f32>("means")] }
            }
            Kernel::PickDepth => {
                const {
                    &[
                        OBJECT,
                        VIEWS,
                        Array::read::<f32>("means"),
                        ENTRIES,
                        Array::read::<f32>("guess").in_pages(),
                        Array::write::<f32>("picked").in_pages(),
                    ]
                }
            }
            Kernel::March => {
                const {
                    &[
                        OBJECT,
                        VIEWS,
                        Array::read::<f32>("footprints"),
                        TEXELS,
                        Array::read::<f32>("depths").in_pages(),
                        Array::read::<f32>("weights"),
                        Array::write::<Texel>("colours").in_pages(),
                        Array::write::<f32>("pixel_depths").in_pages(),
                    ]
                }
            }
            Kernel::MixPictures => {
                const {
                    &[
                        Array::read::<f32>("state"),
                        Array::read::<f32>("newest"),
                        Array::read::<f32>("second"),
                        Array::read::<f32>("third"),
                        Array::read::<f32>("fourth"),
                        Array::write::<f32>("mixed"),
                    ]
                }
            }
            Kernel::AddNoise => const { &[Array::read::<f32>("picture"), Array::write::<f32>("noisy")] },
        }
    }

    /// Bytes of its parameters, without the [`Piece`] behind them.
    pub const fn parameter_bytes(self) -> usize {
        match self {
            Kernel::Weigh => size_of::<WeighBlock>(),
            Kernel::EmbedPose | Kernel::Radiance => 0,
            // How many sources there are.
            Kernel::Attend => size_of::<u32>(),
            Kernel::CastRays => size_of::<CastBlock>(),
            Kernel::CoarseDepths => size_of::<CoarseBlock>(),
            Kernel::EmbedPoints => size_of::<EmbedBlock>(),
            Kernel::GatherLatents => size_of::<GatherBlock>(),
            Kernel::GatherVolume => size_of::<VolumeBlock>(),
            Kernel::Convolve => size_of::<ConvolveBlock>(),
            Kernel::ConvolveDepthwise => size_of::<DepthwiseBlock>(),
            Kernel::ConvolveTransposed => size_of::<TransposedBlock>(),
            Kernel::MaxPool => size_of::<PoolBlock>(),
            Kernel::Upsample => size_of::<UpsampleBlock>(),
            Kernel::Product => size_of::<ProductBlock>(),
            Kernel::ChannelMeans => size_of::<MeanBlock>(),
            Kernel::PartMoments | Kernel::MergeMoments | Kernel::Normalise => size_of::<NormaliseBlock>(),
            Kernel::MultiplyMatrices => size_of::<MatrixBlock>(),
            // Columns of a row.
            Kernel::SoftmaxRows => size_of::<u32>(),
            Kernel::WeighFeatures | Kernel::SumFeatures => size_of::<FeatureBlock>(),
            Kernel::DenoiserInput => size_of::<DenoiserInputBlock>(),
            // Samples on a ray.
            Kernel::PlacePoints | Kernel::WeighSamples => size_of::<u32>(),
            // How many views there are.
            Kernel::VisibleWeights => size_of::<u32>(),
            Kernel::DrawChances | Kernel::FineDepths | Kernel::MergeDepths => size_of::<FineBlock>(),
            Kernel::WantedSamples => size_of::<WantedBlock>(),
            Kernel::FuseViews => size_of::<FuseBlock>(),
            Kernel::Composite => size_of::<CompositeBlock>(),
            // Which view.
            Kernel::HullEntry => size_of::<u32>(),
            Kernel::MatchCost | Kernel::SumRow | Kernel::MeanColumn | Kernel::PickDepth => size_of::<SweepBlock>(),
            Kernel::March => size_of::<MarchBlock>(),
            Kernel::MixPictures => size_of::<Mix>(),
            Kernel::AddNoise => size_of::<NoiseBlock>(),
        }
    }

    /// Bytes of its push constants.
    pub const fn push_bytes(self) -> usize {
        self.parameter_bytes() + size_of::<Piece>()
    }

    /// How many bindings it has.
    pub const fn binding_count(self) -> usize {
        let arrays = self.arrays();
        let (mut count, mut index) = (0, 0);
        while index < arrays.len() {
            count += arrays[index].binding_count();
            index += 1;
        }
        count
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
