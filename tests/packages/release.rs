//! The oldest compiler that a release promises. Licences, several versions of one crate, registries and known
//! advisories are `cargo deny check`'s, with `.cargo/deny.toml`.

use super::{cargo, list, text};
use serde_json::Value;
use viewfuse_tests::places::repository;

/// Major and minor version.
fn version(text: &str) -> (u32, u32) {
    let mut numbers = text.split('.').map(|number| number.parse().unwrap_or(0));
    (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0))
}

/// Every package promises the same, no dependency needs a newer one, and the README names it. A machine with that
/// compiler tests the promise by building.
#[test]
fn the_oldest_compiler() {
    let metadata = cargo(&["metadata", "--all-features", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&metadata).expect("JSON");
    let crates = list(&metadata, "packages");
    let ours: Vec<&Value> = crates.iter().filter(|package| package["source"].is_null()).collect();
    let promised = text(ours[0], "rust_version");
    assert!(ours.iter().all(|package| package["rust_version"] == *promised), "all packages promise the same");
    for package in crates {
        let needed = package["rust_version"].as_str().unwrap_or("1.0");
        assert!(version(needed) <= version(promised), "{} needs Rust {needed}", text(package, "name"));
    }
    let readme = std::fs::read_to_string(repository().join("README.md")).expect("the README");
    assert!(readme.contains(&format!("{promised} or newer")), "the README says which Rust is needed");
}
