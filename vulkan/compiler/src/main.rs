//! `cargo shaders`: writes the modules of the kernels and `kernels.toml`, or checks that they are up to date.

use std::env;
use std::error::Error;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use viewfuse_shader_compiler::backend::{Backend, BackendError, HOME_VARIABLE, Toolchain};
use viewfuse_shader_compiler::compile::{compile, validate};
use viewfuse_shader_compiler::loops::{Joined, joined};
use viewfuse_shader_compiler::refine::read;
use viewfuse_shader_compiler::split::Modules;
use viewfuse_shader_compiler::stamp::{Inputs, STAMP, Stamp};

const USAGE: &str = "usage: cargo shaders [--check]
Makes vulkan/src/kernels.spv, subgroups.spv, matrices.spv, stand_ins.spv and kernels.toml from the sources.
  --check    writes nothing; compiles and compares, exit code 1 if anything differs
Exit code 3 if there is no shader compiler.";

/// Exit code if there is no compiler, so that nothing could be checked.
const NO_COMPILER: u8 = 3;

/// Environment variables that would change the compilation.
const FORBIDDEN: [&str; 3] = ["RUSTGPU_CODEGEN_ARGS", "RUSTGPU_RUSTFLAGS", "RUSTGPU_CARGOFLAGS"];

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let check = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] => false,
        ["--check"] => true,
        ["--help" | "-h"] => {
            println!("{USAGE}");
            return ExitCode::SUCCESS;
        }
        _ => {
            eprintln!("{USAGE}");
            return ExitCode::from(2);
        }
    };
    run(check).unwrap_or_else(|error| {
        eprintln!("error: {error}");
        ExitCode::FAILURE
    })
}

fn run(check: bool) -> Result<ExitCode, Box<dyn Error>> {
    // At run time: a target folder may be shared by several checkouts.
    let package =
        env::var_os("CARGO_MANIFEST_DIR").ok_or("CARGO_MANIFEST_DIR is not set: run this as `cargo shaders`")?;
    let root = fs::canonicalize(Path::new(&package).join("..").join(".."))?;
    let backend = match Backend::find() {
        Err(error @ BackendError::None) => {
            eprintln!("{error}");
            return Ok(ExitCode::from(NO_COMPILER));
        }
        found => found?,
    };
    if let Some(code) = run_prepared(&backend)? {
        return Ok(code);
    }
    let inputs = Inputs::read(&root)?;
    let program = env::current_exe()?;
    let target =
        program.parent().and_then(Path::parent).ok_or("the program is not in a target folder")?.join("shaders");
    let modules = compile(&backend, &root, &target)?;
    let mut validations = Vec::new();
    for (_, bytes) in modules.named() {
        validations.push(validate(bytes, &target)?);
    }
    let stamp = Stamp::new(backend.version()?, &modules, inputs);
    if check {
        return compare(&root, &modules, &stamp);
    }
    for (name, bytes) in modules.named() {
        fs::write(root.join(name), bytes).map_err(|error| format!("{name}: {error}"))?;
    }
    fs::write(root.join(STAMP), stamp.text()).map_err(|error| format!("{STAMP}: {error}"))?;
    for ((name, bytes), validated) in modules.named().into_iter().zip(validations) {
        println!("{name}: {} bytes by {}; {validated}", bytes.len(), stamp.compiler);
        for Joined { function, kept } in joined(&read(bytes)?) {
            let why = kept.map_or_else(|| "for no reason".to_owned(), |reason| reason.to_string());
            println!("  {function}: a loop keeps its shape: {why}");
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Compares the fresh compilation with the checked-in modules.
fn compare(root: &Path, modules: &Modules, compiled: &Stamp) -> Result<ExitCode, Box<dyn Error>> {
    let stored = Modules::read(root)?;
    let stamp = Stamp::read(root)?;
    let mut stale = stamp.stale(&compiled.inputs, &stored);
    for ((name, stored), (_, module)) in stored.named().into_iter().zip(modules.named()) {
        if stored != module {
            stale.push(format!(
                "{name} is stale: it has {} bytes, compiled by {}; compiled now: {} bytes by {}",
                stored.len(),
                stamp.compiler,
                module.len(),
                compiled.compiler
            ));
        }
    }
    if stale.is_empty() {
        println!("the modules are up to date");
        return Ok(ExitCode::SUCCESS);
    }
    stale.iter().for_each(|difference| eprintln!("{difference}"));
    eprintln!("stale: run `cargo shaders` and commit the modules and {STAMP}");
    Ok(ExitCode::FAILURE)
}

/// spirv-builder takes cargo from the search path and options from the environment. If those are not the required ones,
/// this program runs itself again in a correct environment and returns the outcome.
fn run_prepared(backend: &Backend) -> Result<Option<ExitCode>, Box<dyn Error>> {
    let search = backend.program_path();
    let is_right =
        search.as_ref().is_none_or(|search| first_of(Some(search)) == first_of(env::var_os("PATH").as_ref()));
    if is_right && FORBIDDEN.iter().all(|variable| env::var_os(variable).is_none()) {
        return Ok(None);
    }
    let mut again = Command::new(env::current_exe()?);
    again.args(env::args_os().skip(1));
    FORBIDDEN.iter().for_each(|variable| _ = again.env_remove(variable));
    if let (Some(search), Toolchain::Folder(bin)) = (search, &backend.toolchain) {
        again.env("PATH", search);
        again.env(HOME_VARIABLE, bin.join(".."));
    }
    let code = again.status()?.code().and_then(|code| u8::try_from(code).ok());
    Ok(Some(code.map_or(ExitCode::FAILURE, ExitCode::from)))
}

/// The first folder of a search path.
fn first_of(search: Option<&OsString>) -> Option<PathBuf> {
    env::split_paths(search?).next().and_then(|folder| fs::canonicalize(folder).ok())
}
