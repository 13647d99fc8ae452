//! The C face: its header is the one that its sources make, and a C program that is compiled with all warnings as errors
//! gets the same bits as a call of core.
//!
//! Set `VIEWFUSE_WRITE_HEADER=1` to write the header instead of comparing it.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn face() -> PathBuf {
    repository().join("core/capi")
}

/// The header as the sources of the C face make it, in the order of the modules that hold its types first.
fn generated_header() -> String {
    let config = cbindgen::Config::from_file(face().join("cbindgen.toml")).expect("cbindgen's settings");
    let builder = ["status", "weigh", "fuse", "ray", "schedule"]
        .into_iter()
        .map(|module| face().join(format!("src/{module}.rs")))
        .fold(cbindgen::Builder::new().with_config(config), cbindgen::Builder::with_src);
    let mut header = Vec::new();
    builder.generate().expect("a header").write(&mut header);
    String::from_utf8(header).expect("UTF-8")
}

#[test]
fn the_header_is_fresh() {
    let path = face().join("include/viewfuse.h");
    let generated = generated_header();
    if std::env::var_os("VIEWFUSE_WRITE_HEADER").is_some() {
        std::fs::write(&path, &generated).expect("the header");
    }
    let stored = std::fs::read_to_string(&path).expect("the header");
    assert!(stored == generated, "{} is stale: VIEWFUSE_WRITE_HEADER=1 writes it", path.display());
}
