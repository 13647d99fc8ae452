//! The packages as such: which depend on which, in which order their modules stand, what a library must not do, what a
//! crate outside can add, which kernels have a twin on the CPU, why unsafe code is sound, and that every test is run.

mod crates;
mod libraries;
mod modules;
mod outside;
mod release;
mod rooms;
mod safety;
mod twins;

use serde_json::Value;
use std::process::Command;
use viewfuse_tests::places::repository;

/// What cargo prints about the repository. Crates of other platforms, which no build has fetched, are fetched where
/// they are missing.
fn cargo(arguments: &[&str]) -> String {
    let run = |more: &[&str]| {
        let mut command = Command::new(env!("CARGO"));
        command.args(arguments).arg("--locked").args(more).current_dir(repository()).output().expect("cargo")
    };
    let offline = run(&["--offline"]);
    let output = if offline.status.success() { offline } else { run(&[]) };
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// All packages of the workspace, as cargo describes them.
fn packages() -> Vec<Value> {
    let text = cargo(&["metadata", "--no-deps", "--format-version", "1"]);
    let mut metadata: Value = serde_json::from_str(&text).expect("JSON");
    match metadata["packages"].take() {
        Value::Array(packages) => packages,
        other => panic!("no packages: {other}"),
    }
}

/// A text of what cargo describes.
fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value[key].as_str().unwrap_or_else(|| panic!("no {key} in {value}"))
}

/// The entries of a list of what cargo describes.
fn list<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().unwrap_or_else(|| panic!("no {key} in {value}"))
}
