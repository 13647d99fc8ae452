//! Entry points of the kernels on Vulkan devices, made from the kernels' rows ([`viewfuse_kernels::rows`]).
//!
//! An entry point has the name of its kernel and takes its arrays in the order of the row, its parameters and the
//! [`Piece`] as push constants. It checks whether its element exists and calls the kernel's body
//! ([`viewfuse_kernels::bodies`]). Arrays that may be longer than a device can bind at once come as four pages; arrays
//! `as vectors` are loaded and stored as vectors (`loads`). A tiled kernel has an entry point for each form of a tile:
//! the first of the kernel's name, the other in a module of that name. What devices do otherwise than the CPU is here:
//! matrix products are summed in workgroup memory, by subgroups or by matrix units (`tile`), and a workgroup computes
//! an element `together`, both without a panic (`unchecked`).
//!
//! On the host the same entry points are plain functions, which are compiled and not called.
#![cfg_attr(target_arch = "spirv", no_std, feature(f16, asm_experimental_arch))]

#[macro_use]
mod entry;
pub mod loads;
mod tile;
mod unchecked;

pub use viewfuse_kernels::rows::Piece;

use core::marker::PhantomData;
use loads::{InVectors, Vectors, VectorsMut};
use spirv_std::glam::{UVec2, UVec3, Vec4};
use spirv_std::spirv;
#[cfg(target_arch = "spirv")]
use tile::Matrices;
use tile::{Half, HalfSmall, HalfTiny, StandIns, TwoHalves, TwoHalvesSmall, TwoHalvesTiny};
use tile::{InFours, Large, Least, SharedOfSingle, Small, Staged, Subgroup, Tiny, shared};
use tile::{Repeated, SharedOfRepeated};
use tile::{SharedOfHalf, SharedOfHalfSmall, SharedOfHalfTiny};
use tile::{SharedOfTwoHalves, SharedOfTwoHalvesSmall, SharedOfTwoHalvesTiny};
use unchecked::{Endless, EndlessFours, EndlessHalves, Together, Unchecked, UncheckedFours};
use viewfuse_kernels::bodies;
use viewfuse_kernels::for_each_kernel;
use viewfuse_kernels::network::tile::Shape;
use viewfuse_kernels::pages::{Pages, PagesMut};
use viewfuse_kernels::rows::*;

/// Push constants of a kernel with parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Push<P> {
    /// The kernel's parameters.
    pub parameters: P,
    /// The elements of the dispatch.
    pub piece: Piece,
}

for_each_kernel!(entries);

/// The forms of arrays in fours of the kernels that have them ([`Kernel::used_in_fours`]).
pub mod in_fours {
    entries_in_fours! {
        linear, LinearBlock, block [block.row_count, block.inner_count, block.column_count]
    }
    entries_in_fours! {
        convolve, ConvolveBlock, block [block.pixel_count(), block.patch_len(), block.out_channels]
    }
    entries_in_fours! {
        repeated repeat_product, RepeatedBlock, block [block.row_count, block.inner_count(), block.column_count]
    }
}
