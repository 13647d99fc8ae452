//! Which crates a default build takes, and which crate may use which.

use super::{cargo, list, packages, text};
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// So many crates the command may take with its default features, procedural macros and what builds them included.
const MAX_CRATES: usize = 130;
/// Not one of these is among them: features that are off by default, and dependencies that cost more than they saved.
const FORBIDDEN: [&str; 11] = [
    "viewfuse-lab",
    "candle-core",
    "faer",
    "maud",
    "exr",
    "tiff",
    "half",
    "embedded-graphics",
    "indicatif",
    "comfy-table",
    "tokenizers",
];

/// The crates along the data: one uses only those before it.
pub(crate) const ORDER: [&str; 17] = [
    "viewfuse-core",
    "viewfuse-kernels",
    "viewfuse-vulkan",
    "viewfuse-job",
    "viewfuse-device",
    "viewfuse-weighting",
    "viewfuse-scene",
    "viewfuse-nn",
    "viewfuse-field",
    "viewfuse-output",
    "viewfuse-evaluate",
    "viewfuse-check",
    "viewfuse-pose",
    "viewfuse-view",
    "viewfuse-cli",
    "viewfuse-lab",
    "viewfuse",
];

/// Heavy dependencies, and where they may be: in crates, always or only as an option.
const HEAVY: [(&str, &[&str]); 12] = [
    ("candle-core", &["viewfuse-lab"]),
    ("ndarray", &["viewfuse-lab"]),
    ("faer", &["viewfuse-evaluate?"]),
    ("maud", &["viewfuse-lab"]),
    ("base64", &["viewfuse-lab", "viewfuse-output"]),
    ("plotters", &["viewfuse-evaluate", "viewfuse-lab"]),
    ("httparse", &["viewfuse-view"]),
    ("exr", &["viewfuse-output?"]),
    ("gif", &["viewfuse-output"]),
    ("clap", &["viewfuse-cli", "viewfuse-lab"]),
    ("ctrlc", &["viewfuse-cli"]),
    ("anyhow", &["viewfuse-cli", "viewfuse-lab"]),
];

/// What `cargo tree --prefix none` lists, each crate once, or what is wrong with it.
fn light(tree: &str) -> Result<usize, String> {
    let crates: BTreeSet<&str> = tree.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    let names: BTreeSet<&str> = crates.iter().filter_map(|line| line.split(' ').next()).collect();
    if let Some(found) = FORBIDDEN.iter().find(|name| names.contains(*name)) {
        return Err(format!("{found} is among them"));
    }
    if !names.contains("viewfuse-core") || crates.len() > MAX_CRATES {
        return Err(format!("{} crates: {names:?}", crates.len()));
    }
    Ok(crates.len())
}

#[test]
fn a_default_build_is_light() {
    let tree = cargo(&["tree", "-e", "no-dev", "-p", "viewfuse-cli", "--prefix", "none"]);
    println!("{} crates", light(&tree).unwrap_or_else(|problem| panic!("{problem}")));
}

#[test]
fn a_heavy_build_is_rejected() {
    let some = "viewfuse v1\nviewfuse-core v1\nglam v0\nviewfuse-core v1 (*)\n";
    assert_eq!(light(some), Ok(3));
    assert!(light("").is_err(), "nothing at all");
    for name in FORBIDDEN {
        assert_eq!(light(&format!("{some}{name} v1.2\n")), Err(format!("{name} is among them")));
    }
    let many: String = (0..MAX_CRATES).map(|number| format!("crate{number} v1\n")).collect();
    assert!(light(&format!("{some}{many}")).is_err_and(|problem| problem.starts_with("133 crates")));
}

/// What is wrong with the dependencies of these packages.
fn disorder(packages: &[Value]) -> Vec<String> {
    let place = |name: &str| ORDER.iter().position(|own| *own == name);
    let mut problems = Vec::new();
    for package in packages {
        let name = text(package, "name");
        // Tests may use everything.
        for dependency in list(package, "dependencies").iter().filter(|dependency| dependency["kind"] != "dev") {
            let other = text(dependency, "name");
            if let (Some(own), Some(used)) = (place(name), place(other))
                && used >= own
            {
                problems.push(format!("{name} uses {other}, which stands behind it"));
            }
            let is_optional = dependency["optional"] == true;
            let may = |places: &[&str]| {
                places.iter().any(|place| match place.strip_suffix('?') {
                    Some(place) => place == name && is_optional,
                    None => *place == name,
                })
            };
            if HEAVY.iter().any(|(heavy, places)| *heavy == other && !may(places)) {
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
}

#[test]
fn disorder_is_found() {
    let package = |name: &str, other: &str, kind: Value, optional: bool| json!([{ "name": name, "dependencies": [{ "name": other, "kind": kind, "optional": optional }] }]);
    let of = |value: Value| disorder(value.as_array().expect("a list")).len();
    assert_eq!(of(package("viewfuse-scene", "viewfuse-field", Value::Null, false)), 1);
    assert_eq!(of(package("viewfuse-scene", "viewfuse-field", Value::Null, true)), 1, "an option is no excuse");
    assert_eq!(of(package("viewfuse-scene", "viewfuse-field", json!("dev"), false)), 0, "tests may");
    assert_eq!(of(package("viewfuse-field", "viewfuse-scene", Value::Null, false)), 0);
    assert_eq!(of(package("viewfuse-field", "candle-core", Value::Null, true)), 1);
    assert_eq!(of(package("viewfuse-evaluate", "faer", Value::Null, false)), 1, "not always");
    assert_eq!(of(package("viewfuse-evaluate", "faer", Value::Null, true)), 0);
    assert_eq!(of(package("viewfuse-device", "clap", json!("build"), false)), 1);
}
