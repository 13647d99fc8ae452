//! Layers of networks, one output number at a time.
//!
//! Images are `[row][column][channel]`, matrices `[row][column]`, flat and row-major. The functions here are the
//! definitions: sums run in the order of the inner index. Devices have faster forms (blocked matrix products), which
//! sum in another order and must agree with these within the rounding of the sum.
//!
//! An optional array (`residual`) may be any buffer where the block says that there is none.

pub mod attend;
pub mod convolve;
pub mod depthwise;
pub mod group_norm;
pub mod linear;
pub mod resample;
pub mod tile;
pub mod transpose;
