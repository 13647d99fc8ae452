//! What documents show beside commands that `readme.rs` runs to their end: the viewer, commands on photographs of a
//! person, and trainings that take hours.

use super::readme::with_few_pictures;
use super::{BINARY, lab};
use std::fs;
use viewfuse_tests::command::{self, command, killed_when, toy};
use viewfuse_tests::places::repository;
use viewfuse_tests::viewer::Program;

/// Runs a command of a README as far as that goes, if it is one of those that do not end by themselves or need what is
/// not here.
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
        let few = with_few_pictures(arguments.split(' ').map(str::to_owned));
        command::done(BINARY, &scene, &few.join(" "));
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

/// Hours of training: everything that is written on the command line is right, and the first file that it reads is
/// missing.
fn lacks_only_its_data(arguments: &str) {
    let folder = tempfile::tempdir().expect("a folder");
    let outcome = command::run(lab(), folder.path(), &format!("train {arguments}"));
    let missing = ["no such file or folder", "No such file", "no data set: looked for"];
    let is_missing = missing.iter().any(|words| outcome.stderr.contains(words));
    assert!(outcome.code == Some(1) && is_missing, "{:?}: {}", outcome.code, outcome.stderr);
}
