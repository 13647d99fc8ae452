//! The kernels of viewfuse: functions of one output element each, and the rows that declare them.
//!
//! A kernel's body ([`bodies`]) is made of the mathematics of `viewfuse-core`; the CPU calls it in a loop, and an entry
//! point on a Vulkan device calls it for its invocation. Everything here is `no_std`, free of allocation and of
//! `unsafe`, and computes in `f32` and 32-bit integers. The modules are listed in the order of the data:
//!
//! ```text
//! store             writing elements by index                       Store
//! pages             buffers in several pages                        Pages, PagesMut
//! workgroup         memory and barrier of a workgroup               Workgroup
//! compact           which elements a mask marks, as a list         marked_in_run, run_offsets, list_run
//! finite            where the first NaN or infinity is             first_non_finite
//! sample_mask       which samples can be left out                  is_sampled
//! network           layers                                         linear, convolve, group_norm, attend, resample
//! pixelnerf         point embedding, latents, radiance             embedded_value, GridPlace, radiance
//! genvs             volumes of features become a feature image     VolumePlace, weigh_features, denoiser_input
//! visual_hull       the training-free field inside silhouettes     matched depth, signed distance, density and colour
//! plane_sweep       the training-free field for any scene          evidence, census, paths, disparity, blend
//! gaussians         Gaussians of a scene: pictures and derivatives    BlendedLanes, TileGradient, project_gradient
//! limits            what a device can do at most                   chained, copied, looked_up
//! bodies            the kernels: a function of one element each
//! rows              the list of kernels, one row each              Kernel, for_each_kernel
//! ```
//!
//! A module uses only modules listed above it. Bodies are total functions and say what degenerate input gives.
#![no_std]
#![forbid(unsafe_code)]

pub mod bodies;
pub mod compact;
pub mod finite;
pub mod gaussians;
pub mod genvs;
pub mod limits;
pub mod network;
pub mod pages;
pub mod pixelnerf;
pub mod plane_sweep;
pub mod rows;
pub mod sample_mask;
pub mod store;
pub mod visual_hull;
pub mod workgroup;
