//! Finds the shader compiler: a Rust toolchain with rust-gpu's code generator.
//!
//! The first of these that exists:
//! 1. the folder that [`HOME_VARIABLE`] names;
//! 2. a folder `rust-gpu-0.10.0-*` in the user's cache;
//! 3. rustup's toolchain [`NIGHTLY`], for which the code generator is built once, from its published sources.
//!
//! A folder holds `bin/cargo`, `bin/rustc` and the code generator in `lib`.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The environment variable that names a folder with the compiler.
pub const HOME_VARIABLE: &str = "RUST_GPU_HOME";
/// The release of rust-gpu.
pub const VERSION: &str = "0.10.0";
/// The toolchain that this release is made for.
pub const NIGHTLY: &str = "nightly-2026-07-03";
/// The advice if there is no compiler.
const ADVICE: &str = "install the official toolchain, `rustup toolchain install nightly-2026-07-03 --component \
    rust-src,rustc-dev,llvm-tools`, or let RUST_GPU_HOME name a folder with bin/cargo, bin/rustc and the code \
    generator of rust-gpu 0.10.0 in lib";

/// Why no compiler was found.
#[derive(Debug, thiserror::Error)]
pub enum BackendError {
    /// The named folder has no compiler.
    #[error("{HOME_VARIABLE} names {}, where {} is missing", .0.display(), .1.display())]
    Incomplete(PathBuf, PathBuf),
    /// None of the places has one.
    #[error("no compiler of rust-gpu {VERSION}: {ADVICE}")]
    None,
    /// A program that should provide one failed: its last message.
    #[error("{0} failed: {1}")]
    Failed(String, String),
    /// A file or folder of our own could not be written.
    #[error("{0}: {1}")]
    Write(PathBuf, #[source] std::io::Error),
}

/// An installed compiler.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Backend {
    /// rust-gpu's code generator.
    pub code_generator: PathBuf,
    /// How to run it.
    pub toolchain: Toolchain,
}

/// The cargo and rustc that load the code generator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Toolchain {
    /// The programs in this folder.
    Folder(PathBuf),
    /// A toolchain that rustup knows by this name.
    Rustup(String),
}

impl Backend {
    /// The compiler in a folder.
    ///
    /// # Errors
    /// The missing file.
    pub fn in_folder(home: &Path) -> Result<Backend, PathBuf> {
        let program = |name: &str| home.join("bin").join(format!("{name}{}", env::consts::EXE_SUFFIX));
        let code_generator = home.join("lib").join(code_generator_name());
        match [program("cargo"), program("rustc"), code_generator.clone()].into_iter().find(|path| !path.is_file()) {
            Some(missing) => Err(missing),
            None => Ok(Backend { code_generator, toolchain: Toolchain::Folder(home.join("bin")) }),
        }
    }

    /// The compiler of this machine.
    ///
    /// # Errors
    /// [`BackendError`], with what to install.
    pub fn find() -> Result<Backend, BackendError> {
        if let Some(home) = env::var_os(HOME_VARIABLE).filter(|home| !home.is_empty()).map(PathBuf::from) {
            return Backend::in_folder(&home).map_err(|missing| BackendError::Incomplete(home, missing));
        }
        if let Some(backend) = cached() {
            return Ok(backend);
        }
        let installed = output_of(Command::new("rustup").args(["toolchain", "list"])).unwrap_or_default();
        if installed.lines().any(|line| line.starts_with(NIGHTLY)) {
            return official();
        }
        Err(BackendError::None)
    }

    /// The versions of rustc and of rust-gpu in one line, as kernels.toml records them. It names no path.
    ///
    /// # Errors
    /// If rustc does not run.
    pub fn version(&self) -> Result<String, BackendError> {
        let rustc = match &self.toolchain {
            Toolchain::Folder(bin) => output_of(Command::new(bin.join("rustc")).arg("--version"))?,
            Toolchain::Rustup(name) => output_of(Command::new("rustc").arg(format!("+{name}")).arg("--version"))?,
        };
        Ok(format!("rust-gpu {VERSION}, {}", rustc.trim()))
    }

    /// The search path under which plain `cargo` is the compiler's, if the compiler is a folder of programs.
    pub fn program_path(&self) -> Option<OsString> {
        match &self.toolchain {
            Toolchain::Folder(bin) => {
                let before = env::var_os("PATH").unwrap_or_default();
                env::join_paths(std::iter::once(bin.clone()).chain(env::split_paths(&before))).ok()
            }
            Toolchain::Rustup(_) => None,
        }
    }
}

fn code_generator_name() -> String {
    format!("{}rustc_codegen_spirv{}", env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX)
}

/// The user's cache folder.
fn cache() -> Option<PathBuf> {
    let named = |variable: &str| env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from);
    named("XDG_CACHE_HOME").or_else(|| Some(env::home_dir()?.join(".cache")))
}

/// The compiler in the cache: the last by name of the complete ones.
fn cached() -> Option<Backend> {
    let prefix = format!("rust-gpu-{VERSION}-");
    let mut homes: Vec<PathBuf> = fs::read_dir(cache()?)
        .ok()?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&prefix)))
        .collect();
    homes.sort();
    homes.iter().rev().find_map(|home| Backend::in_folder(home).ok())
}

/// The official toolchain with the code generator as published, built once into the cache.
fn official() -> Result<Backend, BackendError> {
    let folder = cache().ok_or(BackendError::None)?.join(format!("viewfuse-rust-gpu-{VERSION}-{NIGHTLY}"));
    let code_generator = folder.join("target").join("release").join(code_generator_name());
    if !code_generator.is_file() {
        let write = |path: PathBuf, text: String| {
            let made = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::write(&path, text));
            made.map_err(|cause| BackendError::Write(path, cause))
        };
        // A library of cargo's kind is built only as a dependency of a package.
        write(folder.join("src").join("lib.rs"), String::new())?;
        write(
            folder.join("Cargo.toml"),
            format!(
                "[package]\nname = \"rust-gpu-of-viewfuse\"\nedition = \"2024\"\n\n[workspace]\n\n\
                 [dependencies]\nrustc_codegen_spirv = \"={VERSION}\"\n"
            ),
        )?;
        eprintln!("building the code generator of rust-gpu {VERSION}, once");
        let mut cargo = Command::new("cargo");
        cargo.arg(format!("+{NIGHTLY}")).args(["build", "--release"]).current_dir(&folder);
        // Those of the cargo that runs this program would undo the choice of the toolchain.
        for variable in
            ["CARGO", "RUSTC", "RUSTUP_TOOLCHAIN", "RUSTFLAGS", "CARGO_TARGET_DIR", "CARGO_ENCODED_RUSTFLAGS"]
        {
            cargo.env_remove(variable);
        }
        output_of(&mut cargo)?;
        if !code_generator.is_file() {
            let reason = format!("it did not build {}", code_generator.display());
            return Err(BackendError::Failed(format!("{cargo:?}"), reason));
        }
    }
    Ok(Backend { code_generator, toolchain: Toolchain::Rustup(NIGHTLY.to_owned()) })
}

/// The output of a program.
fn output_of(command: &mut Command) -> Result<String, BackendError> {
    let failed = |command: &Command, reason: String| {
        BackendError::Failed(command.get_program().to_string_lossy().into_owned(), reason)
    };
    let output = command.output().map_err(|error| failed(command, error.to_string()))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last: Vec<&str> = said.lines().rev().take(8).collect();
        let last = last.into_iter().rev().collect::<Vec<_>>().join("\n");
        return Err(failed(command, format!("{}\n{last}", output.status)));
    }
    String::from_utf8(output.stdout).map_err(|error| failed(command, error.to_string()))
}
