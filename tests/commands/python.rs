//! The Python package. Its wheel is built and tested by `host/python/test`, which takes minutes and the network: only with
//! `VIEWFUSE_REQUIRE_PYTHON=1`. That it is built from the same crates as the command is tested always.

use super::BINARY;
use libtest_mimic::Trial;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;
use viewfuse_tests::places::repository;
use viewfuse_tests::trials::{is_required, needing, trial};

/// What has the wheel built and tested.
const REQUIRE: &str = "VIEWFUSE_REQUIRE_PYTHON";

pub(crate) fn trials() -> Vec<Trial> {
    let wheel = trial("commands::python::the_wheel_in_an_empty_environment", the_wheel_in_an_empty_environment);
    let missing = (!is_required(REQUIRE)).then(|| format!("minutes, and the network; {REQUIRE}=1 runs it"));
    vec![
        needing(missing, is_required(REQUIRE), wheel),
        trial("commands::python::it_is_built_from_the_same_crates", it_is_built_from_the_same_crates),
        trial("commands::python::the_ordinary_build_leaves_it_out", the_ordinary_build_leaves_it_out),
    ]
}

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

/// A file of the repository.
fn read(file: &str) -> String {
    std::fs::read_to_string(repository().join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// The packages of a lock file: by name and version, the names of what each depends on.
type Lock = BTreeMap<(String, String), Vec<String>>;

fn lock(text: &str) -> Lock {
    let quoted = |line: &str| line.split('"').nth(1).unwrap_or_default().to_owned();
    let package = |block: &str| {
        let value = |key: &str| block.lines().find(|line| line.starts_with(key)).map(quoted).unwrap_or_default();
        let needs = block.lines().filter(|line| line.starts_with(" \"")).map(quoted).collect();
        ((value("name = "), value("version = ")), needs)
    };
    text.split("[[package]]").skip(1).map(package).collect()
}

/// What a package needs, directly or not, with itself.
fn needs(lock: &Lock, name: &str) -> BTreeSet<(String, String)> {
    let mut found = BTreeSet::new();
    let mut open = vec![name.to_owned()];
    while let Some(need) = open.pop() {
        // `name`, or `name version` where there are several.
        let (name, version) = need.split_once(' ').map_or((need.as_str(), None), |(name, of)| (name, Some(of)));
        let is_it = |own: &&(String, String)| own.0 == name && version.is_none_or(|version| own.1 == version);
        let key = lock.keys().find(is_it).unwrap_or_else(|| panic!("{need} is not locked"));
        if found.insert(key.clone()) {
            open.extend(lock[key].iter().cloned());
        }
    }
    found
}

/// Where one of our packages is.
fn folder_of(package: &str) -> String {
    match package.trim_start_matches("viewfuse-") {
        own @ ("core" | "vulkan") => own.to_owned(),
        "kernels" => "core/kernels".to_owned(),
        own => format!("host/{own}"),
    }
}

/// The dependencies of a manifest that no feature turns on.
fn always_needed(manifest: &str) -> BTreeSet<String> {
    let lines = manifest.lines().skip_while(|line| *line != "[dependencies]").skip(1);
    let own = lines.take_while(|line| !line.starts_with('[')).filter(|line| !line.contains("optional = true"));
    let name = |line: &str| line.split([' ', '.', '=']).next().unwrap_or_default().to_owned();
    own.filter(|line| line.contains('=') && !line.starts_with(['#', ' '])).map(name).collect()
}

fn it_is_built_from_the_same_crates() {
    let (own, ours) = (lock(&read("host/python/Cargo.lock")), lock(&read("Cargo.lock")));
    let needed = needs(&own, "viewfuse");
    assert!(needed.len() > 60, "{}", needed.len());
    let other: Vec<_> = needed.iter().filter(|package| !ours.contains_key(package)).collect();
    assert!(
        other.is_empty(),
        "in host/python/Cargo.lock and not in Cargo.lock: {other:?}; copy the one and run cargo there"
    );
    // A dependency that was added to one of our crates and is not locked there would fail `--locked`.
    for (name, version) in needed.iter().filter(|(name, _)| name.starts_with("viewfuse-")) {
        let key = (name.clone(), version.clone());
        let names = |lock: &Lock| -> BTreeSet<String> {
            lock[&key].iter().map(|need| need.split(' ').next().unwrap_or_default().to_owned()).collect()
        };
        let (own, ours) = (names(&own), names(&ours));
        assert!(own.is_subset(&ours), "{name}: {own:?} {ours:?}");
        let always = always_needed(&read(&format!("{}/Cargo.toml", folder_of(name))));
        assert!(!always.is_empty(), "{name} needs nothing");
        let missing: Vec<_> = always.difference(&own).collect();
        assert!(missing.is_empty(), "{name} needs {missing:?}: run cargo in host/python, without --locked");
    }
    let version = |manifest: &str| manifest.lines().find(|line| line.starts_with("version = ")).map(str::to_owned);
    assert_eq!(version(&read("host/python/Cargo.toml")), version(&read("Cargo.toml")));
}

fn the_ordinary_build_leaves_it_out() {
    let ours = lock(&read("Cargo.lock"));
    assert!(ours.len() > 200, "{}", ours.len());
    for name in ["pyo3", "numpy", "viewfuse-python"] {
        assert!(!ours.keys().any(|(own, _)| own == name), "{name}");
        assert!(lock(&read("host/python/Cargo.lock")).keys().any(|(own, _)| own == name), "{name}");
    }
}
