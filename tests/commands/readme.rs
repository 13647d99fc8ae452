//! The READMEs: their commands are run as they stand there, but for fewer pictures; their links and those of the
//! results' reports lead somewhere, and every published package has its own.

use super::{BINARY, examples, lab, list_of, text_of};
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use viewfuse_tests::places::{links, readmes, repository};
use viewfuse_tests::source::files;

viewfuse_tests::trials![
    every_command_runs, what_a_command_prints_is_shown, links_lead_somewhere, every_package_can_stand_alone,
    core_depends_on_mathematics_only,
];

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The lines of all `sh` blocks of all READMEs, each once.
fn commands() -> Vec<String> {
    let mut commands: Vec<String> = Vec::new();
    for path in readmes() {
        let mut inside = false;
        for line in read(&path).lines() {
            match line {
                "```sh" => inside = true,
                "```" => inside = false,
                _ if inside && !commands.iter().any(|known| known == line) => commands.push(line.to_owned()),
                _ => {}
            }
        }
    }
    commands
}

/// Lines of `sh` blocks that are not run here: how they begin, and why.
const NOT_RUN: [(&str, &str); 20] = [
    ("#", "a comment"),
    ("git clone", "the network"),
    ("tests/run", "it runs this test"),
    ("tests/gpu", "it runs all tests of a GPU"),
    ("cargo build --profile firmware -p viewfuse-capi", "`embedded/capi.rs` runs it"),
    ("cc ", "`embedded/capi.rs` compiles the program"),
    ("tests/figures", "it writes the results"),
    ("cargo run --release -- check", "`check.rs` runs it on the CPU, and `devices` on every device"),
    ("cargo run --release -- verify tests/data/pixelnerf_small", "another command verifies it with others"),
    ("cargo run --release -- verify tests/data/genvs_small", "the same"),
    ("cargo openmvg", "`tests/run` builds it, which takes minutes"),
    ("cargo run --release -- pose ", "`pose.rs` runs it where `viewfuse-openmvg` is"),
    ("cargo install", "it would change the machine"),
    ("pip install", "it would change the machine"),
    ("pip wheel", "`python.rs` builds the wheel where it is asked for"),
    ("host/python/test", "`python.rs` runs it where it is asked for"),
    ("VIEWFUSE_FUZZ_", "`fuzz` runs a part of it; the whole takes minutes"),
    ("seq ", "`protocols/cluster.rs` runs it where GNU parallel is"),
    ("srun ", "`protocols/cluster.rs` runs it where Slurm is"),
    ("  --shard ", "the same"),
];

/// The binary of the command or of the laboratory's, and its arguments.
fn ours(line: &str) -> Option<(&'static str, &str)> {
    let rest = line.strip_prefix("cargo run --release ")?;
    match rest.strip_prefix("-p viewfuse-lab -- ") {
        Some(arguments) => Some((lab(), arguments)),
        None => rest.strip_prefix("-- ").map(|arguments| (BINARY, arguments)),
    }
}

/// Half the size of the pictures of a scene.
const HALF_SIZES: [(&str, &str); 2] = [("tests/data/room", "160x120"), ("tests/data/toy", "48x48")];

/// The same arguments for one target, or a path of three pictures, of half the size, and a fifth of the steps of
/// training.
pub(super) fn with_few_pictures(words: impl Iterator<Item = String>) -> Vec<String> {
    let words: Vec<String> = words.collect();
    let half = HALF_SIZES.iter().find(|(scene, _)| words.get(1).is_some_and(|word| word == scene));
    let takes_size = ["render", "evaluate"].contains(&words[0].as_str()) && !words.iter().any(|word| word == "--size");
    let smaller = half.filter(|_| takes_size).map(|(_, size)| ["--size".to_owned(), (*size).to_owned()]);
    let mut option = String::new();
    let few = |word: String| {
        let few = match option.as_str() {
            "--orbit" | "--frames" => "3".to_owned(),
            "--targets" => word.split([',', '.']).next().unwrap_or_default().to_owned(),
            "--size" if word.contains('x') => halved(&word),
            "--steps" | "--validate-every" => {
                word.parse::<u32>().expect("a number of steps").div_ceil(5).max(2).to_string()
            }
            _ => word.clone(),
        };
        option = word;
        few
    };
    words.into_iter().map(few).chain(smaller.into_iter().flatten()).collect()
}

/// Half of `WIDTHxHEIGHT`.
fn halved(size: &str) -> String {
    let half = |side: &str| (side.parse::<u32>().expect("pixels") / 2).to_string();
    size.split('x').map(half).collect::<Vec<_>>().join("x")
}

fn run(binary: &str, arguments: &[String]) -> String {
    let output = Command::new(binary).args(arguments).current_dir(repository()).output().expect("the command starts");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

fn every_command_runs() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("out");
    let in_folder = |word: &str| match word == "out" || word.starts_with("out/") {
        true => word.replacen("out", &out.display().to_string(), 1),
        false => word.to_owned(),
    };
    let mut count = 0;
    let lines = commands();
    for (start, _) in NOT_RUN {
        assert!(lines.iter().any(|line| line.starts_with(start)), "no README has a command that begins with {start:?}");
    }
    for line in lines {
        if examples::run(&line) {
            continue;
        }
        let is_left_out = line.trim().is_empty() || NOT_RUN.iter().any(|(start, _)| line.starts_with(start));
        let Some((binary, arguments)) = ours(&line).filter(|_| !is_left_out) else {
            assert!(is_left_out, "neither run here nor in the list of what is not: {line}");
            continue;
        };
        count += 1;
        run(binary, &with_few_pictures(arguments.split_whitespace().map(in_folder)));
    }
    assert!(count >= 20, "{count}");
    let files = ["000020.png", "room/002_sheet.png", "run.json", "car/000048.png", "orbit/video.webp", "cameras.png"];
    let of_others = ["scores.csv", "attention.h", "weighting/model.safetensors", "report.html", "pareto/pareto.svg"];
    for file in files.into_iter().chain(of_others) {
        assert!(out.join(file).exists(), "{file}");
    }
}

/// A line `$ viewfuse ...` of a README, and the line that it prints first.
fn what_a_command_prints_is_shown() {
    let readme = read(&repository().join("README.md"));
    let lines: Vec<&str> = readme.lines().collect();
    let (folder, mut count) = (tempfile::tempdir().expect("a folder"), 0);
    for pair in lines.windows(2) {
        let Some(command) = pair[0].strip_prefix("$ viewfuse ") else { continue };
        let data = repository().join("tests/data").display().to_string();
        let mut run = Command::new(BINARY);
        run.args(command.replace("tests/data", &data).split_whitespace()).args(["--device", "cpu"]);
        let output = run.current_dir(folder.path()).output().expect("the command starts");
        let printed = String::from_utf8_lossy(&output.stdout);
        assert_eq!(printed.lines().next(), Some(pair[1]), "{command}");
        count += 1;
    }
    assert!(count >= 3, "{count}");
}

/// What headings are called in links.
fn headings(text: &str) -> Vec<String> {
    let kept = |c: &char| c.is_alphanumeric() || ['-', '_'].contains(c);
    let heading = |line: &str| line.trim_start_matches('#').trim().to_lowercase().replace(' ', "-");
    text.lines().filter(|line| line.starts_with('#')).map(|line| heading(line).chars().filter(kept).collect()).collect()
}

fn links_lead_somewhere() {
    let mut count = 0;
    let reports = files(&repository().join("host/results"), "md");
    for path in readmes().into_iter().chain(reports) {
        for (link, file, heading) in links(&path, &read(&path)) {
            assert!(file.exists(), "{}: {link}", path.display());
            if let Some(heading) = heading {
                let page = if file.is_dir() { file.join("README.md") } else { file };
                assert!(headings(&read(&page)).contains(&heading), "{}: {link}", path.display());
            }
            count += 1;
        }
    }
    assert!(count >= 30, "{count}");
}

fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .args(["--offline", "--locked"])
        .current_dir(repository())
        .output()
        .expect("cargo");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

/// What cargo knows of the workspace's packages.
pub(super) fn metadata() -> Value {
    serde_json::from_str(&cargo(&["metadata", "--no-deps", "--format-version", "1"])).expect("JSON")
}

fn every_package_can_stand_alone() {
    let metadata = metadata();
    let licences = |folder: &Path| ["LICENSE-MIT", "LICENSE-APACHE"].map(|name| read(&folder.join(name)));
    let ours = licences(&repository().join("host"));
    // The core's, the kernels' and the main README are compiled with the tests' library.
    let elsewhere = read(&repository().join("tests/src/lib.rs"));
    for package in list_of(&metadata["packages"]) {
        let name = text_of(&package["name"]);
        if package["publish"].is_array() {
            continue;
        }
        let folder = Path::new(text_of(&package["manifest_path"])).with_file_name("");
        assert!(licences(&folder) == ours, "{name}");
        // What the registry asks for.
        for field in ["description", "repository", "license", "readme"] {
            assert!(package[field].is_string(), "{name}: {field}");
        }
        let targets = list_of(&package["targets"]);
        let is_there = |kind: &str| targets.iter().any(|target| target["kind"] == serde_json::json!([kind]));
        // The command's library is its binary's.
        if is_there("lib") && !is_there("bin") {
            assert!(read(&folder.join("README.md")).contains("```rust"), "{name}: no example");
            let inside = folder.strip_prefix(repository()).expect("inside").join("README.md");
            let included = read(&folder.join("src/lib.rs")).contains("include_str!(\"../README.md\")")
                || elsewhere.contains(&format!("../../{}", inside.display()));
            assert!(included, "{name}: the README is not compiled");
        }
    }
}

fn core_depends_on_mathematics_only() {
    let tree = |extra: &[&str]| {
        let arguments = ["tree", "-p", "viewfuse-core", "-e", "normal,no-proc-macro", "--prefix", "none"];
        cargo(&[&arguments, extra].concat())
    };
    let packages = tree(&[]);
    let names: Vec<&str> = packages.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.contains(&"glam") && names.contains(&"libm"), "{names:?}");
    assert!(names.iter().all(|name| ["viewfuse-core", "glam", "libm", "bytemuck"].contains(name)), "{names:?}");
    let features = tree(&["-f", "{p} {f}"]);
    let has_std = features.lines().any(|line| {
        line.rsplit(' ').next().is_some_and(|features| features.split(',').any(|feature| feature == "std"))
    });
    assert!(!has_std, "{features}");
}
