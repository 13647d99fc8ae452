//! How the tests are arranged: few binaries, every test in one of them, and no path that leads out of the repository.

use super::{list, packages, text};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use viewfuse_tests::places::repository;
use viewfuse_tests::source::{Source, files};

/// So many test binaries there are at most.
const MAX_ROOMS: usize = 11;

/// The root file of each test binary, and whether it has the standard library's harness.
fn rooms() -> Vec<(PathBuf, bool)> {
    let mut rooms = Vec::new();
    for package in packages() {
        let manifest = PathBuf::from(text(&package, "manifest_path"));
        let manifest_text = std::fs::read_to_string(&manifest).expect("a manifest");
        for target in list(&package, "targets").iter().filter(|target| list(target, "kind")[0] == "test") {
            let name = format!("name = \"{}\"\n", text(target, "name"));
            let section =
                manifest_text.split("\n[[test]]\n").skip(1).find(|section| section.contains(&name)).unwrap_or_default();
            let section = section.split("\n[").next().unwrap_or_default();
            let path = Path::new(text(target, "src_path")).canonicalize().expect("a file");
            rooms.push((path, !section.contains("harness = false")));
        }
    }
    rooms
}

/// Tests that nobody runs: in a room without the harness the attribute does nothing but hide its function.
fn hidden(source: &Source, has_harness: bool) -> Vec<usize> {
    source.lines().filter(|(_, line)| !has_harness && line.contains("#[test]")).map(|(line, _)| line).collect()
}

/// Whether the module that a file is in declares it: otherwise it is not compiled.
fn is_declared(path: &Path, room: &Path) -> bool {
    let folder = path.parent().expect("a folder");
    let above = if Some(folder) == room.parent() { room.to_path_buf() } else { folder.with_extension("rs") };
    let name = path.file_stem().expect("a name").to_string_lossy();
    Source::read(&above).code.lines().any(|line| line == format!("mod {name};"))
}

#[test]
fn there_are_few_rooms_and_nothing_is_hidden_in_them() {
    let rooms = rooms();
    assert!((5..=MAX_ROOMS).contains(&rooms.len()), "{rooms:#?}");
    let mut files_in_rooms = BTreeSet::new();
    for (file, has_harness) in &rooms {
        let folder = file.parent().expect("a folder");
        assert!(
            file.ends_with("main.rs") && folder.parent() == Some(&repository().join("tests")),
            "{}",
            file.display()
        );
        for path in files(folder, "rs") {
            let source = Source::read(&path);
            assert_eq!(hidden(&source, *has_harness), [0; 0], "{}", path.display());
            assert!(!source.code.contains("#[path"), "{}", path.display());
            assert!(path == *file || is_declared(&path, file), "{} is not compiled", path.display());
            files_in_rooms.insert(path);
        }
    }
    // Outside the rooms there are only what they share, timings, and programs for a microcontroller.
    for path in files(&repository().join("tests"), "rs").into_iter().filter(|path| !files_in_rooms.contains(path)) {
        assert!(!Source::read(&path).code.contains("#[test]"), "{} is in no room", path.display());
    }
}

/// Tests assert no time. These files read a clock: to wait with a deadline, to choose work that takes long enough, or to print.
const CLOCKS: [&str; 8] = [
    "checkpoints/fuzz.rs",
    "commands/kill.rs",
    "commands/view/devtools.rs",
    "devices/time.rs",
    "fields/budget.rs",
    "fuzz/drive.rs",
    "fuzz/worker.rs",
    "src/patience.rs",
];

/// Assertions that name a time that was taken.
fn timed_assertions(source: &Source) -> Vec<usize> {
    let is_timed = |line: &str| line.contains("assert") && ["elapsed", "cpu_time"].iter().any(|own| line.contains(own));
    source.lines().filter(|(_, line)| is_timed(line)).map(|(line, _)| line).collect()
}

#[test]
fn no_test_asserts_a_clock() {
    let tests = repository().join("tests");
    let mut clocks = BTreeSet::new();
    for path in files(&tests, "rs").into_iter().filter(|path| !path.starts_with(tests.join("benches"))) {
        let source = Source::read(&path);
        if source.code.contains("Instant") {
            clocks.insert(path.strip_prefix(&tests).expect("inside").to_path_buf());
        }
        // The deadline of every wait.
        if !path.ends_with("src/patience.rs") {
            assert_eq!(timed_assertions(&source), [0; 0], "{}", path.display());
        }
    }
    assert_eq!(clocks, CLOCKS.map(PathBuf::from).into());
    let broken = Source::new("fn a() {\n    assert!(start.elapsed() < most);\n}\n");
    assert_eq!(timed_assertions(&broken), [2]);
}

#[test]
fn a_file_that_is_not_compiled_is_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("a file");
    std::fs::create_dir(folder.path().join("a")).expect("a folder");
    write("main.rs", "mod a;\n// mod c;\n");
    write("a.rs", "mod b;\n");
    let found = |name: &str| is_declared(&folder.path().join(name), &folder.path().join("main.rs"));
    assert_eq!(["a.rs", "a/b.rs", "c.rs", "a/c.rs"].map(found), [true, true, false, false]);
}

#[test]
fn a_hidden_test_is_found() {
    let source = Source::new("// #[test]\n\n#[test]\nfn a() {}\n");
    assert_eq!((hidden(&source, false), hidden(&source, true)), (vec![3], vec![]));
}

#[test]
fn a_library_that_is_not_tested_inside_has_no_tests_inside() {
    let mut count = 0;
    for package in packages() {
        for target in list(&package, "targets").iter().filter(|target| target["test"] == false) {
            if list(target, "kind")[0] == "lib" {
                count += 1;
                let folder = Path::new(text(target, "src_path")).parent().expect("a folder").to_path_buf();
                for path in files(&folder, "rs") {
                    let code = Source::new(&std::fs::read_to_string(&path).expect("a file")).code;
                    assert!(!code.contains("#[test]"), "{}", path.display());
                }
            }
        }
    }
    assert!(count > 5, "{count}");
}

/// The repository tests itself: what it is built and tested with comes from the system or through environment variables,
/// which one line of the CI script may set to what lies beside the repository.
#[test]
fn no_path_leads_out_of_the_repository() {
    let beside = concat!("../", "shared");
    let comparisons = ["", "_gaussians", "_genvs", "_training"].map(|of| format!("tests/compare_pytorch{of}"));
    let scripts = ["tests/run", ".ci/run"].map(str::to_owned).into_iter().chain(comparisons);
    let mut paths: Vec<PathBuf> = scripts.map(|file| repository().join(file)).collect();
    for extension in ["rs", "toml", "md", "c", "h", "py"] {
        for folder in ["core", "vulkan", "host", "tests"] {
            paths.extend(files(&repository().join(folder), extension));
        }
        let of_root = std::fs::read_dir(repository()).expect("a folder").map(|entry| entry.expect("an entry").path());
        paths.extend(of_root.filter(|path| path.extension().is_some_and(|own| own == extension)));
    }
    assert!(paths.len() > 300, "{}", paths.len());
    for path in paths {
        let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let count = text.lines().filter(|line| line.contains(beside)).count();
        assert!(count <= usize::from(path.ends_with(".ci/run")), "{}: {count} lines", path.display());
    }
}
