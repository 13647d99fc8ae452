//! Makes `kernels.spv`, the kernels as one SPIR-V module, `subgroups.spv`, those that need operations of subgroups,
//! `matrices.spv`, those that need matrix units, and `stand_ins.spv`, by which these are tested on any device, from the
//! entry points in `vulkan/shaders`.
//!
//! The modules are checked in: users of viewfuse need no shader compiler. `cargo shaders` compiles them again,
//! `cargo shaders --check` compares them with a fresh compilation.
//!
//! ```text
//! backend   finds the compiler               a folder named by RUST_GPU_HOME, a cache, or the official toolchain
//! compile   sources -> modules               spirv-builder, without its optimiser
//! split     module -> modules                what not every device can do is a module of its own
//! phis      module -> module                 matrices join one by one, not as arrays
//! unroll    module -> module                 innermost loops of tiles are to be written out
//! legalise  module -> module                 no composites of pointers
//! loops     module -> module                 the branch on a loop's condition leaves the loop
//! share     module -> module                 workgroup memory is visible to all its invocations
//! refine    module -> module                 no paths, no contraction of float arithmetic
//! tokens    text -> tokens                   without comments, documentation and layout
//! stamp     the sources of the modules       sha256 of their tokens and locked versions; kernels.toml
//! ```

pub mod backend;
pub mod compile;
pub mod legalise;
pub mod loops;
pub mod phis;
pub mod refine;
pub mod share;
pub mod split;
pub mod stamp;
pub mod tokens;
pub mod unroll;
