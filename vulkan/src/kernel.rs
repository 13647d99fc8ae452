//! The list of kernels, which is one row a kernel in [`viewfuse_kernels::rows`].
//!
//! A kernel's entry point in `vulkan/shaders` has the kernel's name, unpacks its arguments and calls the body.
//! Everything about the entry point that this crate relies on follows from the row, and a test reads it back from the
//! compiled module.
//!
//! All arrays are storage buffers of descriptor set 0, numbered in the order of the row. An array in [`Layout::Pages`]
//! takes [`MAX_PAGES`](viewfuse_kernels::pages::MAX_PAGES) bindings. Push constants are the kernel's parameters, then
//! the [`Piece`]. The specialisation constant 0, where a kernel binds pages, is the binary logarithm of a page's
//! length, or 0 if all of the scene lies on first pages: choosing pages is then not built into the pipeline. The
//! constant 1, of [`Form::Subgroup`], is the size of a subgroup.

pub use viewfuse_kernels::network::tile::TILE;
pub use viewfuse_kernels::rows::{Access, Array, Form, Kernel, Layout, Piece, SHARED_BYTES, WORKGROUP, tile_elements};
