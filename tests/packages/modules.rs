//! The order of modules: each crate's `lib.rs` lists its modules along the data, and a module uses only those before
//! it.
//!
//! The list is the first `text` block of the crate's documentation that names a module: a line begins with the names of
//! modules between commas, and two spaces end them; a line that is further in goes on with the text of the one before.
//! A line of `*` stands for all modules that are not named: several of one kind, none of which uses another.
//! What stands in the crate's root itself (types that several modules share) may be used by all. The command's modules
//! are all in one, `cli`, which is their root.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use viewfuse_tests::places::repository;
use viewfuse_tests::source::{Source, files};

/// Crates whose modules have an order.
const CRATES: [&str; 15] = [
    "core", "vulkan", "host/job", "host/device", "host/weighting", "host/scene", "host/nn", "host/field",
    "host/output", "host/evaluate", "host/check", "host/pose", "host/view", "host/lab", "host/python",
];

/// A crate whose modules are in one of its modules, and that module.
const NESTED: [(&str, &str); 1] = [("host/cli", "cli")];

/// What stands in a list for all modules that it does not name.
const OTHERS: &str = "*";

/// A crate's root: modules, and what is reached through it from which module.
#[derive(Debug, Default)]
struct Root {
    modules: BTreeSet<String>,
    exports: BTreeMap<String, String>,
}

/// The paths that follow a place in code such as `use ` or `crate::`: the first two names of each.
fn heads(code: &str) -> Vec<(String, Option<String>)> {
    let code = code.trim_start();
    if let Some(group) = code.strip_prefix('{') {
        let (mut depth, mut start, mut found) = (0, 0, Vec::new());
        for (place, character) in group.char_indices() {
            match character {
                '{' => depth += 1,
                '}' if depth == 0 => {
                    found.extend(heads(&group[start..place]));
                    break;
                }
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    found.extend(heads(&group[start..place]));
                    start = place + 1;
                }
                _ => {}
            }
        }
        return found;
    }
    let end = code.find(|character: char| !character.is_alphanumeric() && character != '_').unwrap_or(code.len());
    if end == 0 {
        return Vec::new();
    }
    let first = code[..end].to_owned();
    match code[end..].strip_prefix("::") {
        Some(rest) => match heads(rest) {
            seconds if seconds.is_empty() => vec![(first, None)],
            seconds => seconds.into_iter().map(|(second, _)| (first.clone(), Some(second))).collect(),
        },
        None => vec![(first, None)],
    }
}

fn root(code: &str) -> Root {
    let mut root = Root::default();
    let mut is_test = false;
    for line in code.lines() {
        // Of unit tests only, as those files are.
        if std::mem::replace(&mut is_test, line == "#[cfg(test)]") {
            continue;
        }
        let line = line.strip_prefix("pub ").unwrap_or(line);
        let line = line.strip_prefix("pub(crate) ").unwrap_or(line);
        if let Some(name) = line.strip_prefix("mod ").and_then(|rest| rest.strip_suffix(';')) {
            root.modules.insert(name.to_owned());
        }
    }
    for (place, _) in code.match_indices("use ") {
        let rest = &code[place + 4..];
        let rest = rest.strip_prefix("crate::").or(rest.strip_prefix("self::")).unwrap_or(rest);
        for (module, name) in heads(rest) {
            if let (true, Some(name)) = (root.modules.contains(&module), name) {
                root.exports.insert(name, module);
            }
        }
    }
    root
}

/// The names that the crate's documentation lists, in their order.
fn listed(text: &str, modules: &BTreeSet<String>) -> Vec<String> {
    let documentation: Vec<&str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("//!").map(|line| line.strip_prefix(' ').unwrap_or(line)))
        .collect();
    let documentation = documentation.join("\n");
    for block in documentation.split("```text\n").skip(1) {
        let block = block.split("```").next().unwrap_or_default();
        let names: Vec<String> = block
            .lines()
            .filter(|line| !line.starts_with("   "))
            .flat_map(|line| line.trim_start().split("  ").next().unwrap_or_default().split(','))
            .map(|name| name.trim().to_owned())
            .filter(|name| !name.is_empty())
            .collect();
        if names.iter().any(|name| modules.contains(name)) {
            return names;
        }
    }
    Vec::new()
}

/// What is wrong with the list itself.
fn list_faults(listed: &[String], modules: &BTreeSet<String>) -> Vec<String> {
    let mut faults = Vec::new();
    for module in modules {
        match listed.iter().filter(|name| *name == module).count() {
            1 => {}
            0 if listed.iter().any(|name| name == OTHERS) => {}
            0 => faults.push(format!("{module} is not listed")),
            count => faults.push(format!("{module} is listed {count} times")),
        }
    }
    let is_none = |name: &&String| *name != OTHERS && !modules.contains(*name);
    faults.extend(listed.iter().filter(is_none).map(|name| format!("{name} is no module")));
    faults
}

/// Which modules of its crate a file uses, with the line of each; `depth` modules lie between it and the root, itself
/// included. The root is the crate's, or the module `inside` it.
fn uses(code: &str, depth: usize, root: &Root, inside: Option<&str>) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (place, _) in code.match_indices("::") {
        // The start of a path: `crate::` or as many `super::` as lead to the root.
        let before = &code[..place];
        let start =
            before.rfind(|character: char| !character.is_alphanumeric() && character != '_').map_or(0, |at| at + 1);
        let is_macro = before[..start].ends_with('$');
        let path = match &before[start..] {
            "crate" if !is_macro => match inside {
                None => &code[place + 2..],
                Some(module) => {
                    let path = code[place + 2..].strip_prefix(module).and_then(|rest| rest.strip_prefix("::"));
                    let Some(path) = path else { continue };
                    path
                }
            },
            "super" if !before[..start].ends_with("::") => {
                let rest = code[place + 2..].trim_start_matches("super::");
                let steps = 1 + (code.len() - place - 2 - rest.len()) / "super::".len();
                if steps != depth {
                    continue;
                }
                rest
            }
            _ => continue,
        };
        let line = 1 + before.matches('\n').count();
        for (name, _) in heads(path) {
            let module = if root.modules.contains(&name) { Some(&name) } else { root.exports.get(&name) };
            found.extend(module.map(|module| (line, module.clone())));
        }
    }
    found.dedup();
    found
}

/// What a crate's files use that stands behind them, and what is wrong with the list.
fn faults(folder: &Path) -> Vec<String> {
    faults_inside(folder, None)
}

/// The same of the modules of a module.
fn faults_inside(folder: &Path, inside: Option<&str>) -> Vec<String> {
    let source = inside.map_or_else(|| folder.join("src"), |module| folder.join("src").join(module));
    let file = inside.map_or_else(|| source.join("lib.rs"), |_| source.with_extension("rs"));
    let text = std::fs::read_to_string(file).expect("the root");
    let root = root(&Source::new(text.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default()).code);
    let listed = listed(&text, &root.modules);
    let mut faults = list_faults(&listed, &root.modules);
    let place_of = |name: &str| listed.iter().position(|listed| listed == name);
    let place = |module: &str| place_of(module).or_else(|| place_of(OTHERS));
    for path in files(&source, "rs") {
        let file = path.strip_prefix(&source).expect("inside").with_extension("");
        let parts: Vec<String> = file.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        // Unit tests may use everything.
        let is_test = parts.last().is_some_and(|name| name == "tests") || !root.modules.contains(&parts[0]);
        if parts == ["lib"] || is_test {
            continue;
        }
        for (line, used) in uses(&Source::read(&path).code, parts.len(), &root, inside) {
            if let (Some(user), Some(other)) = (place(&parts[0]), place(&used))
                && (other > user || other == user && used != parts[0])
            {
                let place = if other > user { "listed behind" } else { "of the same kind as" };
                faults.push(format!("{}:{line} uses {used}, which is {place} {}", file.display(), parts[0]));
            }
        }
    }
    faults
}

#[test]
fn modules_stand_in_the_order_of_the_data() {
    let mut wrong = Vec::new();
    for name in CRATES {
        wrong.extend(faults(&repository().join(name)).into_iter().map(|fault| format!("{name}: {fault}")));
    }
    for (name, module) in NESTED {
        let found = faults_inside(&repository().join(name), Some(module));
        wrong.extend(found.into_iter().map(|fault| format!("{name}: {fault}")));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The list of modules names no field: those have a row in `rows.rs`, and no other module is missing.
#[test]
fn modules_that_are_not_named_are_fields() {
    let source = repository().join("host/field/src");
    let text = std::fs::read_to_string(source.join("lib.rs")).expect("the root");
    let modules = root(&Source::new(&text).code).modules;
    let named = listed(&text, &modules);
    let rows = Source::read(&source.join("rows.rs")).code;
    let others: Vec<&String> = modules.iter().filter(|module| !named.contains(module)).collect();
    assert!(others.len() > 1, "{others:?}");
    for module in others {
        assert!(rows.contains(&format!("&{module}::ROW")), "{module} is neither listed nor a field");
    }
}

#[test]
fn a_module_that_uses_a_later_one_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| {
        let path = folder.path().join("src").join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    };
    let library = "//! ```text\n//! first, second  what they do\n//! third          the last\n//! ```\n\
                   pub mod second;\nmod first;\npub mod third;\npub use third::Thing;\npub struct Shared;\n";
    write("lib.rs", library);
    write("first.rs", "pub use crate::Shared; // crate::third\nmod inner;");
    write("first/inner.rs", "const A: &str = \"crate::third\"; use super::super::first; use super::third;");
    write("second.rs", "use crate::{first::{a, b}, Shared};");
    write("third.rs", "use crate::first; fn a() { super::second::b() }");
    assert_eq!(faults(folder.path()), [""; 0]);
    for text in ["use crate::{first, third::{a, b}};", "fn a() -> crate::Thing {}", "use super::{first::a, third};"] {
        write("second.rs", text);
        assert_eq!(faults(folder.path()), ["second:1 uses third, which is listed behind second"], "{text}");
    }
    write("second.rs", "");
    write("first/inner.rs", "use super::super::second;");
    assert_eq!(faults(folder.path()), ["first/inner:1 uses second, which is listed behind first"]);
    write("first/inner.rs", "");
    // Modules that are not named.
    write("lib.rs", &library.replacen("third ", "* ", 1).replace("mod first;", "mod first;\nmod fourth;"));
    for (text, fault) in [
        ("use crate::{first, third};", &[][..]),
        ("use super::fourth;", &["third:1 uses fourth, which is of the same kind as third"]),
    ] {
        write("third.rs", text);
        assert_eq!(faults(folder.path()), fault, "{text}");
    }
    write("third.rs", "");
    // Modules of a module.
    write("own.rs", "//! ```text\n//! first  what it does\n//! second  more\n//! ```\nmod first;\nmod second;");
    write("own/second.rs", "use crate::own::first::a; use super::first;");
    for (text, count) in [("use crate::second;", 0), ("use crate::own::second::a;", 1), ("use super::second;", 1)] {
        write("own/first.rs", text);
        assert_eq!(faults_inside(folder.path(), Some("own")).len(), count, "{text}");
    }
    // Lists that are wrong.
    for (from, to, fault) in [
        ("third ", "fourth", ["third is not listed", "fourth is no module"].as_slice()),
        ("first, second", "first, second, first", &["first is listed 2 times"]),
        ("//! ```text", "//! ```rust", &["first is not listed", "second is not listed", "third is not listed"]),
    ] {
        write("lib.rs", &library.replacen(from, to, 1));
        assert_eq!(faults(folder.path()), fault, "{from}");
    }
}
