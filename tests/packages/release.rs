//! What a release asks of all crates: licences that are allowed, few crates in several versions, one registry, and the oldest
//! compiler that is promised. `.cargo/deny.toml` has the lists, which `cargo deny check` reads, too; it also looks for known
//! advisories, for which it needs the network.

use super::{cargo, list, text};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;
use viewfuse_tests::places::repository;

/// Most versions of crates beside a newer one.
const MAX_DUPLICATES: usize = 24;

/// Every crate of the lock file, those of optional features too, as cargo describes it.
fn crates() -> Vec<Value> {
    let metadata = cargo(&["metadata", "--all-features", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&metadata).expect("JSON");
    list(&metadata, "packages").to_vec()
}

/// The texts of a list in `deny.toml`.
fn listed(key: &str) -> BTreeSet<String> {
    let path = repository().join(".cargo/deny.toml");
    let file = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let start = format!("\n{key} = [\n");
    let (_, rest) = file.split_once(&start).unwrap_or_else(|| panic!("{key} is no list in {}", path.display()));
    let inside = rest.split("\n]").next().unwrap_or_default();
    inside.split('"').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Whether an expression of licences (SPDX, or names between slashes) can be met with those that are allowed.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = words.as_slice();
    either(&mut rest, allowed) && rest.is_empty()
}

/// `a OR b`.
fn either(words: &mut &[&str], allowed: &BTreeSet<String>) -> bool {
    let mut met = both(words, allowed);
    while let Some(("OR", rest)) = words.split_first().map(|(first, rest)| (*first, rest)) {
        *words = rest;
        met |= both(words, allowed);
    }
    met
}

/// `a AND b`, which binds closer.
fn both(words: &mut &[&str], allowed: &BTreeSet<String>) -> bool {
    let mut met = one(words, allowed);
    while let Some(("AND", rest)) = words.split_first().map(|(first, rest)| (*first, rest)) {
        *words = rest;
        met &= one(words, allowed);
    }
    met
}

/// A licence, one with an exception, or an expression in parentheses.
fn one(words: &mut &[&str], allowed: &BTreeSet<String>) -> bool {
    match **words {
        ["(", ref rest @ ..] => {
            *words = rest;
            let met = either(words, allowed);
            let is_closed = words.first() == Some(&")");
            *words = words.get(1..).unwrap_or_default();
            met && is_closed
        }
        [name, "WITH", exception, ref rest @ ..] => {
            *words = rest;
            allowed.contains(&format!("{name} WITH {exception}"))
        }
        [name, ref rest @ ..] => {
            *words = rest;
            allowed.contains(name)
        }
        [] => false,
    }
}

#[test]
fn licences_are_allowed() {
    let allowed = listed("allow");
    let mut met = 0;
    for package in crates() {
        let (name, licence) = (text(&package, "name"), package["license"].as_str().unwrap_or("none"));
        assert!(is_allowed(licence, &allowed), "{name}: the licence {licence:?} is not allowed");
        met += 1;
    }
    assert!(met > 200, "{met} crates");
}

#[test]
fn expressions_of_licences() {
    let allowed = ["MIT", "Zlib", "Apache-2.0 WITH LLVM-exception"].map(str::to_owned).into();
    for good in
        ["MIT", "GPL-3.0 OR MIT", "MIT/Apache-2.0", "Apache-2.0 WITH LLVM-exception OR X", "(X OR MIT) AND Zlib"]
    {
        assert!(is_allowed(good, &allowed), "{good}");
    }
    for bad in ["", "none", "GPL-3.0", "MIT AND GPL-3.0", "(MIT OR X) AND X", "MIT WITH X", "MIT )", "MIT AND X OR X"] {
        assert!(!is_allowed(bad, &allowed), "{bad}");
    }
}

/// Versions beside a newer one, as `name@1.2.3`.
fn duplicates(crates: &[Value]) -> BTreeSet<String> {
    let mut versions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for package in crates {
        versions.entry(text(package, "name")).or_default().push(text(package, "version"));
    }
    let number = |version: &str| -> Vec<u64> {
        let version = version.split(['+', '-']).next().unwrap_or_default();
        version.split('.').map(|part| part.parse().unwrap_or(0)).collect()
    };
    let older = versions.into_iter().flat_map(|(name, mut all)| {
        all.sort_by_key(|version| number(version));
        all.pop();
        let plain = |version: &str| version.split('+').next().unwrap_or_default().to_owned();
        all.into_iter().map(move |version| format!("{name}@{}", plain(version))).collect::<Vec<_>>()
    });
    older.collect()
}

#[test]
fn few_crates_come_in_several_versions() {
    let (found, listed) = (duplicates(&crates()), listed("skip"));
    let new: Vec<&String> = found.difference(&listed).collect();
    let gone: Vec<&String> = listed.difference(&found).collect();
    assert!(new.is_empty(), "older versions that are not in `skip` of .cargo/deny.toml: {new:?}");
    assert!(gone.is_empty(), "in `skip` of .cargo/deny.toml and not there any more: {gone:?}");
    assert!(found.len() <= MAX_DUPLICATES, "{} older versions", found.len());
}

#[test]
fn older_versions_are_found() {
    let package = |name: &str, version: &str| serde_json::json!({"name": name, "version": version});
    let all = [package("a", "1.10.0"), package("a", "1.9.0"), package("b", "1.0.0"), package("a", "0.3.1+x-1.0")];
    assert_eq!(duplicates(&all), ["a@0.3.1".to_owned(), "a@1.9.0".to_owned()].into());
}

#[test]
fn all_crates_are_from_the_registry_or_from_here() {
    for package in crates() {
        let source = package["source"].as_str().unwrap_or("here");
        let is_known = source == "here" || source == "registry+https://github.com/rust-lang/crates.io-index";
        assert!(is_known, "{} is from {source}", text(&package, "name"));
    }
}

/// Major and minor version.
fn version(text: &str) -> (u32, u32) {
    let mut numbers = text.split('.').map(|number| number.parse().unwrap_or(0));
    (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0))
}

/// The oldest compiler that is promised: every package says it, no dependency needs a newer one, and the README names it. A
/// machine with that compiler tests the promise by building.
#[test]
fn the_oldest_compiler() {
    let crates = crates();
    let own: Vec<&Value> = crates.iter().filter(|package| package["source"].is_null()).collect();
    let promised = text(own[0], "rust_version");
    assert!(own.iter().all(|package| package["rust_version"] == *promised), "all packages promise the same");
    for package in &crates {
        let needed = package["rust_version"].as_str().unwrap_or("1.0");
        assert!(version(needed) <= version(promised), "{} needs Rust {needed}", text(package, "name"));
    }
    let readme = std::fs::read_to_string(repository().join("README.md")).expect("the README");
    assert!(readme.contains(&format!("{promised} or newer")), "the README says which Rust is needed");
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let said = Command::new(rustc).arg("--version").output().expect("rustc").stdout;
    let said = String::from_utf8_lossy(&said).into_owned();
    let installed = said.split(' ').nth(1).unwrap_or_default();
    assert!(version(installed) >= version(promised), "{said}");
    println!("built with {installed}, promised {promised}");
}
