//! Makes `kernels.spv`, the kernels as one SPIR-V module, from the entry points in `vulkan/shaders`.
//!
//! The module is checked in: users of viewfuse need no shader compiler. `cargo shaders` compiles it again,
//! `cargo shaders --check` compares it with a fresh compilation.
//!
//! ```text
//! backend   finds the compiler               a folder named by RUST_GPU_HOME, a cache, or the official toolchain
//! compile   sources -> module                spirv-builder, without its optimiser
//! legalise  module -> module                 no composites of pointers
//! share     module -> module                 workgroup memory is visible to all its invocations
//! refine    module -> module                 no paths, no contraction of float arithmetic
//! stamp     the sources of the module        sha256 of the sources and locked versions; kernels.toml
//! ```

pub mod backend;
pub mod compile;
pub mod legalise;
pub mod refine;
pub mod share;
pub mod stamp;
