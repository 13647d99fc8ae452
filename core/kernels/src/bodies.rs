//! The bodies: for each kernel the function of its name, which computes one element.
//!
//! A body takes the kernel's parameters, its arrays in the order of the row and the number of the element. It reads
//! arrays through slices, or through [`Fetch`](viewfuse_core::fetch::Fetch) where a device has them in pages or loads
//! vectors, and writes through [`Store`](crate::store::Store), at the index that the row's documentation says. Devices
//! call it: the CPU in a loop ([`for_each_kernel`](crate::for_each_kernel) makes both), a GPU for each invocation. That
//! of a tiled kernel hands the two matrices and what happens to a sum to the device's tiles. Where a workgroup computes
//! an element together, the function of an invocation is in [`together`].

mod gaussians;
mod layers;
mod lists;
mod optimisation;
mod pictures;
mod plane_sweep;
mod points;
mod rays;
mod tiled;
pub mod together;
mod visual_hull;
mod volumes;

pub use gaussians::*;
pub use layers::*;
pub use lists::*;
pub use optimisation::*;
pub use pictures::*;
pub use plane_sweep::*;
pub use points::*;
pub use rays::*;
pub use tiled::*;
pub use visual_hull::*;
pub use volumes::*;
