//! What documents show beside commands that `readme.rs` runs to their end: the viewer, commands on photographs of a person, trainings
//! that take hours, commands in the text, and what is printed.

use super::{BINARY, binary, lab};
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_tests::command::{self, command, killed_when, toy};
use viewfuse_tests::places::{readmes, repository};
use viewfuse_tests::viewer::Program;

viewfuse_tests::trials![
    commands_in_the_text_have_these_options,
    pictures_are_as_good_as_is_said,
    a_page_of_python_and_of_rust
];

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Runs a command of a README as far as that goes, if it is one of those that do not end by themselves or need what is not here.
pub(super) fn run(line: &str) -> bool {
    if let Some(arguments) = line.strip_prefix("cargo run --release -- view ") {
        view(arguments);
    } else if let Some(arguments) = line.strip_prefix("viewfuse-lab scenes make ") {
        starts_to_write(arguments);
    } else if let Some(arguments) = line.strip_prefix("viewfuse-lab train ") {
        lacks_only_its_data(arguments);
    } else if let Some(arguments) = line.strip_prefix("viewfuse ") {
        let scene = toy();
        fs::rename(scene.file("toy"), scene.file("photographs")).expect("photographs");
        command::done(BINARY, scene.path(), arguments);
    } else {
        return false;
    }
    true
}

/// The viewer until its page is there; no browser is found that could be opened.
fn view(arguments: &str) {
    let nothing = tempfile::tempdir().expect("a folder");
    let mut view = command(BINARY, &repository(), &format!("view {arguments}"));
    view.env("PATH", nothing.path());
    let mut program = Program::of(view);
    let page = program.get("");
    let body = String::from_utf8_lossy(&page.body).to_ascii_lowercase();
    assert!(page.status == 200 && body.starts_with("<!doctype html>"), "{} {}", page.status, page.head);
    if cfg!(unix) {
        let (code, said) = program.interrupt();
        assert_eq!(code, Some(0), "{said}");
    }
}

/// Hours of generating: until the first scene is there.
fn starts_to_write(arguments: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let output = arguments.split(' ').nth(1).expect("a folder's name");
    let is_there = || fs::read_dir(folder.path().join(output)).is_ok_and(|mut entries| entries.next().is_some());
    killed_when(lab(), folder.path(), &format!("scenes make {arguments}"), is_there);
}

/// Hours of training: everything that is written on the command line is right, and the first file that it reads is missing.
fn lacks_only_its_data(arguments: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let outcome = command::run(lab(), folder.path(), &format!("train {arguments}"));
    let missing = ["no such file or folder", "No such file", "no data set: looked for"];
    let is_missing = missing.iter().any(|words| outcome.stderr.contains(words));
    assert!(outcome.code == Some(1) && is_missing, "{:?}: {}", outcome.code, outcome.stderr);
}

/// The code of a text: what stands between backticks, in a line.
fn spans(text: &str) -> impl Iterator<Item = &str> {
    text.lines().flat_map(|line| line.split('`').skip(1).step_by(2))
}

fn commands_in_the_text_have_these_options() {
    let mut count = 0;
    for path in readmes() {
        for span in
            spans(&read(&path)).filter(|span| ["viewfuse ", "viewfuse-lab "].iter().any(|own| span.starts_with(own)))
        {
            let mut words = span.split_whitespace().skip(1);
            let name = words.next().expect("a word");
            if !name.starts_with(|first: char| first.is_ascii_lowercase()) {
                continue;
            }
            let help = command::run(binary(name), &repository(), &format!("{name} --help"));
            assert_eq!(help.code, Some(0), "{}: {span}", path.display());
            for option in words.filter(|word| word.starts_with('-')) {
                let option = option.split('=').next().unwrap_or(option);
                let is_there = help.stdout.split([' ', ',', '\n']).any(|word| word == option);
                assert!(is_there, "{}: `{span}`: no {option}", path.display());
                count += 1;
            }
        }
    }
    assert!(count >= 5, "{count}");
}

/// The documents with pictures' lines.
fn documents() -> [PathBuf; 2] {
    ["README.md", "host/results/first_time.md"].map(|file| repository().join(file))
}

/// The numbers of a line.
fn numbers(line: &str) -> Vec<f64> {
    line.split([' ', '(', ')']).filter_map(|word| word.parse().ok()).collect()
}

/// Photographs that give a good picture, a soft one and a broken one: what the documents show is what is printed.
fn pictures_are_as_good_as_is_said() {
    let writes = std::env::var("VIEWFUSE_WRITE_TABLES").is_ok_and(|value| value == "1");
    let folder = tempfile::tempdir().expect("a folder");
    let mut scores = Vec::new();
    let main = read(&documents()[0]);
    let lines: Vec<&str> = main.lines().collect();
    for pair in lines.windows(2).filter(|pair| pair[0].starts_with("$ viewfuse render ")) {
        let [command_line, stored] = pair else { continue };
        let arguments = command_line.trim_start_matches("$ viewfuse ");
        let own = format!("-o {}/", folder.path().display());
        let outcome = command::run(BINARY, &repository(), &arguments.replace("-o out/", &own));
        assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
        let printed =
            outcome.stdout.lines().next().expect("a line").replace(&folder.path().display().to_string(), "out");
        for path in documents() {
            let text = read(&path);
            if writes {
                fs::write(&path, text.replace(stored, &printed)).expect("a document");
            } else {
                assert!(text.contains(&format!("{command_line}\n{stored}\n")), "{} has other lines", path.display());
            }
        }
        let (old, new) = (numbers(stored), numbers(&printed));
        let is_near = old.len() == new.len() && old.iter().zip(&new).all(|(old, new)| (old - new).abs() < 0.15);
        assert!(writes || is_near, "VIEWFUSE_WRITE_TABLES=1 writes it:\n{stored}\n{printed}");
        scores.push(new[0]);
    }
    assert!(scores.len() == 3 && scores[0] > scores[1] + 3.0 && scores[1] > scores[2] + 3.0, "{scores:?}");
}

/// The library in ten lines of each language: those of Rust are compiled as a test of the documentation, those of Python use what the
/// package's type stubs have.
fn a_page_of_python_and_of_rust() {
    let text = read(&repository().join("README.md"));
    let block = |fence: &str| text.split(fence).nth(1).expect("a block").split("```").next().expect("its end").trim();
    let (rust, python) = (block("```rust,no_run\n"), block("```python\n"));
    assert!(rust.lines().filter(|line| line.starts_with("    ")).count() <= 10, "{rust}");
    assert!(python.lines().count() <= 10 && python.contains("import viewfuse"), "{python}");
    let stubs = read(&repository().join("host/python/viewfuse.pyi"));
    for name in ["Scene", "render", "save"] {
        assert!(python.contains(&format!("{name}(")), "{name}");
        assert!([format!("class {name}"), format!("def {name}(")].iter().any(|own| stubs.contains(own)), "{name}");
    }
    assert!(stubs.contains("targets: ") && python.contains("targets="));
}
