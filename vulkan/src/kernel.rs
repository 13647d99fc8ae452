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
use viewfuse_core::fuse::FuseBlock;
use viewfuse_core::pages::MOST_PAGES;
use viewfuse_core::photo::ObjectBlock;
use viewfuse_core::photo::march::MarchBlock;
use viewfuse_core::photo::sweep::SweepBlock;
use viewfuse_core::pose::PoseBlock;
use viewfuse_core::weighting::{MOST_WEIGHED, WeighBlock};

/// Invocations of a workgroup, along its only axis.
pub const WORKGROUP: u32 = 64;

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
    /// Weighted sums over views. An element is a channel of a point.
    FuseViews,
    /// Rays from their samples. An element is a ray.
    Composite,
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
    pub const ALL: [Kernel; 11] = [
        Kernel::Weigh,
        Kernel::EmbedPose,
        Kernel::Attend,
        Kernel::FuseViews,
        Kernel::Composite,
        Kernel::HullEntry,
        Kernel::MatchCost,
        Kernel::SumRow,
        Kernel::MeanColumn,
        Kernel::PickDepth,
        Kernel::March,
    ];

    /// Name of its entry point, and of the method of a device that runs it.
    pub const fn name(self) -> &'static str {
        match self {
            Kernel::Weigh => "weigh",
            Kernel::EmbedPose => "embed_pose",
            Kernel::Attend => "attend",
            Kernel::FuseViews => "fuse_views",
            Kernel::Composite => "composite",
            Kernel::HullEntry => "hull_entry",
            Kernel::MatchCost => "match_cost",
            Kernel::SumRow => "sum_row",
            Kernel::MeanColumn => "mean_column",
            Kernel::PickDepth => "pick_depth",
            Kernel::March => "march",
        }
    }

    /// What it binds, in the order of the bindings.
    pub const fn arrays(self) -> &'static [Array] {
        const OBJECT: Array = Array::one::<ObjectBlock, ObjectBlock>("object");
        const VIEWS: Array = Array::read::<CameraBlock>("views");
        const TEXELS: Array = Array::read::<Texel>("texels").in_pages();
        const ENTRIES: Array = Array::read::<f32>("entries").in_pages();
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
            Kernel::FuseViews => {
                const { &[Array::read::<f32>("weights"), Array::read::<f32>("latents"), Array::write::<f32>("fused")] }
            }
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
        }
    }

    /// Bytes of its parameters, without the [`Piece`] behind them.
    pub const fn parameter_bytes(self) -> usize {
        match self {
            Kernel::Weigh => size_of::<WeighBlock>(),
            Kernel::EmbedPose => 0,
            // How many sources there are.
            Kernel::Attend => size_of::<u32>(),
            Kernel::FuseViews => size_of::<FuseBlock>(),
            Kernel::Composite => size_of::<CompositeBlock>(),
            // Which view.
            Kernel::HullEntry => size_of::<u32>(),
            Kernel::MatchCost | Kernel::SumRow | Kernel::MeanColumn | Kernel::PickDepth => size_of::<SweepBlock>(),
            Kernel::March => size_of::<MarchBlock>(),
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

    /// Whether it binds pages, and so has the specialisation constant 0.
    pub fn has_pages(self) -> bool {
        self.arrays().iter().any(|array| array.layout == Layout::Pages)
    }
}
