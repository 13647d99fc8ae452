//! The mathematics of viewfuse, at fixed sizes.
//!
//! Everything here is `no_std`, free of allocation and of `unsafe`, and computes in `f32` and 32-bit integers (only the
//! metrics, which never run on a device, in `f64`; lenses in either), so that one body serves as the definition on a workstation, as the
//! source of a GPU kernel and as firmware. The modules stand in the order of the data:
//!
//! ```text
//! math              one result on every target                    sqrt, exp, sin_cos, angles, norms
//! pages             reading elements wherever they lie             Fetch, Pages
//! compact           which elements a mask marks, as a list         marked_in_run, run_offsets, list_run
//! finite            where the first NaN or infinity is             first_non_finite
//! half_precision    two numbers in a word (f16)                    f16_bits, f16_value, packed_f16
//! pose, camera      where the photographs were taken              Pose, Pinhole, Camera, Ray, Projection
//! lens              what a lens does to a pinhole's image          Lens, LensBlock: distort, undistort
//! sources           the poses of the source views                 Sources<S>
//! weights           how much each source counts                   Weights<S>: finite, >= 0, sum 1; leaving views out
//! weighting         pose -> weight, by formula                    Scheme, weigh
//! attention         pose -> weight, by (learned) attention        CrossAttention, PoseSelfAttention, ...
//! random            numbers for (seed, pixel, sample)             uniform, normal
//! rays, depths      where along which ray to look                 TargetRay, RayPoint, stratified_depth, inverse_cdf
//! lookup            what a view shows there                       bilinear, trilinear
//! fuse              the views' latents become one                 fuse_views, fuse_visible
//! composite         samples along a ray become a pixel            Compositor<C>
//! sample_mask       which samples can be left out                 is_sampled
//! network           layers                                        linear, convolve, group_norm, attend, resample
//! pixelnerf         a point in, radiance out                      embedded_value, gathered_value, radiance
//! genvs             volumes of features become a feature image    VolumePlace, weigh_features, denoiser_input
//! schedule          from noise to a picture                       NoiseSchedule, Preconditioning, HeunStep
//! sampler           ... with few calls of the denoiser            Sampler, Mix, History, Churn, verdict
//! visual_hull       the training-free field in silhouettes     matched depth, signed distance, density and colour
//! plane_sweep       ... and for any scene                      evidence, census, paths, disparity, blend
//! metrics           how good is the picture                       psnr, ssim
//! kernels           the list of kernels, one row each             Kernel, for_each_kernel
//! ```
//!
//! A module uses only modules listed above it. Types that are checked when they are built ([`pose::Pose`],
//! [`camera::Pinhole`], [`weights::Weights`]) go in; functions on them are total and say what degenerate input gives.
#![no_std]
#![forbid(unsafe_code)]

pub mod attention;
pub mod camera;
pub mod compact;
pub mod composite;
pub mod depths;
pub mod finite;
pub mod fuse;
pub mod genvs;
pub mod half_precision;
pub mod kernels;
pub mod lens;
pub mod lookup;
pub mod math;
pub mod metrics;
pub mod network;
pub mod pages;
pub mod pixelnerf;
pub mod plane_sweep;
pub mod pose;
pub mod random;
pub mod rays;
pub mod sample_mask;
pub mod sampler;
pub mod schedule;
pub mod sources;
pub mod visual_hull;
pub mod weighting;
pub mod weights;

pub use glam::Vec3;
