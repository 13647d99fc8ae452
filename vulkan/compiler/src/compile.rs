//! Compiles the sources to modules.
//!
//! rust-gpu's optimiser (SPIRV-Tools) is not used: it may rewrite float arithmetic that is not marked against
//! contraction, such as `(a - b) + b` to `a`, and the marks come after it. rust-gpu's own passes (inlining, memory to
//! registers, dead code) stay.

use crate::backend::{Backend, Toolchain};
use crate::refine::{RefineError, refine};
use crate::split::{CAPABILITIES, Modules, split};
use spirv_builder::{SpirvBuilder, SpirvBuilderError};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The target of the modules: Vulkan 1.1 and later.
pub const TARGET: &str = "spirv-unknown-vulkan1.1";

/// Why compiling failed.
#[derive(Debug, thiserror::Error)]
pub enum CompileError {
    /// The compiler failed; its messages are already on standard error.
    #[error("the kernels do not compile: {0}")]
    Compiler(#[from] SpirvBuilderError),
    /// The module could not be read.
    #[error("{0}: {1}")]
    Read(PathBuf, #[source] std::io::Error),
    /// The module is invalid.
    #[error(transparent)]
    Refine(#[from] RefineError),
    /// The validator rejected the module for a version of Vulkan: its message.
    #[error("spirv-val, for {0}: {1}")]
    Invalid(&'static str, String),
}

/// The modules of the sources in the repository `root`, built in `target`.
///
/// # Errors
/// [`CompileError`].
pub fn compile(backend: &Backend, root: &Path, target: &Path) -> Result<Modules, CompileError> {
    let mut builder = SpirvBuilder::new(root.join("vulkan").join("shaders"), TARGET);
    builder.rustc_codegen_spirv_location = Some(backend.code_generator.clone());
    builder.target_dir_path = Some(target.to_path_buf());
    builder.capabilities = CAPABILITIES.to_vec();
    builder.extra_args = vec!["--no-spirv-opt".to_owned()];
    // This is not a build script: no instructions to cargo.
    builder.build_script.defaults = false;
    if let Toolchain::Rustup(name) = &backend.toolchain {
        builder.toolchain_overwrite = Some(name.clone());
    }
    let compiled = builder.build()?;
    let path = compiled.module.unwrap_single();
    let bytes = std::fs::read(path).map_err(|cause| CompileError::Read(path.to_path_buf(), cause))?;
    let Modules { kernels, subgroups } = split(&bytes)?;
    Ok(Modules { kernels: refine(&kernels)?, subgroups: refine(&subgroups)? })
}

/// Validates a module by `spirv-val`, for the versions of Vulkan that it is meant for. Returns whether the program
/// is installed.
///
/// # Errors
/// [`CompileError::Invalid`], or [`CompileError::Read`] for a file that could not be written.
pub fn validate(module: &[u8], target: &Path) -> Result<bool, CompileError> {
    let path = target.join("refined.spv");
    std::fs::write(&path, module).map_err(|cause| CompileError::Read(path.clone(), cause))?;
    for environment in ["vulkan1.1", "vulkan1.2", "vulkan1.3"] {
        let Ok(output) = Command::new("spirv-val").args(["--target-env", environment]).arg(&path).output() else {
            return Ok(false);
        };
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
            return Err(CompileError::Invalid(environment, said));
        }
    }
    Ok(true)
}
