//! The C face: its header is the one that its sources make, and C programs that are compiled with all warnings as
//! errors get the same bits as a call of core and a status for every mistake.
//!
//! Set `VIEWFUSE_WRITE_HEADER=1` to write the header instead of comparing it, `CC` for another compiler than `cc`.

mod expected;

use expected::Inputs;
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;
use viewfuse::weighting::attention::{AttentionModel, c_header};
use viewfuse_core::weighting::{ROWS, Row};
use viewfuse_tests::places::repository;

viewfuse_tests::trials![
    the_header_is_fresh, learned_attention_gives_the_same_bits, a_c_program_gets_the_same_bits_as_core,
    every_mistake_has_its_status, nothing_that_is_linked_can_panic, the_example_of_the_readme_runs,
];

/// The programs in C.
fn sources() -> PathBuf {
    repository().join("tests/embedded/capi")
}

fn face() -> PathBuf {
    repository().join("core/capi")
}

/// The enum of the formulas as text, from the schemes' rows: cbindgen expands no macros.
fn formulas() -> String {
    let mut rows = ROWS.to_vec();
    rows.sort_by_key(|row| row.formula as u32);
    let variant = |row: &Row| {
        let doc: String = row.doc.lines().map(|line| format!("    ///{line}\n")).collect();
        format!("{doc}    {} = {},\n", row.variant, row.formula as u32)
    };
    let doc =
        "The formulas of camera weighting. Weights are proportional to `1 / (e + 1e-6)`, except for the Gaussian.";
    let variants: String = rows.iter().map(variant).collect();
    format!("/// {doc}\n#[repr(u32)]\npub enum Formula {{\n{variants}}}\n")
}

/// The header as the sources of the C face and the schemes' rows make it.
fn generated_header() -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let formula_source = folder.path().join("formulas.rs");
    std::fs::write(&formula_source, formulas()).expect("a file");
    let config = cbindgen::Config::from_file(face().join("cbindgen.toml")).expect("cbindgen's settings");
    let [status, weigh, fuse, ray, schedule] =
        ["status", "weigh", "fuse", "ray", "schedule"].map(|module| face().join(format!("src/{module}.rs")));
    let builder = [status, formula_source, weigh, fuse, ray, schedule]
        .into_iter()
        .fold(cbindgen::Builder::new().with_config(config), cbindgen::Builder::with_src);
    let mut header = Vec::new();
    builder.generate().expect("a header").write(&mut header);
    String::from_utf8(header).expect("UTF-8")
}

fn the_header_is_fresh() {
    let path = face().join("include/viewfuse.h");
    let generated = generated_header();
    if std::env::var_os("VIEWFUSE_WRITE_HEADER").is_some() {
        std::fs::write(&path, &generated).expect("the header");
    }
    let stored = std::fs::read_to_string(&path).expect("the header");
    assert!(stored == generated, "{} is stale: VIEWFUSE_WRITE_HEADER=1 writes it", path.display());
    // Every entry point is there, also one in a module that this file forgot.
    let entry_points = |text: &str| text.matches("pub unsafe extern \"C\" fn").count();
    let sources = std::fs::read_dir(face().join("src")).expect("sources").map(|file| {
        let text = std::fs::read_to_string(file.expect("a file").path()).expect("text");
        entry_points(&text)
    });
    assert_eq!(stored.matches("\nviewfuse_status viewfuse_").count(), sources.sum::<usize>());
}

/// The static library as the README tells to build it; built once.
fn library() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("the target folder");
        let output = Command::new(env!("CARGO"))
            .args(["build", "--profile", "firmware", "-p", "viewfuse-capi", "--locked", "--offline"])
            .args(["--message-format", "json", "--target-dir"])
            .arg(target)
            .current_dir(repository())
            .output()
            .expect("cargo");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let messages = String::from_utf8(output.stdout).expect("UTF-8");
        messages
            .lines()
            .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
            .flat_map(|message| message["filenames"].as_array().cloned().unwrap_or_default())
            .filter_map(|name| name.as_str().map(PathBuf::from))
            .find(|name| name.extension().is_some_and(|extension| extension == "a"))
            .expect("a static library")
    })
}

/// Compiles a C program against the header and the library, warnings as errors.
fn compile(source: &Path, folder: &TempDir, flags: &[&OsStr]) -> PathBuf {
    const WARNINGS: &str = "-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wstrict-prototypes \
        -Wmissing-prototypes -Wcast-align -Wcast-qual -Wundef -Werror";
    let program = folder.path().join(source.file_stem().expect("a name"));
    let compiler = std::env::var_os("CC").unwrap_or_else(|| "cc".into());
    let output = Command::new(&compiler)
        .args(["-std=c99", "-O1"])
        .args(WARNINGS.split_whitespace())
        .arg("-I")
        .arg(face().join("include"))
        .args([source, library()])
        .args(flags)
        .arg("-o")
        .arg(&program)
        .output()
        .unwrap_or_else(|error| panic!("this test needs a C compiler; {compiler:?} does not start: {error}"));
    assert!(output.status.success(), "{}: {}", source.display(), String::from_utf8_lossy(&output.stderr));
    program
}

/// Attention that was learned drops into firmware: a header that the program writes, one call.
fn learned_attention_gives_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let learned = repository().join("host/models/pixelnerf_cars_attention.safetensors");
    let AttentionModel::Fourier(embedding) = AttentionModel::open(&learned).expect("learned attention") else {
        panic!("of the other embedding")
    };
    let header = c_header(&embedding, "pixelnerf_cars_attention.safetensors");
    std::fs::write(folder.path().join("attention.h"), header).expect("a header");
    let source = sources().join("attend.c");
    let program = compile(&source, &folder, &["-I".as_ref(), folder.path().as_os_str()]);
    let inputs = Inputs::new();
    let (poses, expected) = inputs.attended(&embedding);
    let bits: Vec<u32> =
        run(&program, &poses).lines().map(|line| u32::from_str_radix(line, 16).expect("bits")).collect();
    assert_eq!(bits, expected);
    // Not what equal weights would be.
    assert!(expected.iter().any(|bits| (f32::from_bits(*bits) - 1.0 / 3.0).abs() > 1.0e-3), "{expected:?}");
}

fn compile_ours(name: &str, folder: &TempDir) -> PathBuf {
    compile(&sources().join(name), folder, &[])
}

/// What a program prints, which must succeed.
#[track_caller]
fn run(program: &Path, input: &str) -> String {
    let mut child = Command::new(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    // The programs read everything before they print.
    child.stdin.take().expect("a pipe").write_all(input.as_bytes()).expect("the input");
    let output = child.wait_with_output().expect("the program ends");
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).expect("text")
}

/// What the program prints for these inputs: name and bits.
fn printed(program: &Path, inputs: &Inputs) -> Vec<(String, Vec<u32>)> {
    let bits = |word: &str| u32::from_str_radix(word, 16).expect("bits");
    let line = |line: &str| {
        let mut words = line.split(' ');
        (words.next().unwrap_or_default().to_owned(), words.map(bits).collect())
    };
    run(program, &inputs.hexadecimal()).lines().map(line).collect()
}

fn a_c_program_gets_the_same_bits_as_core() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = compile_ours("bits.c", &folder);
    let mut inputs = Inputs::new();
    let (actual, expected) = (printed(&program, &inputs), inputs.expected());
    assert_eq!(actual.len(), expected.len());
    for (place, (actual, expected)) in actual.iter().zip(&expected).enumerate() {
        assert_eq!(actual, expected, "line {place}");
    }
    assert!(expected.iter().flat_map(|(_, bits)| bits).all(|bits| f32::from_bits(*bits).is_finite()));
    let numbers: std::collections::BTreeSet<u32> = expected.iter().flat_map(|(_, bits)| bits).copied().collect();
    assert!(numbers.len() > 1000, "{}", numbers.len());
    // What is compared can differ: one camera moves a little.
    inputs.sources[0][3] *= 1.01;
    let moved = inputs.expected();
    for name in ["weigh", "attend", "fuse"] {
        assert!(actual.iter().zip(&moved).any(|(actual, moved)| actual.0 == name && actual != moved), "{name}");
    }
}

fn every_mistake_has_its_status() {
    let folder = tempfile::tempdir().expect("a folder");
    run(&compile_ours("errors.c", &folder), "");
}

fn nothing_that_is_linked_can_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = sources().join("bits.c");
    // What nothing calls is dropped, as in every firmware; Apple's linker has its own word for it.
    let drop = if cfg!(target_vendor = "apple") { "-Wl,-dead_strip" } else { "-Wl,--gc-sections" };
    let program = compile(&source, &folder, &[drop.as_ref()]);
    let output = Command::new("nm").arg(program).output().expect("nm, which comes with the linker");
    let symbols = String::from_utf8(output.stdout).expect("text");
    // Names are there to be found, and none is of a panic or of the formatting of its message.
    assert!(output.status.success() && symbols.contains("viewfuse_weigh_32"), "{symbols}");
    for name in ["panic", "4core3fmt"] {
        let found: Vec<&str> = symbols.lines().filter(|line| line.contains(name)).collect();
        assert!(found.is_empty(), "{found:?}");
    }
}

fn the_example_of_the_readme_runs() {
    let readme = std::fs::read_to_string(repository().join("core/capi/README.md")).expect("the README");
    let block = |language: &str, from: usize| {
        let start = readme[from..].find(&format!("```{language}\n")).expect("a block") + from + language.len() + 4;
        let length = readme[start..].find("```").expect("its end");
        (&readme[start..start + length], start + length)
    };
    let (program, end) = block("c", 0);
    let (prints, _) = block("text", end);
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join("sensors.c");
    std::fs::write(&source, program).expect("the program");
    assert_eq!(run(&compile(&source, &folder, &[]), ""), prints);
}
