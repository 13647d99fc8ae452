//! Compiles the sources to modules.
//!
//! rust-gpu's optimiser (SPIRV-Tools) is not used: it may rewrite float arithmetic that is not marked against
//! contraction, such as `(a - b) + b` to `a`, and the marks come after it. rust-gpu's own passes (inlining, memory to
//! registers, dead code) stay.

use crate::backend::{Backend, Toolchain};
use crate::phis::split_phis;
use crate::refine::{RefineError, refine};
use crate::split::{CAPABILITIES, FORMS_IN_FOURS, MATRIX_EXTENSION, Modules, split};
use crate::unroll::unroll;
use rspirv::spirv::Capability;
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
    builder.extensions = vec![MATRIX_EXTENSION.to_owned()];
    builder.extra_args = vec!["--no-spirv-opt".to_owned()];
    // This is not a build script: no instructions to cargo.
    builder.build_script.defaults = false;
    if let Toolchain::Rustup(name) = &backend.toolchain {
        builder.toolchain_overwrite = Some(name.clone());
    }
    let compiled = builder.build()?;
    let path = compiled.module.unwrap_single();
    let bytes = std::fs::read(path).map_err(|cause| CompileError::Read(path.to_path_buf(), cause))?;
    let Modules { kernels, subgroups, matrices, stand_ins } = split(&bytes)?;
    let of_tiles =
        |bytes: &[u8], is_chosen: fn(&str) -> bool| unroll(&refine(&split_phis(bytes, is_chosen)?)?, is_chosen);
    let is_in_fours = |name: &str| name.split_once("::").is_some_and(|(_, form)| FORMS_IN_FOURS.contains(&form));
    Ok(Modules {
        kernels: of_tiles(&kernels, is_in_fours)?,
        subgroups: refine(&subgroups)?,
        matrices: of_tiles(&matrices, |_| true)?,
        // Only software drivers run these: they would write out more than they can compile.
        stand_ins: refine(&split_phis(&stand_ins, |_| true)?)?,
    })
}

/// The environment variable that names the validator in the place of `spirv-val`.
pub const VALIDATOR_VARIABLE: &str = "SPIRV_VAL";

/// What a validator said of a module that it did not reject.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Validation {
    /// It is valid.
    Accepted,
    /// There is no validator.
    NotInstalled,
    /// The validator is older than matrix units are in SPIR-V.
    TooOld,
}

impl std::fmt::Display for Validation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Validation::Accepted => "accepted by spirv-val",
            Validation::NotInstalled => "not validated: spirv-val is not installed",
            Validation::TooOld => {
                "not validated: this spirv-val does not know matrix units; SPIRV_VAL may name a newer one"
            }
        })
    }
}

/// Validates a module by `spirv-val`, or the program that [`VALIDATOR_VARIABLE`] names, for the versions of Vulkan that
/// it is meant for.
///
/// # Errors
/// [`CompileError::Invalid`], or [`CompileError::Read`] for a file that could not be written.
pub fn validate(module: &[u8], target: &Path) -> Result<Validation, CompileError> {
    let program = std::env::var_os(VALIDATOR_VARIABLE).unwrap_or_else(|| "spirv-val".into());
    let path = target.join("refined.spv");
    std::fs::write(&path, module).map_err(|cause| CompileError::Read(path.clone(), cause))?;
    for environment in ["vulkan1.1", "vulkan1.2", "vulkan1.3"] {
        let Ok(output) = Command::new(&program).args(["--target-env", environment]).arg(&path).output() else {
            return Ok(Validation::NotInstalled);
        };
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
            // The number of the capability, in a parser that has no name for it.
            let is_unknown =
                said.contains(&format!("Invalid capability operand: {}", Capability::CooperativeMatrixKHR as u32));
            return if is_unknown { Ok(Validation::TooOld) } else { Err(CompileError::Invalid(environment, said)) };
        }
    }
    Ok(Validation::Accepted)
}
