//! Entry points of the kernels on Vulkan devices.
//!
//! An entry point has the name of its kernel and takes its arrays in the order of the kernel's row
//! ([`viewfuse_kernels::rows`]), its parameters and the [`Piece`] as push constants. It checks whether its element
//! exists, calls the kernel's body in `viewfuse-core` or the parts of that body, and stores the result. Arrays that may
//! be longer than a device can bind at once come as four pages. Elements of several numbers are loaded as vectors
//! (`loads`). Two things are computed here: the matrix products of tiled kernels are summed in workgroup memory or by
//! subgroups (`tile`), and a few short loops over a ray's samples or a row's columns are in the entry point.
//!
//! On the host the same entry points are plain functions, which tests call.
#![cfg_attr(target_arch = "spirv", no_std)]

pub mod compositing;
pub mod group_norm;
pub mod limits;
pub mod linear;
pub mod lists;
pub mod loads;
pub mod matrices;
pub mod network;
pub mod plane_sweep;
pub mod points;
pub mod ray_marching;
pub mod rays;
pub mod sampler;
pub mod sweep;
mod tile;
mod unchecked;
pub mod volumes;
pub mod weighting;

pub use viewfuse_kernels::rows::Piece;

/// Push constants of a kernel with parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Push<P> {
    /// The kernel's parameters.
    pub parameters: P,
    /// The elements of the dispatch.
    pub piece: Piece,
}
