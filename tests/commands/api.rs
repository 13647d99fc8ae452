//! The public interface of every published library, as it is checked in: `tests/data/api/CRATE.txt`, a line an item. A change of
//! the interface without its line fails; `VIEWFUSE_WRITE_API=1` writes the lists.
//!
//! The lists are made from what rustdoc knows of a crate. Its format is not stable, so that a compiler may be too new for the
//! library that reads it: then the test is ignored and says so.

use libtest_mimic::Trial;
use public_api::{Builder, PublicApi};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use viewfuse_tests::places::{data, repository};
use viewfuse_tests::trials::{is_required, needing, trial};

const REQUIRED: &str = "VIEWFUSE_REQUIRE_API";

/// The published libraries. Of those with features, the interface with the features that tests need.
const LIBRARIES: [&str; 15] = [
    "viewfuse-core",
    "viewfuse-vulkan",
    "viewfuse-job",
    "viewfuse-device",
    "viewfuse-weighting",
    "viewfuse-scene",
    "viewfuse-nn",
    "viewfuse-field",
    "viewfuse-output",
    "viewfuse-evaluate",
    "viewfuse-synthetic",
    "viewfuse-check",
    "viewfuse-train",
    "viewfuse-view",
    "viewfuse",
];

pub(crate) fn trials() -> Vec<Trial> {
    let missing = unreadable();
    let module = |name: &str| format!("{}::{name}", module_path!());
    vec![
        needing(
            missing.clone(),
            is_required(REQUIRED),
            trial(&module("no_change_without_its_line"), no_change_without_its_line),
        ),
        needing(missing, is_required(REQUIRED), trial(&module("a_change_is_seen"), a_change_is_seen)),
        trial(&module("every_published_library_is_listed"), every_published_library_is_listed),
    ]
}

/// A program that stands for rustdoc, with its unstable options on; and the options.
fn rustdoc() -> Result<(PathBuf, &'static str), String> {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rustdoc-json");
    let real = std::env::var("RUSTDOC").unwrap_or_else(|_| "rustdoc".to_owned());
    let failed = |error: std::io::Error| format!("{}: {error}", path.display());
    if cfg!(not(unix)) {
        return Err("the script that asks rustdoc needs Unix".to_owned());
    }
    fs::write(&path, format!("#!/bin/sh\nRUSTC_BOOTSTRAP=1 exec {real} \"$@\"\n")).map_err(failed)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).map_err(failed)?;
    }
    Ok((path, "-Zunstable-options --output-format=json --cap-lints=allow"))
}

/// The interface that a file of rustdoc's describes: without what follows from the types themselves.
fn interface(json: &Path) -> Result<PublicApi, String> {
    Builder::from_rustdoc_json(json)
        .omit_blanket_impls(true)
        .omit_auto_trait_impls(true)
        .omit_auto_derived_impls(true)
        .build()
        .map_err(|error| format!("{}: {error}", json.display()))
}

/// The interface of a source, alone.
fn of_source(source: &str) -> Result<String, String> {
    let (rustdoc, options) = rustdoc()?;
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let path = folder.path().join("probe.rs");
    fs::write(&path, source).map_err(|error| error.to_string())?;
    let mut command = Command::new(rustdoc);
    command.arg(&path).args(["--crate-type", "lib", "--edition", "2024", "-o"]).arg(folder.path());
    let output = command.args(options.split(' ')).output().map_err(|error| error.to_string())?;
    match output.status.success() {
        true => interface(&folder.path().join("probe.json")).map(|api| api.to_string()),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
    }
}

/// Why the lists cannot be made here.
fn unreadable() -> Option<String> {
    match of_source("pub fn one(number: u32) -> u32 { number }") {
        Ok(api) if api.contains("pub fn probe::one(u32) -> u32") => None,
        Ok(api) => Some(format!("this rustdoc's format is not understood: {api:?}")),
        Err(error) => Some(format!("this rustdoc's format is not read: {}", error.lines().next().unwrap_or_default())),
    }
}

fn a_change_is_seen() {
    let of = |source: &str| of_source(source).expect("an interface");
    let before = of("pub struct A { pub number: u32 }\nimpl A { pub fn get(&self) -> u32 { self.number } }");
    for after in [
        "pub struct A { pub number: u64 }\nimpl A { pub fn get(&self) -> u32 { 0 } }",
        "pub struct A { number: u32 }\nimpl A { pub fn get(&self) -> u32 { self.number } }",
        "pub struct A { pub number: u32 }\nimpl A { pub fn get(&mut self) -> u32 { self.number } }",
        "pub struct A { pub number: u32 }",
    ] {
        assert_ne!(of(after), before, "{after}");
    }
    let same = "/// A number.\npub struct A { pub number: u32 }\nimpl A { /// It.\npub fn get(&self) -> u32 { 1 + self.number } }";
    assert_eq!(of(same), before);
}

fn list(name: &str) -> PathBuf {
    data(&format!("api/{name}.txt"))
}

/// Lines of one text that the other lacks.
fn missing_lines<'a>(text: &'a str, other: &str) -> Vec<&'a str> {
    let other: std::collections::HashSet<&str> = other.lines().collect();
    text.lines().filter(|line| !other.contains(line)).collect()
}

fn no_change_without_its_line() {
    let (rustdoc, options) = rustdoc().expect("a script");
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder");
    // As `.ci/run` documents all crates, so that each is compiled for both once.
    let output = Command::new(env!("CARGO"))
        .args(["doc", "--quiet", "--release", "--workspace", "--lib", "--no-deps", "--locked", "--target-dir"])
        .arg(target)
        .env("RUSTDOC", rustdoc)
        .env("RUSTDOCFLAGS", options)
        .current_dir(repository())
        .output()
        .expect("cargo");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut changes = String::new();
    for name in LIBRARIES {
        let json = target.join(format!("doc/{}.json", name.replace('-', "_")));
        let now = interface(&json).unwrap_or_else(|error| panic!("{error}")).to_string();
        assert!(now.lines().count() > 5, "{name}: {now}");
        if std::env::var("VIEWFUSE_WRITE_API").is_ok_and(|value| value == "1") {
            fs::write(list(name), &now).expect("a list");
            continue;
        }
        let listed = fs::read_to_string(list(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        let changed = missing_lines(&listed, &now).into_iter().map(|line| format!("-{line}\n"));
        changes.extend(changed.chain(missing_lines(&now, &listed).into_iter().map(|line| format!("+{line}\n"))));
    }
    assert!(
        changes.is_empty(),
        "the public interface changed; if that is meant, write the lists (VIEWFUSE_WRITE_API=1) and say so in \
         host/CHANGELOG.md:\n{changes}"
    );
}

fn every_published_library_is_listed() {
    let output = Command::new(env!("CARGO")).args(["metadata", "--no-deps", "--format-version", "1"]).output();
    let metadata: Value = serde_json::from_slice(&output.expect("cargo").stdout).expect("JSON");
    let packages = metadata["packages"].as_array().expect("packages");
    let has_library = |package: &Value| {
        let targets = package["targets"].as_array().expect("targets");
        targets.iter().any(|target| target["kind"][0] == "lib")
    };
    let published: Vec<&str> = packages
        .iter()
        .filter(|package| package["publish"].is_null() && has_library(package))
        .filter_map(|package| package["name"].as_str())
        // The kernels' entry points are the GPU's.
        .filter(|name| *name != "viewfuse-shaders")
        .collect();
    for name in &published {
        assert!(LIBRARIES.contains(name), "{name} is not listed");
    }
    assert_eq!(published.len(), LIBRARIES.len(), "{published:?}");
    for name in LIBRARIES {
        assert!(list(name).is_file(), "{name} has no list");
    }
}
