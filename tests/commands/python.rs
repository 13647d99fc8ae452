//! The Python package. Its wheel is built and tested by `host/python/test`, which takes minutes and the network: only
//! with `VIEWFUSE_REQUIRE_PYTHON=1`. That it is built from the same crates as the command is tested always.

use super::readme::metadata;
use super::{BINARY, list_of};
use std::collections::BTreeSet;
use std::process::Command;
use viewfuse_tests::places::repository;

/// What has the wheel built and tested.
const REQUIRE: &str = "VIEWFUSE_REQUIRE_PYTHON";

viewfuse_tests::trials![
    it_is_built_from_the_same_crates;
    Some(format!("minutes, and the network; {REQUIRE}=1 runs it")), REQUIRE => the_wheel_in_an_empty_environment,
];

fn the_wheel_in_an_empty_environment() {
    let output = Command::new(repository().join("host/python/test"))
        .env("VIEWFUSE_COMMAND", BINARY)
        .output()
        .expect("the script starts, which needs bash");
    let [said, complained] = [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success(), "{said}\n{complained}");
    // Python's harness says how many tests it ran.
    assert!(complained.contains("\nRan ") && complained.trim_end().ends_with("OK"), "{complained}");
}

/// The packages of a lock file: name, version, and the names of what each depends on.
fn locked(file: &str) -> Vec<(String, String, BTreeSet<String>)> {
    let text = std::fs::read_to_string(repository().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
    let quoted = |line: &str| line.split('"').nth(1).unwrap_or_default().to_owned();
    let package = |block: &str| {
        let value = |key: &str| block.lines().find(|line| line.starts_with(key)).map(quoted).unwrap_or_default();
        let needs = block.lines().filter(|line| line.starts_with(" \"")).map(quoted);
        let name_alone = |need: String| need.split(' ').next().unwrap_or_default().to_owned();
        (value("name = "), value("version = "), needs.map(name_alone).collect())
    };
    text.split("[[package]]").skip(1).map(package).collect()
}

/// Every version is that of the command, so that both compute the same, and the lock has all that our crates need.
fn it_is_built_from_the_same_crates() {
    let (of_python, ours) = (locked("host/python/Cargo.lock"), locked("Cargo.lock"));
    let metadata = metadata();
    // Of what the library needs; Python's side is no part of the ordinary build.
    let mut needed = BTreeSet::from(["viewfuse"]);
    while let Some(more) = of_python.iter().find_map(|(name, _, needs)| {
        let is_new = |need: &&String| needed.contains(name.as_str()) && !needed.contains(need.as_str());
        needs.iter().find(is_new)
    }) {
        needed.insert(more);
    }
    assert!(needed.len() > 60, "{needed:?}");
    for (name, version, needs) in of_python.iter().filter(|(name, ..)| needed.contains(name.as_str())) {
        let versions: Vec<&String> =
            ours.iter().filter(|package| package.0 == *name).map(|package| &package.1).collect();
        assert!(versions.contains(&version), "{name}: {version}, and {versions:?} in Cargo.lock");
        let packages = list_of(&metadata["packages"]);
        let Some(package) = packages.iter().find(|package| package["name"] == name.as_str()) else { continue };
        let dependencies = list_of(&package["dependencies"]).iter();
        let always = dependencies.filter(|need| need["kind"].is_null() && need["optional"] == false);
        for need in always.filter(|need| need["target"].is_null()).filter_map(|need| need["name"].as_str()) {
            assert!(needs.contains(need), "{name} needs {need}: run cargo in host/python, without --locked");
        }
    }
    assert!(ours.iter().all(|package| !["pyo3", "numpy"].contains(&package.0.as_str())), "the ordinary build has none");
}
