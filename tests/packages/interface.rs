//! The public interface of every published library, as it is checked in: `tests/data/api/CRATE.txt`, a line an item. A change of
//! the interface without its line fails, so that it is seen; `VIEWFUSE_WRITE_API=1` writes the lists.
//!
//! The lists are made from the sources, so that they need no compiler but the one that is there. That what is `pub` can be
//! reached from outside, wherever it stands, is what the lint `unreachable_pub` checks.

mod items;
mod shown;

use super::{list, packages, text};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_tests::places::data;

fn listed(name: &str) -> PathBuf {
    data(&format!("api/{name}.txt"))
}

/// Every published library, and the file that it begins with. The kernels' entry points are the GPU's.
fn libraries() -> Vec<(String, PathBuf)> {
    let mut found = Vec::new();
    for package in packages() {
        let is_published = package["publish"].is_null() && text(&package, "name") != "viewfuse-shaders";
        let is_library = |target: &&Value| list(target, "kind").iter().any(|kind| kind == "lib" || kind == "rlib");
        let library = list(&package, "targets").iter().find(is_library);
        if let (true, Some(library)) = (is_published, library) {
            found.push((text(&package, "name").to_owned(), PathBuf::from(text(library, "src_path"))));
        }
    }
    found
}

/// The lines of one text that the other lacks.
fn missing<'a>(text: &'a str, other: &str) -> Vec<&'a str> {
    let other: BTreeSet<&str> = other.lines().collect();
    text.lines().filter(|line| !other.contains(line)).collect()
}

#[test]
fn no_change_without_its_line() {
    let is_written = std::env::var("VIEWFUSE_WRITE_API").is_ok_and(|value| value == "1");
    let (libraries, mut changes) = (libraries(), String::new());
    assert!(libraries.len() > 10, "{libraries:?}");
    for (name, root) in &libraries {
        let now = items::interface(root);
        if is_written {
            fs::write(listed(name), &now).expect("a list");
        }
        let before = fs::read_to_string(listed(name)).unwrap_or_default();
        changes.extend(missing(&before, &now).iter().map(|line| format!("- {name}: {line}\n")));
        changes.extend(missing(&now, &before).iter().map(|line| format!("+ {name}: {line}\n")));
    }
    assert!(
        changes.is_empty(),
        "the public interface changed; if that is meant, write the lists (VIEWFUSE_WRITE_API=1) and say so in \
         host/CHANGELOG.md:\n{changes}"
    );
    let names: BTreeSet<PathBuf> = libraries.iter().map(|(name, _)| listed(name)).collect();
    let there = fs::read_dir(data("api")).expect("the lists").map(|entry| entry.expect("an entry").path()).collect();
    assert_eq!(names, there, "a list for each library, and no other");
}

#[test]
fn what_is_public_is_listed() {
    let root = Path::new("lib.rs");
    let of = |source: &str| items::of_source(source, root);
    let source = "
        /// A number.
        #[derive(Debug, Clone)]
        pub struct A { pub number: u32, own: u8 }
        impl A { pub fn get(&self, by: &[f32; 3]) -> Option<u32> { None } pub(crate) fn own(&self) {} fn less(&self) {} }
        impl From<u32> for A { fn from(number: u32) -> A { A { number, own: 0 } } }
        struct Own;
        impl Clone for Own { fn clone(&self) -> Own { Own } }
        pub enum B { One, Two(u32), Three { side: f32 } }
        pub trait C<T>: Copy where T: Copy { const MAX: usize = 3; type Item; fn must(&self); fn may(&self) {} }
        #[cfg(feature = \"more\")]
        pub mod more { pub const SIDE: [usize; 2] = [1, 2]; pub use super::A; fn own() {} }
        #[cfg(test)]
        pub mod tests { pub fn none() {} }
        macro_rules! made { ($($name:ident)+) => { $(pub fn $name() -> u8 { 1 })+ } }
        made! { one two }
    ";
    let lines = of(source);
    let expected = "\
impl A: pub fn get(&self, by: &[f32; 3]) -> Option<u32>
impl From<u32> for A
macro made: pub fn $name() -> u8
made! one two
more: pub const SIDE: [usize; 2]
more: pub use super::A
pub enum B
pub enum B: One
pub enum B: Three { side: f32 }
pub enum B: Two(u32)
pub mod more #[cfg(feature = \"more\")]
pub struct A { private fields } #[derive(Clone, Debug)]
pub struct A: pub number: u32
pub trait C: const MAX: usize = default
pub trait C: fn may(&self) { default }
pub trait C: fn must(&self)
pub trait C: type Item
pub trait C<T>: Copy where T: Copy
";
    assert_eq!(lines, expected);
    // What nobody outside sees changes nothing; anything else does.
    assert_eq!(of(&source.replace("A number.", "Another.").replace("{ None }", "{ Some(1) }")), lines);
    for (part, other) in [
        ("pub number: u32", "pub number: u64"),
        ("pub number", "number"),
        (", own: u8 }", " }"),
        ("&self, by", "&mut self, by"),
        ("impl From<u32>", "impl From<u16>"),
        ("Two(u32)", "Two(u32, u32)"),
        ("fn may(&self) {}", "fn may(&self);"),
        ("[usize; 2]", "[usize; 3]"),
        ("\"more\"", "\"less\""),
        ("one two", "one three"),
        ("Debug, Clone", "Debug"),
    ] {
        assert!(source.contains(part), "{part}");
        let changed = source.replacen(part, other, 1);
        assert_ne!(of(&changed), lines, "{part}");
    }
}
