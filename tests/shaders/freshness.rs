//! The compiled kernels are made from the sources as they are: nobody tests an old module.

use std::fs;
use std::path::Path;
use viewfuse_shader_compiler::split::Modules;
use viewfuse_shader_compiler::stamp::{
    CORE, Inputs, LIBRARIES, MANIFESTS, MATRICES, MODULE, SOURCES, STAMP, STAND_INS, SUBGROUPS, Stamp, StampError,
};
use viewfuse_shader_compiler::tokens::{names_in, tokens, without_modules};
use viewfuse_tests::places::repository;

/// What differs between a repository and what its stamp says.
fn stale(root: &Path) -> Vec<String> {
    let modules = Modules::read(root).expect("the modules");
    Stamp::read(root).expect("the stamp").stale(&Inputs::read(root).expect("the sources"), &modules)
}

/// A copy of everything that a stamp speaks of.
fn copy() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for path in
        SOURCES.into_iter().chain(MANIFESTS).chain([CORE, MODULE, SUBGROUPS, MATRICES, STAND_INS, STAMP, "Cargo.lock"])
    {
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
fn a_changed_token_is_noticed() {
    let folder = copy();
    // A body, its entry point, modules of core that bodies use themselves and through others, and what changes modules.
    for (file, from, to) in [
        ("core/kernels/src/bodies/rays.rs", "sample += 1;", "sample += 2;"),
        ("vulkan/shaders/src/entry.rs", "id.x < push.piece.count", "id.x <= push.piece.count"),
        ("core/src/depths.rs", "pub fn coarse_depth(", "pub fn coarser_depth("),
        ("core/src/random.rs", "pub fn ", "pub const fn "),
        ("core/src/sampler/mix.rs", "pub fn ", "pub const fn "),
        ("vulkan/compiler/src/refine.rs", "Op::FNegate", "Op::FAdd"),
        ("vulkan/shaders/Cargo.toml", "=0.10.0", "=0.10.1"),
    ] {
        let before = fs::read_to_string(folder.path().join(file)).expect("a text");
        change(folder.path(), file, |text| text.replacen(from, to, 1));
        assert_eq!(stale(folder.path()), [format!("source {file} has changed")]);
        fs::write(folder.path().join(file), before).expect("a file");
    }
}

#[test]
fn what_is_not_compiled_makes_nothing_stale() {
    let folder = copy();
    for (file, text) in [
        ("core/kernels/src/bodies/rays.rs", "//! Other words.\r\n// A comment.\n\n\n"),
        ("core/src/math.rs", "/* A comment. */ "),
        ("vulkan/shaders/Cargo.toml", "# A comment.\n"),
    ] {
        change(folder.path(), file, |source| format!("{text}{source}"));
    }
    change(folder.path(), "core/kernels/src/compact.rs", |source| source.replace('\n', "\r\n").replace("    ", "\t"));
    // No kernel computes a metric, nor with a new module.
    change(folder.path(), "core/src/metrics.rs", |source| source + "pub fn another() {}\n");
    change(folder.path(), "core/src/lib.rs", |source| {
        source.replace("pub mod metrics;", "pub mod new;\npub mod metrics;")
    });
    fs::write(folder.path().join("core/src/new.rs"), "pub fn new() {}").expect("a file");
    change(folder.path(), "vulkan/shaders/Cargo.toml", |source| {
        source.replace("description = \"", "description = \"New: ")
    });
    assert_eq!(stale(folder.path()), Vec::<String>::new());
    // Until one names them.
    change(folder.path(), "core/src/depths.rs", |source| source + "use crate::{fetch::Fetch as _, new::new as _};");
    assert_eq!(stale(folder.path()), ["source core/src/depths.rs has changed", "source core/src/new.rs is new"]);
}

#[test]
fn a_new_and_a_lost_source_are_noticed() {
    let folder = copy();
    fs::write(folder.path().join("core/kernels/src/visual_hull/new.rs"), "").expect("a file");
    fs::remove_file(folder.path().join("core/kernels/src/visual_hull/ray_marching.rs")).expect("a file");
    assert_eq!(
        stale(folder.path()),
        [
            "source core/kernels/src/visual_hull/ray_marching.rs is gone",
            "source core/kernels/src/visual_hull/new.rs is new"
        ]
    );
}

#[test]
fn a_source_that_is_not_rust_is_named() {
    let folder = copy();
    change(folder.path(), "core/kernels/src/compact.rs", |source| source + "}");
    let error = Inputs::read(folder.path()).expect_err("a brace too many");
    assert!(error.to_string().contains("compact.rs"), "{error}");
}

#[test]
fn tokens_are_what_the_compiler_reads() {
    let read = |text: &str| tokens(text).expect("tokens");
    assert_eq!(
        read("#![doc = \"a\"]\n/// b\n#[inline] fn c(d: &[u8]) { d+1 } // e"),
        read("#[inline]fn c(d:&[u8]){d + 1}")
    );
    assert_ne!(read("fn a() { b(1) }"), read("fn a() { b(2) }"));
    assert_ne!(read("fn a() { (b, c) }"), read("fn a() { [b, c] }"));
    assert_eq!(read("!a"), read("! /// b\na"));
    let names: Vec<String> =
        names_in(&read("use x::{a, b::{c, d}, e::f}; fn g() { x::h::i(); y::j() }"), "x").into_iter().collect();
    assert_eq!(names, ["a", "b", "e", "h"]);
    assert_eq!(
        without_modules(&read("pub mod a; mod b; mod c { fn d() {} } use e;")),
        read("mod c { fn d() {} } use e;")
    );
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
    assert!(matches!(error, StampError::Unlocked(_, "glam")), "{error}");
}

#[test]
fn another_module_is_noticed() {
    for name in [MODULE, SUBGROUPS, MATRICES, STAND_INS] {
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
