//! No test is hidden from its binary, tests that a document names exist, and no path leads out of the repository.

use super::{list, packages, text};
use std::path::{Path, PathBuf};
use viewfuse_tests::places::repository;
use viewfuse_tests::source::{Source, files};

/// The root file of each test binary, and whether it has the standard library's harness.
fn rooms() -> Vec<(PathBuf, bool)> {
    let mut rooms = Vec::new();
    for package in packages() {
        let manifest = std::fs::read_to_string(text(&package, "manifest_path")).expect("a manifest");
        for target in list(&package, "targets").iter().filter(|target| list(target, "kind")[0] == "test") {
            let name = format!("name = \"{}\"\n", text(target, "name"));
            let sections = manifest.split("\n[[test]]\n").skip(1);
            let section = sections.filter_map(|rest| rest.split("\n[").next()).find(|section| section.contains(&name));
            let path = Path::new(text(target, "src_path")).canonicalize().expect("a file");
            rooms.push((path, !section.is_some_and(|section| section.contains("harness = false"))));
        }
    }
    rooms
}

/// Whether the module that a file is in declares it: otherwise it is not compiled.
fn is_declared(path: &Path, room: &Path) -> bool {
    let folder = path.parent().expect("a folder");
    let above = if Some(folder) == room.parent() { room.to_path_buf() } else { folder.with_extension("rs") };
    let name = path.file_stem().expect("a name").to_string_lossy();
    Source::read(&above).code.lines().any(|line| line == format!("mod {name};"))
}

/// A file that no module declares is not compiled, and in a binary without the harness the attribute `test` does
/// nothing but hide its function. Neither is a warning.
#[test]
fn every_test_is_run() {
    let rooms = rooms();
    assert!(rooms.len() > 5, "{rooms:#?}");
    for (main, has_harness) in &rooms {
        for path in files(main.parent().expect("a folder"), "rs") {
            assert!(path == *main || is_declared(&path, main), "{} is not compiled", path.display());
            let has_attribute = Source::read(&path).code.contains("#[test]");
            assert!(*has_harness || !has_attribute, "{}: its binary has no harness", path.display());
        }
    }
    // Nor are those of a library that is not tested inside.
    for package in packages() {
        for target in list(&package, "targets").iter().filter(|target| target["test"] == false) {
            let folder = Path::new(text(target, "src_path")).parent().expect("a folder").to_path_buf();
            for path in files(&folder, "rs").into_iter().filter(|_| list(target, "kind")[0] == "lib") {
                assert!(!std::fs::read_to_string(&path).expect("a file").contains("#[test]"), "{}", path.display());
            }
        }
    }
    let a_room = repository().join("tests/packages/main.rs");
    assert!(!is_declared(&a_room.with_file_name("forgotten.rs"), &a_room));
}

/// The last column of the tables of conventions names tests, by `folder: NAME` or by the name alone, and their files.
#[test]
fn tests_that_the_conventions_name_exist() {
    let sources = ["core", "host", "tests"].map(|folder| files(&repository().join(folder), "rs"));
    let read = |path: &PathBuf| std::fs::read_to_string(path).expect("a file");
    let code: String = sources.iter().flatten().map(read).collect();
    let exists = |name: &str| match name.ends_with(".rs") {
        true => repository().join("tests").join(name).is_file(),
        // A name without an underscore is a module's.
        false => !name.contains('_') || code.contains(&format!("fn {name}(")),
    };
    let page = read(&repository().join("host/scene/CONVENTIONS.md"));
    let cells = page.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |")?.rsplit(" | ").next());
    let spans = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2));
    let names: Vec<&str> = spans.filter_map(|span| span.rsplit([' ', ':']).next()).collect();
    let missing: Vec<&&str> = names.iter().filter(|name| !exists(name)).collect();
    assert!(names.len() > 50 && missing.is_empty(), "{} names, not there: {missing:?}", names.len());
    assert!(!exists("a_test_that_nobody_wrote") && !exists("scenes/nothing.rs"));
}

/// The repository tests itself: what it is built and tested with comes from the system or through environment
/// variables, which one line of the CI script may set to what lies beside the repository.
#[test]
fn no_path_leads_out_of_the_repository() {
    let beside = concat!("../", "shared");
    let comparisons = ["", "_gaussians", "_genvs", "_training"].map(|suffix| format!("tests/compare_pytorch{suffix}"));
    let scripts = ["tests/run", ".ci/run", "README.md", "Cargo.toml"].map(str::to_owned).into_iter().chain(comparisons);
    let mut paths: Vec<PathBuf> = scripts.map(|file| repository().join(file)).collect();
    for extension in ["rs", "toml", "md", "c", "h", "py"] {
        for folder in ["core", "vulkan", "host", "tests"] {
            paths.extend(files(&repository().join(folder), extension));
        }
    }
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let count = text.lines().filter(|line| line.contains(beside)).count();
        assert!(count <= usize::from(path.ends_with(".ci/run")), "{}: {count} lines", path.display());
    }
}
