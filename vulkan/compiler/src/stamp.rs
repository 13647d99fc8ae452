//! The sources of the modules: `kernels.toml`.
//!
//! It holds the sha256 of the tokens of every source that determines the modules' bytes, the locked versions of the
//! libraries that become part of them, the sha256 of the modules and the version of the compiler. So a test without a
//! compiler finds a stale module.
//!
//! A comment, documentation or layout makes nothing stale. Neither does a module of `viewfuse-core` that no kernel
//! reaches: its sources count from the modules that kernels and entry points name, along what these modules name.

use crate::split::Modules;
use crate::tokens::{names_in, tokens, without_modules};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// The module for every device, relative to the repository.
pub const MODULE: &str = "vulkan/src/kernels.spv";
/// The module for devices with the operations of subgroups.
pub const SUBGROUPS: &str = "vulkan/src/subgroups.spv";
/// The module for devices with matrix units.
pub const MATRICES: &str = "vulkan/src/matrices.spv";
/// The module that stands in for it on other devices, for tests.
pub const STAND_INS: &str = "vulkan/src/stand_ins.spv";
/// Their stamp.
pub const STAMP: &str = "vulkan/src/kernels.toml";
/// The manifests of what becomes part of the modules: their dependencies, features and kinds of library count.
pub const MANIFESTS: [&str; 3] = ["core/Cargo.toml", "core/kernels/Cargo.toml", "vulkan/shaders/Cargo.toml"];
/// The folder of `viewfuse-core`, of which only the modules count that kernels reach.
pub const CORE: &str = "core/src";
/// Source files, and folders with all their Rust files.
pub const SOURCES: [&str; 9] = [
    "core/kernels/src", "vulkan/compiler/src/compile.rs", "vulkan/compiler/src/legalise.rs",
    "vulkan/compiler/src/loops.rs", "vulkan/compiler/src/phis.rs", "vulkan/compiler/src/refine.rs",
    "vulkan/compiler/src/share.rs", "vulkan/compiler/src/split.rs", "vulkan/shaders/src",
];
/// Libraries with code in the modules.
pub const LIBRARIES: [&str; 6] = ["bytemuck", "bytemuck_derive", "glam", "libm", "spirv-std", "spirv-std-macros"];

/// Why the stamp cannot be computed or read.
#[derive(Debug, thiserror::Error)]
pub enum StampError {
    /// A file cannot be read or written.
    #[error("{0}: {1}")]
    File(PathBuf, #[source] std::io::Error),
    /// A file has invalid content: the place and the problem.
    #[error("{0}: {1}")]
    Format(PathBuf, #[source] toml::de::Error),
    /// A source is not Rust.
    #[error("{0}: {1}")]
    Source(PathBuf, String),
    /// Cargo.lock has not this library.
    #[error("{0}: has no package {1}")]
    Unlocked(PathBuf, &'static str),
}

/// The inputs that determine the modules' bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    /// Locked versions by library, with their checksums.
    pub libraries: BTreeMap<String, String>,
    /// sha256 of a source's tokens by file, relative to the repository.
    pub sources: BTreeMap<String, String>,
}

/// The modules' inputs and compiler.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stamp {
    /// Versions of rust-gpu and rustc.
    pub compiler: String,
    /// sha256 of the module for every device.
    pub module: String,
    /// sha256 of the module for devices with the operations of subgroups.
    pub subgroups: String,
    /// sha256 of the module for devices with matrix units.
    pub matrices: String,
    /// sha256 of the module that stands in for it.
    pub stand_ins: String,
    /// What they were made from.
    #[serde(flatten)]
    pub inputs: Inputs,
}

#[derive(Deserialize)]
struct Lock {
    package: Vec<Locked>,
}

#[derive(Deserialize)]
struct Locked {
    name: String,
    version: String,
    #[serde(default)]
    checksum: String,
}

impl Modules {
    /// The checked-in modules.
    ///
    /// # Errors
    /// [`StampError`], with the file.
    pub fn read(root: &Path) -> Result<Modules, StampError> {
        let bytes = |name| {
            let path = root.join(name);
            fs::read(&path).map_err(|cause| StampError::File(path, cause))
        };
        Ok(Modules {
            kernels: bytes(MODULE)?,
            subgroups: bytes(SUBGROUPS)?,
            matrices: bytes(MATRICES)?,
            stand_ins: bytes(STAND_INS)?,
        })
    }

    /// Each with its file, relative to the repository.
    pub fn named(&self) -> [(&'static str, &[u8]); 4] {
        let Modules { kernels, subgroups, matrices, stand_ins } = self;
        [(MODULE, kernels), (SUBGROUPS, subgroups), (MATRICES, matrices), (STAND_INS, stand_ins)]
    }
}

impl Inputs {
    /// The inputs in the repository `root`.
    ///
    /// # Errors
    /// [`StampError`], with the file.
    pub fn read(root: &Path) -> Result<Inputs, StampError> {
        let mut sources = BTreeMap::new();
        for manifest in MANIFESTS {
            sources.insert(manifest.to_owned(), sha256(manifest_of(&root.join(manifest))?.as_bytes()));
        }
        let mut read = BTreeMap::new();
        for source in SOURCES {
            read_all(root, source, &mut read)?;
        }
        read_core(root, &mut read)?;
        sources.extend(read.into_iter().map(|(file, tokens)| (file, sha256(tokens.join("\n").as_bytes()))));
        let path = root.join("Cargo.lock");
        let lock: Lock = toml::from_str(&read_text(&path)?).map_err(|cause| StampError::Format(path.clone(), cause))?;
        let mut libraries = BTreeMap::new();
        for library in LIBRARIES {
            let locked: Vec<String> = lock
                .package
                .iter()
                .filter(|package| package.name == library)
                .map(|package| format!("{} {}", package.version, package.checksum))
                .collect();
            if locked.is_empty() {
                return Err(StampError::Unlocked(path, library));
            }
            libraries.insert(library.to_owned(), locked.join(", "));
        }
        Ok(Inputs { libraries, sources })
    }
}

impl Stamp {
    /// The checked-in stamp.
    ///
    /// # Errors
    /// [`StampError`], with the file.
    pub fn read(root: &Path) -> Result<Stamp, StampError> {
        let path = root.join(STAMP);
        toml::from_str(&read_text(&path)?).map_err(|cause| StampError::Format(path, cause))
    }

    /// The file's text.
    pub fn text(&self) -> String {
        let mut text = format!(
            "# What kernels.spv, subgroups.spv, matrices.spv and stand_ins.spv were made from; written by `cargo \
                shaders`.\n\
             compiler = {:?}\nmodule = {:?}\nsubgroups = {:?}\nmatrices = {:?}\nstand_ins = {:?}\n",
            self.compiler, self.module, self.subgroups, self.matrices, self.stand_ins
        );
        for (name, table) in [("libraries", &self.inputs.libraries), ("sources", &self.inputs.sources)] {
            text += &format!("\n[{name}]\n");
            for (key, value) in table {
                text += &format!("{key:?} = {value:?}\n");
            }
        }
        text
    }

    /// Of modules that were made from these inputs.
    pub fn new(compiler: String, modules: &Modules, inputs: Inputs) -> Stamp {
        let [module, subgroups, matrices, stand_ins] = modules.named().map(|(_, bytes)| sha256(bytes));
        Stamp { compiler, module, subgroups, matrices, stand_ins, inputs }
    }

    /// Whether modules were made from these inputs: every difference as a sentence that names it, none if they are
    /// fresh.
    pub fn stale(&self, inputs: &Inputs, modules: &Modules) -> Vec<String> {
        let mut stale = differences("library", &self.inputs.libraries, &inputs.libraries);
        stale.extend(differences("source", &self.inputs.sources, &inputs.sources));
        let described = [&self.module, &self.subgroups, &self.matrices, &self.stand_ins];
        let found = modules.named().into_iter().zip(described);
        for ((name, _), _) in found.filter(|((_, bytes), described)| sha256(bytes) != **described) {
            stale.push(format!("{name} is not the module that {STAMP} describes"));
        }
        stale
    }
}

/// sha256 as hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

fn differences(kind: &str, then: &BTreeMap<String, String>, now: &BTreeMap<String, String>) -> Vec<String> {
    let changed = then.iter().filter_map(|(name, value)| match now.get(name) {
        None => Some(format!("{kind} {name} is gone")),
        Some(other) if other != value => Some(format!("{kind} {name} has changed")),
        Some(_) => None,
    });
    let new = now.keys().filter(|name| !then.contains_key(*name)).map(|name| format!("{kind} {name} is new"));
    changed.chain(new).collect()
}

/// The tokens of sources by file.
type Sources = BTreeMap<String, Vec<String>>;

/// Reads a file, or all Rust files of a folder and those in it.
fn read_all(root: &Path, relative: &str, sources: &mut Sources) -> Result<(), StampError> {
    let path = root.join(relative);
    if !path.is_dir() {
        let tokens = tokens(&read_text(&path)?).map_err(|error| StampError::Source(path, error.to_string()))?;
        sources.insert(relative.to_owned(), tokens);
        return Ok(());
    }
    let failed = |cause| StampError::File(path.clone(), cause);
    for entry in fs::read_dir(&path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() || name.ends_with(".rs") {
            read_all(root, &format!("{relative}/{name}"), sources)?;
        }
    }
    Ok(())
}

/// Reads the modules of `viewfuse-core` that the sources name, those that these name, and so on; and what its root has
/// besides modules.
fn read_core(root: &Path, sources: &mut Sources) -> Result<(), StampError> {
    let mut open: BTreeSet<String> = sources.values().flat_map(|tokens| names_in(tokens, "viewfuse_core")).collect();
    let mut core = Sources::new();
    let library = format!("{CORE}/lib.rs");
    read_all(root, &library, &mut core)?;
    core.entry(library).and_modify(|tokens| *tokens = without_modules(tokens));
    while let Some(module) = open.pop_first() {
        let file = format!("{CORE}/{module}.rs");
        // Other names are the root's own.
        if core.contains_key(&file) || !root.join(&file).is_file() {
            continue;
        }
        let mut read = Sources::new();
        read_all(root, &file, &mut read)?;
        let folder = format!("{CORE}/{module}");
        if root.join(&folder).is_dir() {
            read_all(root, &folder, &mut read)?;
        }
        open.extend(read.values().flat_map(|tokens| names_in(tokens, "crate")));
        core.append(&mut read);
    }
    sources.append(&mut core);
    Ok(())
}

/// What a manifest says about the code: not its description, nor its lints.
fn manifest_of(path: &Path) -> Result<String, StampError> {
    let mut manifest: toml::Table =
        toml::from_str(&read_text(path)?).map_err(|cause| StampError::Format(path.to_path_buf(), cause))?;
    manifest.retain(|section, _| section != "package" && section != "lints");
    Ok(manifest.to_string())
}

fn read_text(path: &Path) -> Result<String, StampError> {
    fs::read_to_string(path).map_err(|cause| StampError::File(path.to_path_buf(), cause))
}
