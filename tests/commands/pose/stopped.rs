//! Runs that are killed or interrupted go on behind the attempts that they had finished.

use super::{REQUIRE, bare, no_program, no_scripts, posed, program};
use crate::{command, read_json};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use viewfuse_tests::command::{Outcome, files_below, interrupt, spawn};
use viewfuse_tests::patience::{end, wait_while_running};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![;
    no_scripts().or_else(no_program), REQUIRE => a_killed_run_goes_on, an_interrupted_run_keeps_what_it_has,
];

/// Photographs of the room and a program that keeps what it is asked, a line each, in a file of the run's own: what a
/// killed run has started may still be asked.
fn counted() -> Folder {
    let folder = bare(0..4);
    let real = fs::canonicalize(program().expect("a program")).expect("a path");
    folder.script("openmvg", &format!("tee -a \"$ASKED\" | '{}' \"$@\"\n", real.display()));
    folder
}

/// `run` names the run.
fn pose(folder: &Folder, run: &str, output: &str) -> Command {
    let mut command = command(folder, &format!("pose bare -o {output} --seed 2"));
    command.env("ASKED", folder.join(format!("asked-{run}")));
    command.env("VIEWFUSE_OPENMVG", folder.join("openmvg"));
    command
}

/// How often a run asked the program.
fn asked(folder: &Folder, run: &str) -> usize {
    fs::read_to_string(folder.join(format!("asked-{run}"))).unwrap_or_default().lines().count()
}

/// The answers that are kept for `posed`.
fn kept(folder: &Folder) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join(".posed.attempts")).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|end| end == "json")).collect()
}

/// The first run has left nothing but finished attempts; the second one makes the others, and what it writes is what a
/// run writes that nobody stopped.
fn a_killed_run_goes_on() {
    let folder = &counted();
    let mut child = spawn(pose(folder, "first", "posed"));
    wait_while_running(&mut child, || !kept(folder).is_empty());
    child.kill().expect("a process to kill");
    end(&mut child).expect("an end");
    assert!(!folder.path().join("posed").exists(), "no half of a scene");
    let finished = kept(folder).len();
    assert!(finished >= 1, "an attempt was kept");
    let earlier: Vec<(PathBuf, Vec<u8>)> =
        kept(folder).into_iter().map(|path| (path.clone(), fs::read(path).expect("a file"))).collect();
    posed(pose(folder, "second", "posed"));
    let all = read_json(folder.path().join("posed/pose.json"))["attempts"].as_array().expect("a list").len();
    assert_eq!(asked(folder, "second"), all - finished, "only what was missing");
    assert!(!folder.path().join(".posed.attempts").exists(), "nothing is kept behind the end");
    // A kill may come between the scene and the end of what was kept for it: the next run sees that it is not needed.
    fs::create_dir(folder.path().join(".posed.attempts")).expect("a folder");
    earlier.iter().for_each(|(path, bytes)| fs::write(path, bytes).expect("a file"));
    let refused = Outcome::of(pose(folder, "late", "posed"));
    assert!(refused.code == Some(1) && refused.stderr.contains("posed: exists already"), "{}", refused.stderr);
    assert!(!folder.path().join(".posed.attempts").exists(), "nothing is kept behind the end");
    posed(pose(folder, "whole", "whole"));
    let (posed, whole) = (folder.path().join("posed"), folder.path().join("whole"));
    for (path, _) in files_below(&posed).into_iter().filter(|(path, _)| path.is_file()) {
        let other = whole.join(path.strip_prefix(&posed).expect("inside"));
        if path.ends_with("pose.json") {
            assert_eq!(timeless(&path), timeless(&other));
        } else {
            assert_eq!(fs::read(&path).expect("a file"), fs::read(&other).expect("a file"), "{}", path.display());
        }
    }
}

/// The record without the seconds.
fn timeless(path: &Path) -> serde_json::Value {
    let mut record = read_json(path);
    for attempt in record["attempts"].as_array_mut().expect("a list") {
        attempt["seconds"] = 0.into();
    }
    record
}

fn an_interrupted_run_keeps_what_it_has() {
    let folder = counted();
    let mut child = spawn(pose(&folder, "first", "posed"));
    wait_while_running(&mut child, || !kept(&folder).is_empty());
    interrupt(child, "-INT");
    assert!(!folder.path().join("posed").exists() && !kept(&folder).is_empty(), "no half of a scene, and an attempt");
}
