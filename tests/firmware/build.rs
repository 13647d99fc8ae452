//! Hands the linker the start-up crate's script and the board's memory. Here and not in a configuration file, which
//! would be found from inside this folder only.

/// Programs that need more memory than the micro:bit has.
const LARGE: [&str; 2] = ["attention", "embeddings"];

fn main() {
    println!("cargo:rerun-if-changed=memory");
    let variable = |name: &str| std::env::var(name).expect("cargo sets it");
    let (folder, target) = (variable("CARGO_MANIFEST_DIR"), variable("TARGET"));
    for program in std::fs::read_dir(format!("{folder}/src/bin")).expect("the programs") {
        let file = program.expect("a program").file_name();
        let program = file.to_str().and_then(|name| name.strip_suffix(".rs")).expect("a program");
        let board = match target.as_str() {
            "thumbv6m-none-eabi" if !LARGE.contains(&program) => "microbit",
            target if target.starts_with("riscv32") => "virt",
            _ => "mps2",
        };
        println!("cargo:rustc-link-arg-bin={program}=-L{folder}/memory/{board}");
    }
    if target.starts_with("riscv32") {
        println!("cargo:rustc-link-arg-bins=-Tmemory.x");
    }
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    // Sections are not padded to pages of a memory manager that is not there.
    println!("cargo:rustc-link-arg-bins=--nmagic");
}
