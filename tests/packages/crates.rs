//! Which crate may use which.

use super::{list, packages, text};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// The crates along the data: one uses only those before it.
const ORDER: [&str; 17] = [
    "viewfuse-core", "viewfuse-kernels", "viewfuse-vulkan", "viewfuse-job", "viewfuse-device", "viewfuse-weighting",
    "viewfuse-scene", "viewfuse-nn", "viewfuse-field", "viewfuse-output", "viewfuse-evaluate", "viewfuse-check",
    "viewfuse-pose", "viewfuse-view", "viewfuse-cli", "viewfuse-lab", "viewfuse",
];

/// What reads arguments, catches signals and erases the types of errors: for programs alone.
const OF_PROGRAMS: [&str; 3] = ["clap", "ctrlc", "anyhow"];
const PROGRAMS: [&str; 2] = ["viewfuse-cli", "viewfuse-lab"];

/// What is wrong with the dependencies of these packages.
fn disorder(packages: &[Value]) -> Vec<String> {
    let place = |name: &str| ORDER.iter().position(|row| *row == name);
    let mut problems = Vec::new();
    for package in packages {
        let name = text(package, "name");
        // Tests may use everything.
        for dependency in list(package, "dependencies").iter().filter(|dependency| dependency["kind"] != "dev") {
            let other = text(dependency, "name");
            if let (Some(user), Some(used)) = (place(name), place(other))
                && used >= user
            {
                problems.push(format!("{name} uses {other}, which stands behind it"));
            }
            if OF_PROGRAMS.contains(&other) && !PROGRAMS.contains(&name) {
                problems.push(format!("{name} uses {other}"));
            }
        }
    }
    problems
}

#[test]
fn crates_stand_in_the_order_of_the_data() {
    let packages = packages();
    let published: BTreeSet<&str> =
        packages.iter().filter(|package| !package["publish"].is_array()).map(|package| text(package, "name")).collect();
    let missing: Vec<&&str> = published.iter().filter(|name| !ORDER.contains(name)).collect();
    // The C interface is core's, the kernels' entry points are the GPU's.
    assert!(missing.iter().all(|name| ["viewfuse-capi", "viewfuse-shaders"].contains(name)), "no place: {missing:?}");
    assert!(ORDER.iter().all(|name| published.contains(name)), "{published:?}");
    let problems = disorder(&packages);
    assert!(problems.is_empty(), "{problems:#?}");
    // What is out of order is found.
    let package = |name: &str, other: &str| disorder(&[json!({ "name": name, "dependencies": [{ "name": other }] })]);
    assert_eq!(
        package("viewfuse-scene", "viewfuse-field"),
        ["viewfuse-scene uses viewfuse-field, which stands behind it"]
    );
    assert_eq!(package("viewfuse-device", "clap"), ["viewfuse-device uses clap"]);
}
