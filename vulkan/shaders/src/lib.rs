//! Entry points of the kernels on Vulkan devices.
//!
//! Nothing is computed here. An entry point has the name of its kernel, takes its arrays in the order of the list of
//! kernels (`viewfuse_vulkan::kernel`), its parameters and the piece as push constants, looks whether its element exists,
//! calls the function of `viewfuse-core` that is the kernel, and stores what that returns. Arrays that may be longer
//! than a device can bind at once come as four pages.
//!
//! ```text
//! weighting   how relevant each source is               weigh, embed_pose, attend
//! rays        where to look        cast_rays, coarse_depths, place_points, weigh_samples, draw_chances, fine_depths,
//!                                  merge_depths, wanted_samples
//! points      a network's ends     embed_points, visible_weights, gather_latents, radiance
//! volumes     what GeNVS sees      gather_volume, pack_halves, gather_halves, weigh_features,
//!                                  sum_features, denoiser_input
//! network     layers               convolve, convolve_depthwise, convolve_transposed, max_pool, upsample, product
//! normalise   moments of images    channel_means, part_moments, merge_moments, normalise
//! matrices    attention            multiply_matrices, softmax_rows
//! light       views become one, samples become a pixel  fuse_views, composite
//! sweep       the depths of source pixels               hull_entry, match_cost, sum_row, mean_column, pick_depth
//! march       a target pixel's ray                      march
//! sampler     from noise to a picture                   mix_pictures, add_noise
//! ```
//!
//! On the host the same entry points are plain functions, which tests call.
#![cfg_attr(target_arch = "spirv", no_std)]

pub mod light;
pub mod march;
pub mod matrices;
pub mod network;
pub mod normalise;
pub mod points;
pub mod rays;
pub mod sampler;
pub mod sweep;
mod tile;
mod unchecked;
pub mod volumes;
pub mod weighting;

/// Which elements a dispatch has: its invocation `i` works on element `first + i`, if `i < count`. The same bytes as
/// `viewfuse_vulkan::kernel::Piece`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Piece {
    /// The first element.
    pub first: u32,
    /// How many there are.
    pub count: u32,
}

/// Push constants of a kernel with parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Push<P> {
    /// What the kernel is told.
    pub parameters: P,
    /// Which elements.
    pub piece: Piece,
}
