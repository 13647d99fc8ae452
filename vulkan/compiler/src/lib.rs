//! Makes `kernels.spv`, the kernels as one SPIR-V module, from the entry points in `vulkan/shaders`.
//!
//! The module is checked in: whoever uses viewfuse needs no shader compiler. `cargo shaders` makes it anew,
//! `cargo shaders --check` compares it with what the sources give.
//!
//! ```text
//! backend   where the compiler is            a folder named by RUST_GPU_HOME, a cache, or the official toolchain
//! compile   sources -> module                spirv-builder, without its optimiser
//! legalise  module -> module                 no composites of pointers
//! share     module -> module                 a workgroup's memory is its invocations' common one
//! refine    module -> module                 no trace of paths, no contraction of float arithmetic
//! stamp     what the module was made from    sha256 of the sources and locked versions; kernels.toml
//! ```

pub mod backend;
pub mod compile;
pub mod legalise;
pub mod refine;
pub mod share;
pub mod stamp;
