//! The mathematics of viewfuse, at fixed sizes.
//!
//! Everything here is `no_std`, free of allocation and of `unsafe`, and computes in `f32` and 32-bit integers (only the
//! metrics, which never run on a device, in `f64`; lenses in either), so that one body serves as the definition on a
//! workstation, as a part of a GPU kernel and as firmware. The modules are listed in the order of the data:
//!
//! ```text
//! math              one result on every target                     sqrt, exp, sin_cos, angles, norms
//! fetch             elements by index, wherever they lie           Fetch, StartingAt
//! half_precision    two numbers in a word (f16)                    f16_bits, f16_value, packed_f16
//! pose, camera      camera poses and intrinsics                    Pose, Pinhole, Camera, Ray, Projection
//! lens              lens distortion                                Lens, LensBlock: distort, undistort
//! sources           the poses of the source views                  Sources<S>
//! weights           weights of the source views                    Weights<S>: finite, >= 0, sum 1; leaving views out
//! weighting         pose -> weight, by formula                     Scheme, weigh
//! attention         pose -> weight, by (learned) attention         CrossAttention, PoseSelfAttention, ...
//! random            random draws for (seed, pixel, sample)         uniform, normal
//! rays, depths      target rays and samples along them             TargetRay, RayPoint, stratified_depth, inverse_cdf
//! lookup            interpolation in grids                         bilinear
//! fuse              weighted sums of the views' latents            fuse_views, fuse_visible, fuse_readings
//! composite         compositing of the samples along a ray         Compositor<C>
//! gaussian          Gaussians in the world, and projected          GaussianBlock, ProjectedGaussian, project, composite_row
//! schedule          noise levels of the diffusion denoiser         NoiseSchedule, Preconditioning, HeunStep
//! sampler           samplers with few calls of the denoiser        Sampler, Mix, History, Churn, verdict
//! metrics           picture quality                                psnr, ssim
//! ```
//!
//! A module uses only modules listed above it. Types that are checked when they are built ([`pose::Pose`],
//! [`camera::Pinhole`], [`weights::Weights`]) go in; functions on them are total and say what degenerate input gives.
#![no_std]
#![forbid(unsafe_code)]

pub mod attention;
pub mod camera;
pub mod composite;
pub mod depths;
pub mod fetch;
pub mod fuse;
pub mod gaussian;
pub mod half_precision;
pub mod lens;
pub mod lookup;
pub mod math;
pub mod metrics;
pub mod pose;
pub mod random;
pub mod rays;
pub mod sampler;
pub mod schedule;
pub mod sources;
pub mod weighting;
pub mod weights;

pub use glam::Vec3;
