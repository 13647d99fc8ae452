//! The compiled kernels are made from the sources as they are: nobody tests an old module.

use std::fs;
use std::path::Path;
use viewfuse_shader_compiler::split::Modules;
use viewfuse_shader_compiler::stamp::{Inputs, LIBRARIES, MODULE, SOURCES, STAMP, SUBGROUPS, Stamp, StampError};
use viewfuse_tests::places::repository;

/// What differs between a repository and what its stamp says.
fn stale(root: &Path) -> Vec<String> {
    let modules = Modules::read(root).expect("the modules");
    Stamp::read(root).expect("the stamp").stale(&Inputs::read(root).expect("the sources"), &modules)
}

/// A copy of everything that a stamp speaks of.
fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for path in SOURCES.into_iter().chain([MODULE, SUBGROUPS, STAMP, "Cargo.lock"]) {
        copy_all(&repository().join(path), &folder.path().join(path));
    }
    folder
}

fn copy_all(from: &Path, to: &Path) {
    fs::create_dir_all(to.parent().expect("a folder")).expect("a folder");
    if from.is_dir() {
        for entry in fs::read_dir(from).expect("a folder") {
            let entry = entry.expect("an entry");
            copy_all(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        fs::copy(from, to).expect("a copy");
    }
}

/// Changes a file's text.
fn change(root: &Path, file: &str, change: impl FnOnce(String) -> String) {
    let text = fs::read_to_string(root.join(file)).expect("a text");
    let changed = change(text.clone());
    assert_ne!(text, changed, "{file}");
    fs::write(root.join(file), changed).expect("a file");
}

#[test]
fn the_kernels_are_fresh() {
    assert_eq!(stale(&repository()), Vec::<String>::new(), "run `cargo shaders`");
}

#[test]
fn the_stamp_is_written_as_it_is_read() {
    let stamp = Stamp::read(&repository()).expect("the stamp");
    let text = fs::read_to_string(repository().join(STAMP)).expect("the stamp");
    assert_eq!(stamp.text(), text.replace('\r', ""));
    assert!(stamp.compiler.starts_with("rust-gpu 0.10.0, rustc "), "{}", stamp.compiler);
    let here = fs::canonicalize(repository()).expect("the repository").display().to_string();
    assert!(!text.contains(&here), "it names a path of this machine");
}

#[test]
fn a_changed_source_is_noticed() {
    for file in ["core/src/visual_hull/sweep.rs", "vulkan/shaders/src/ray_marching.rs", "vulkan/compiler/src/refine.rs"]
    {
        let folder = copy();
        assert_eq!(stale(folder.path()), Vec::<String>::new());
        change(folder.path(), file, |text| text + " ");
        assert_eq!(stale(folder.path()), [format!("source {file} has changed")]);
    }
}

#[test]
fn a_new_and_a_lost_source_are_noticed() {
    let folder = copy();
    fs::write(folder.path().join("core/src/visual_hull/new.rs"), "").expect("a file");
    fs::remove_file(folder.path().join("core/src/visual_hull/ray_marching.rs")).expect("a file");
    assert_eq!(
        stale(folder.path()),
        ["source core/src/visual_hull/ray_marching.rs is gone", "source core/src/visual_hull/new.rs is new"]
    );
}

#[test]
fn line_ends_of_another_system_are_no_change() {
    let folder = copy();
    change(folder.path(), "core/src/visual_hull/ray_marching.rs", |text| text.replace('\n', "\r\n"));
    assert_eq!(stale(folder.path()), Vec::<String>::new());
}

#[test]
fn a_changed_lock_is_noticed() {
    for library in LIBRARIES {
        let folder = copy();
        let name = format!("name = \"{library}\"\nversion = \"");
        change(folder.path(), "Cargo.lock", |text| text.replace('\r', "").replace(&name, &format!("{name}9")));
        assert_eq!(stale(folder.path()), [format!("library {library} has changed")]);
    }
    let folder = copy();
    change(folder.path(), "Cargo.lock", |text| text.replace("\"glam\"", "\"glum\""));
    let error = Inputs::read(folder.path()).expect_err("no glam");
    assert!(matches!(error, StampError::Unlocked { library: "glam", .. }), "{error}");
}

#[test]
fn another_module_is_noticed() {
    for name in [MODULE, SUBGROUPS] {
        let folder = copy();
        let mut module = fs::read(folder.path().join(name)).expect("the module");
        module[100] ^= 1;
        fs::write(folder.path().join(name), module).expect("a file");
        assert_eq!(stale(folder.path()), [format!("{name} is not the module that {STAMP} describes")]);
        fs::remove_file(folder.path().join(name)).expect("the module");
        let error = Modules::read(folder.path()).expect_err("no module");
        assert!(error.to_string().contains(name), "{error}");
    }
}

#[test]
fn a_missing_stamp_is_named() {
    let folder = copy();
    fs::remove_file(folder.path().join(STAMP)).expect("a file");
    assert!(Stamp::read(folder.path()).expect_err("no stamp").to_string().contains("kernels.toml"));
    fs::write(folder.path().join(STAMP), "module = 3").expect("a file");
    assert!(Stamp::read(folder.path()).expect_err("no stamp").to_string().contains("kernels.toml"));
}
