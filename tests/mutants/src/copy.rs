//! A copy of the repository in which every value of a kernel's body can be changed.

use crate::places::{Place, float_constants, rewrite};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Sources of kernels: what `core` computes for them, and the kernels' own. Not what only describes kernels, and not
/// what is generic in its numbers or never runs in a kernel.
fn is_changed(path: &str) -> bool {
    const FOLDERS: [&str; 2] = ["core/src/", "core/kernels/src/"];
    const OTHERS: [&str; 4] =
        ["core/src/lens.rs", "core/src/metrics.rs", "core/src/schedule.rs", "core/kernels/src/rows"];
    FOLDERS.iter().any(|folder| path.starts_with(folder)) && !OTHERS.iter().any(|other| path.starts_with(other))
}

/// The repository that this program is in.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the repository")
}

/// Where the copy is.
pub fn copy() -> PathBuf {
    repository().join("target/mutants")
}

/// Writes a file unless it is the same already, so that nothing is compiled twice.
fn write(path: &Path, bytes: &[u8]) {
    if fs::read(path).ok().as_deref() != Some(bytes) {
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, bytes).expect("a file of the copy");
    }
}

/// Makes the copy, and returns its places.
pub fn make() -> Vec<Place> {
    let (from, to) = (repository(), copy());
    let listed = Command::new("git")
        .args(["ls-files", "--cached", "--others", "--exclude-standard"])
        .current_dir(&from)
        .output()
        .expect("git");
    let listed = String::from_utf8(listed.stdout).expect("names");
    // What is in the index may be deleted in the folder.
    let paths: Vec<&str> = listed.lines().filter(|path| from.join(path).is_file()).collect();
    let mut sources = Vec::new();
    for path in paths {
        if is_changed(path) {
            let source = fs::read_to_string(from.join(path)).expect("a source");
            let file = syn::parse_file(&source).expect("Rust");
            sources.push((path, source, file));
        } else {
            write(&to.join(path), &fs::read(from.join(path)).expect("a file"));
        }
    }
    let constants: BTreeSet<String> = sources.iter().flat_map(|(_, _, file)| float_constants(file)).collect();
    let mut places = Vec::new();
    for (path, source, file) in &sources {
        let in_core = path.starts_with("core/src");
        let near = if in_core { "crate::perturb::near" } else { "viewfuse_core::perturb::near" };
        let name = path.replace("core/src/", "core/").replace("core/kernels/src/", "kernels/").replace(".rs", "");
        let mut text = rewrite(&name, source, file, &constants, near, &mut places);
        if *path == "core/src/lib.rs" {
            text.push_str("\npub mod perturb;\n");
        }
        write(&to.join(path), text.as_bytes());
    }
    let runtime = include_str!("perturb.rs").replace("PLACE_COUNT", &places.len().to_string());
    write(&to.join("core/src/perturb.rs"), runtime.as_bytes());
    places
}

/// A test binary of the copy.
pub struct Binary {
    pub name: String,
    pub path: PathBuf,
}

/// Test binaries that prove kernels.
pub const BINARIES: [&str; 2] = ["numerics", "parity"];

/// Compiles them in the copy. The libraries of others are shared with the repository's own target folder.
pub fn build() -> Vec<Binary> {
    let mut cargo = Command::new("cargo");
    cargo.args(["test", "--release", "--offline", "--locked", "--no-run", "--message-format=json"]);
    cargo.args(["-p", "viewfuse-tests"]).args(BINARIES.iter().flat_map(|name| ["--test", name]));
    cargo
        .current_dir(copy())
        .env("CARGO_TARGET_DIR", repository().join("target"))
        .stderr(std::process::Stdio::inherit());
    let output = cargo.output().expect("cargo");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    if !output.status.success() {
        said.split("\"rendered\":\"").skip(1).filter(|text| text.starts_with("error")).for_each(|text| {
            let text = text.split("\",\"").next().unwrap_or(text);
            eprintln!("{}", text.replace("\\n", "\n").replace("\\\"", "\""));
        });
        panic!("the copy does not compile");
    }
    let binary = |name: &&str| {
        let stem = format!("/{name}-");
        let found = said.split("\"executable\":\"").skip(1).map(|text| text.split('"').next().unwrap_or(text));
        let path = found.filter(|path| path.contains(&stem)).last().unwrap_or_else(|| panic!("no {name}"));
        Binary { name: (*name).to_owned(), path: PathBuf::from(path) }
    };
    BINARIES.iter().map(binary).collect()
}
