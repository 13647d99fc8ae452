//! One row a kernel: its name, what it takes, what it binds, what it costs, and its body.
//!
//! A kernel is a function of one output element, its *body*, the function of its name in [`bodies`](crate::bodies).
//! Everything else that is known about a kernel follows from its row: the variant of [`Kernel`] with its name, arrays
//! and parameter bytes, the method of a device with its forwarding on the CPU and on Vulkan, the faulty device of the
//! tests, and the way to the kernel's case. A row is
//!
//! ```text
//! /// What it computes, and what an element is.
//! Variant name(block: Parameters; count, ...) for element in [first..end; N a core], mark, ... {
//!     kind array[place]: Element as vectors,
//! }
//! ```
//!
//! - `block: Parameters` are the push constants, `count` further numbers that only the host needs; `first..end` are the
//!   elements of a dispatch. `N` elements take about 20 µs: a core gets no fewer.
//! - `tiles [rows, inner, columns]` in the place of `for`: the kernel is a matrix product of this shape, and a
//!   workgroup computes a tile together, in memory that it shares. There is an entry point for each [`Form`] of a tile,
//!   with the same bits in its outputs; a device takes the fastest. The body is the definition.
//! - Arrays stand in the order of their bindings. `Element` is what a buffer on the host holds. `as vectors`: the
//!   entry point loads and stores each as vectors of four numbers. `place`
//!   is the index of the first value that an element writes, where it is not the element's own number.
//!
//! The marks are
//!
//! | mark | |
//! |---|---|
//! | `twin` | the CPU runs a faster form of its own (`host/device/src/cpu/`); the body is the definition that it is tested against |
//! | `looped` | the CPU's loop over the body is written by hand there: what elements write is not in their order |
//! | `serial` | elements write where others do: the CPU runs them one after the other |
//! | `together` | on a GPU a workgroup computes an element, by the function of the kernel's name in [`bodies::together`](crate::bodies::together); the body is its definition, and what the CPU calls. All arrays that it reads are `filled` |
//! | `wide` | the CPU's loop is compiled for the widest vectors of the machine, too |
//! | `measured` | no production code calls it: it measures what a device can do at most |
//!
//! The kinds of arrays are
//!
//! | kind | the kernel | a device's method takes |
//! |---|---|---|
//! | `read` | reads it | a buffer |
//! | `filled` | reads it, and never looks at its length: it is not empty | a buffer |
//! | `paged` | reads it; it may be longer than a device can bind at once | a buffer |
//! | `one` | reads one struct | a buffer |
//! | `layer` | reads a layer's weights, not empty | the device's own form of them |
//! | `optional` | reads it, not empty, or `= other` in its place `if !block.flag` | a buffer or none, which sets the flag |
//! | `write` | writes its elements, and reads nothing of it | a buffer |
//! | `write_paged` | the same; it may be longer than a device can bind at once | a buffer |
//!
//! Buffers may be longer than the parameters say. [`for_each_kernel`](crate::for_each_kernel) hands all rows to a
//! macro, in the form of [`normal_rows`](crate::normal_rows), which alone knows the grammar above.
//!
//! A new kernel is its row, its body in [`bodies`](crate::bodies), a case with its `f64` evaluation in
//! `host/check/src/cases/`, and a faster form in `host/device/src/cpu/` where it has the mark `twin` or `looped`: three
//! files or four. Its entry points on a GPU and its loop on the CPU are made from the row. What is missing of body,
//! form and case does not compile; a module that was not compiled again (`cargo shaders`) fails a test.

mod kernel;
mod normal;
mod table;

pub use kernel::{Access, Array, Form, Kernel, Layout, Piece, SHARED_BYTES, WORKGROUP, tile_elements};

// What the rows name.
pub use crate::compact::RUN;
pub use crate::finite::FINITE_RUN;
pub use crate::gaussians::blend_gradient::SplatGradient;
pub use crate::gaussians::lists::{ListBlock, STATUS_NUMBERS, TILE_RUN};
pub use crate::gaussians::steps::{GainStepBlock, HarmonicTerm, ParticleBlock, ParticleState, StepBlock, TermState};
pub use crate::gaussians::windows::{GainBlock, LossBlock, SHARE_RUN};
pub use crate::gaussians::{SplatBlock, TileBlock};
pub use crate::genvs::{DenoiserInputBlock, FeatureBlock, VolumeBlock};
pub use crate::limits::{ChainBlock, LookUpBlock, RepeatedBlock};
pub use crate::network::attend::MatrixBlock;
pub use crate::network::convolve::ConvolveBlock;
pub use crate::network::depthwise::DepthwiseBlock;
pub use crate::network::group_norm::{GroupNormBlock, MeanBlock};
pub use crate::network::linear::LinearBlock;
pub use crate::network::resample::{PoolBlock, UpsampleBlock};
pub use crate::network::transpose::TransposedBlock;
pub use crate::pixelnerf::{EmbedBlock, GatherBlock};
pub use crate::plane_sweep::Planes;
pub use crate::plane_sweep::blend::BlendBlock;
pub use crate::plane_sweep::consistency::ConfirmBlock;
pub use crate::plane_sweep::evidence::ViewPair;
pub use crate::plane_sweep::front::FrontBlock;
pub use crate::plane_sweep::frustum::{FrustumBlock, SweptView};
pub use crate::plane_sweep::path::CostBlock;
pub use crate::plane_sweep::window::WindowBlock;
pub use crate::sample_mask::{RaysBlock, SampleMaskBlock};
pub use crate::visual_hull::ObjectBlock;
pub use crate::visual_hull::ray_marching::MarchBlock;
pub use crate::visual_hull::sweep::SweepBlock;
pub use viewfuse_core::camera::CameraBlock;
pub use viewfuse_core::composite::CompositeBlock;
pub use viewfuse_core::depths::{CoarseBlock, FineBlock};
pub use viewfuse_core::fuse::FuseBlock;
pub use viewfuse_core::gaussian::{GaussianBlock, ProjectedGaussian};
pub use viewfuse_core::half_precision::word_count;
pub use viewfuse_core::rays::{CastBlock, PlaceBlock, RayPoint, TargetRay};
pub use viewfuse_core::sampler::{Mix, NoiseBlock};
