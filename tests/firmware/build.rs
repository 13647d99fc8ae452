//! Hands the linker the start-up crate's script and the board's memory. Here and not in a configuration file, which
//! would be found from inside this folder only.

fn main() {
    println!("cargo:rerun-if-changed=memory.x");
    println!("cargo:rustc-link-search={}", std::env::var("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    // Sections are not padded to pages of a memory manager that is not there.
    println!("cargo:rustc-link-arg-bins=--nmagic");
}
