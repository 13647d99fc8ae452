//! The command `viewfuse` from start to end on the sample scene: what it prints, and what it writes.

mod bench;
mod browser;
mod budget;
mod check;
mod clouds;
mod compare;
mod convert;
mod devices;
mod errors;
mod examples;
mod folders;
mod genvs;
mod help;
mod hostile;
mod inspect;
mod interrupt;
mod kill;
mod limits;
mod lists;
mod masks;
mod memory;
mod moving;
mod optimise;
mod outputs;
mod pareto;
mod pose;
mod progress;
mod protocols;
mod python;
mod races;
mod readme;
mod render;
mod report;
mod scenes;
mod tables;
mod train;
mod trained;
mod verify;
mod view;

use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, ExitCode};
use std::sync::LazyLock;
use viewfuse_tests::command::{self, Outcome};

viewfuse_tests::trials![
    [
        bench, budget, check, clouds, compare, convert, devices, errors, folders, genvs, help, hostile, inspect,
        interrupt, kill, races, limits, lists, masks, memory, moving, optimise, outputs, pareto, pose, progress,
        protocols, python, readme, render, report, scenes, tables, train, trained, verify, view,
    ];
    help_fits_and_gives_examples,
];

const BINARY: &str = env!("CARGO_BIN_EXE_viewfuse");

/// Commands of the laboratory.
const IN_THE_LABORATORY: [&str; 3] = ["train", "scenes", "report"];

/// The laboratory's command. Cargo tells only tests of its own package where its binary is: this program is it under
/// its name.
fn lab() -> &'static str {
    static LINK: LazyLock<String> = LazyLock::new(|| {
        let link = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("viewfuse-lab{}", std::env::consts::EXE_SUFFIX));
        let other = link.with_extension(std::process::id().to_string());
        fs::hard_link(std::env::current_exe().expect("this program"), &other).expect("a link");
        fs::rename(&other, &link).expect("a name");
        // Two names of one file: renaming keeps both.
        let _ = fs::remove_file(&other);
        link.to_str().expect("text").to_owned()
    });
    &LINK
}

/// The command, the product's or the laboratory's, that knows the first of these words.
fn binary(arguments: &str) -> &'static str {
    let first = arguments.split_whitespace().next().unwrap_or_default();
    if IN_THE_LABORATORY.contains(&first) { lab() } else { BINARY }
}

fn main() -> ExitCode {
    if std::env::args_os().next().is_some_and(|name| Path::new(&name).file_stem() == Some("viewfuse-lab".as_ref())) {
        return viewfuse_lab::main();
    }
    viewfuse_tests::trials::run(trials())
}

/// The command that knows the first of these words, ready to be started in a folder.
fn command(folder: &Path, arguments: &str) -> Command {
    command::command(binary(arguments), folder, arguments)
}

/// Runs a command in a folder to its end.
fn run(folder: &Path, arguments: &str) -> Outcome {
    Outcome::of(command(folder, arguments))
}

/// Runs a command in a folder; it must succeed and say nothing on standard error.
#[track_caller]
fn done(folder: &Path, arguments: &str) -> String {
    command::done(binary(arguments), folder, arguments)
}

/// Runs a command in a folder; it must succeed, and may warn.
#[track_caller]
fn done_with_warnings(folder: &Path, arguments: &str) -> Outcome {
    let outcome = run(folder, arguments);
    assert_eq!(outcome.code, Some(0), "viewfuse {arguments}\n{}{}", outcome.stdout, outcome.stderr);
    outcome
}

/// As [`command::assert_refused`].
#[track_caller]
fn assert_refused(folder: &Path, arguments: &str, parts: &[&str]) {
    command::assert_refused(binary(arguments), folder, arguments, parts);
}

/// As [`command::assert_wrong_arguments`].
#[track_caller]
fn assert_wrong_arguments(folder: &Path, arguments: &str, parts: &[&str]) {
    command::assert_wrong_arguments(binary(arguments), folder, arguments, parts);
}

/// As [`command::killed_when`].
#[track_caller]
fn killed_when(folder: &Path, arguments: &str, ready: impl FnMut() -> bool) {
    command::killed_when(binary(arguments), folder, arguments, ready);
}

/// Starts a command in a folder, to be interrupted.
#[track_caller]
fn start(folder: &Path, arguments: &str) -> Child {
    command::spawn(command(folder, arguments))
}

/// What a file of JSON holds.
#[track_caller]
fn read_json(path: impl AsRef<Path>) -> Value {
    let bytes = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.as_ref().display()));
    serde_json::from_slice(&bytes).unwrap_or_else(|error| panic!("{}: {error}", path.as_ref().display()))
}

/// What a JSON list holds.
#[track_caller]
fn list_of(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap_or_else(|| panic!("{value} is no list"))
}

#[track_caller]
fn number_of(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[track_caller]
fn text_of(value: &Value) -> &str {
    value.as_str().unwrap_or_else(|| panic!("{value} is no text"))
}

/// The numbers of a JSON list.
#[track_caller]
fn numbers(list: &Value) -> Vec<f64> {
    list_of(list).iter().map(number_of).collect()
}

/// The texts of a JSON list.
#[track_caller]
fn texts(list: &Value) -> Vec<&str> {
    list_of(list).iter().map(text_of).collect()
}

#[track_caller]
fn assert_near(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} to within {tolerance}");
}

fn help_fits_and_gives_examples() {
    let here = Path::new(".");
    let version = done(here, "--version");
    assert_eq!(version.split_whitespace().next(), Some("viewfuse"), "{version}");
    let commands = ",pose,render,view,weights,select,points,inspect,evaluate,pareto,report,compare,completions,train,\
                    scenes make,devices,verify,check,bench";
    for name in commands.split(',') {
        let help = done(here, &format!("{name} --help"));
        let is_example = help.contains(&format!("viewfuse {name} ")) || help.contains(&format!("viewfuse-lab {name} "));
        assert!(name.is_empty() || is_example, "an example of {name}:\n{help}");
        assert!(name.is_empty() || help.contains("Example"), "an example of {name}:\n{help}");
        for line in help.lines() {
            assert!(line.chars().count() <= 110, "{line:?} is too long");
        }
    }
    assert!(done(here, "--help").contains("Exit code: 0 done, 1 the job failed, 2 wrong arguments, 130 interrupted."));
}
