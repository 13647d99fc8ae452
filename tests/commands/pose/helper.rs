//! Programs in the place of `viewfuse-openmvg` that stay, say too much, or are left alone: the command ends, and with
//! it what it started.

use super::{bare, no_scripts};
use crate::command;
use std::fs;
use std::path::Path;
use std::process::Command;
use viewfuse_tests::command::{assert_command_refused, interrupt, names_in, spawn};
use viewfuse_tests::patience::{end, send, wait_until, wait_while_running};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![;
    no_scripts() =>
        one_that_stays_is_ended,
        one_that_says_too_much_is_ended,
        none_outlives_the_command,
        scratch_of_a_kill_goes_with_the_next_run,
];

/// Photographs of the room beside a program `openmvg` of this script, which has `ready` written when it has begun, with
/// the numbers of processes.
fn with_script(script: &str) -> Folder {
    let folder = bare(0..3);
    folder.script("openmvg", script).write("scratch/notes.txt", "mine");
    folder
}

fn pose(folder: &Folder, solver: &str) -> Command {
    let mut pose = command(folder, &format!("pose bare -o posed --from {solver}"));
    pose.env("VIEWFUSE_OPENMVG", folder.join("openmvg")).env("VIEWFUSE_COLMAP", folder.join("openmvg"));
    pose.env("TMPDIR", folder.join("scratch"));
    pose
}

#[track_caller]
fn assert_ended(script: &str, part: &str) {
    let folder = with_script(script);
    assert_command_refused(pose(&folder, "openmvg"), folder.path(), &[part]);
}

fn one_that_stays_is_ended() {
    assert_ended("exec >&-\nsleep 100", "openmvg: closed its output without an answer, and stayed");
    assert_ended("echo oh >&2; exec >&- 2>&-\nsleep 100", "and stayed: oh");
    // One of before, which reads a job to the end of its input, said its version where it was asked for that.
    let earlier =
        "[ \"$1\" != --version ] || exec echo 'viewfuse-openmvg 0.1.0, openmvg-sfm 0.1.0'\nexec cat > /dev/null";
    assert_ended(earlier, "openmvg: is of an earlier version than this command: build it again");
    // What it started holds its output.
    assert_ended("sleep 100 &\nexit 3", "openmvg: ended without an answer (exit status: 3)");
    let out_of_reach = Command::new("setsid").arg("true").status().is_ok_and(|status| status.success());
    if out_of_reach {
        assert_ended("setsid sleep 10 &\nsleep 0.2; exit 4", "openmvg: ended without an answer (exit status: 4)");
    }
}

fn one_that_says_too_much_is_ended() {
    let line = r#"{"progress":{"stage":"matching","of":1,"done":0}}"#;
    assert_ended(&format!("exec yes '{line}'"), "openmvg: says its progress without end");
    let reason = "x".repeat(60_000);
    assert_ended(&format!("echo '{reason}' >&2; exit 1"), &format!("(exit status: 1): {}", &reason[..200]));
    // A long log is read to its end, or what writes it would not get there.
    let log = "head -c 300000 /dev/zero | tr '\\0' x >&2 && exit 3\nexit 4";
    assert_ended(log, &format!("(exit status: 3): {}", "x".repeat(200)));
    // A point that was seen a hundred thousand times, which has five thousand million pairs of directions.
    let camera = r#"{"focal":300,"principal":[160,120],"k1":0}"#;
    let photograph = |x: f64| format!(r#"{{"camera_from_world":[[1,0,0,{x}],[0,1,0,0],[0,0,1,0]],"reason":null}}"#);
    let seen = vec!["[0,[1,1]]"; 100_000].join(",");
    let answer = format!(
        r#"{{"solution":{{"solver":"a","cameras":[{camera}],"photographs":[{},{},{}],"points":[{{"position":[0,0,9],"error":0.1,"seen":[{seen}]}}]}}}}"#,
        photograph(0.0),
        photograph(1.0),
        photograph(2.0)
    );
    let folder = with_script("exec cat \"$(dirname \"$0\")/answer.json\"");
    folder.write("answer.json", answer);
    assert_command_refused(pose(&folder, "openmvg"), folder.path(), &["its answer does not fit the photographs"]);
    // COLMAP's log.
    let folder = with_script("exec yes 'a long line of a log that does not end'");
    assert_command_refused(pose(&folder, "colmap"), folder.path(), &["openmvg: says more than 64 MiB"]);
}

/// Whether a process is there that has not ended.
fn is_alive(process: &str) -> bool {
    let status = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    status.rsplit_once(") ").is_some_and(|(_, rest)| !rest.starts_with(['Z', 'X']))
}

/// The processes that a script wrote down.
fn processes(folder: &Path) -> Vec<String> {
    let text = fs::read_to_string(folder.join("processes")).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

/// It starts another one and waits for it, whatever signals of the terminal come.
const STAYS: &str = "trap '' INT TERM\nhere=$(dirname \"$0\")\nsleep 100 &\n\
                     printf '%s\\n' $$ $! > \"$here/new\"; mv \"$here/new\" \"$here/processes\"; wait; wait";

fn none_outlives_the_command() {
    for (signal, is_at_once) in [("-INT", false), ("-TERM", true)] {
        let folder = with_script(STAYS);
        let mut child = spawn(pose(&folder, "openmvg"));
        wait_while_running(&mut child, || processes(folder.path()).len() == 2);
        if is_at_once {
            // A second signal while the first one is still looked at ends the process at once.
            send("-STOP", &child);
            send(signal, &child);
            send("-INT", &child);
            send("-CONT", &child);
        }
        let started = processes(folder.path());
        match is_at_once {
            true => drop(end(&mut child).expect("an end")),
            false => interrupt(child, signal),
        }
        if cfg!(target_os = "linux") {
            wait_until("a helper lives on", || !started.iter().any(|process| is_alive(process)));
        }
        assert_eq!(names_in(&folder.path().join("scratch")), ["notes.txt"]);
    }
}

fn scratch_of_a_kill_goes_with_the_next_run() {
    let folder = with_script(STAYS);
    let scratch = folder.path().join("scratch");
    let mut child = spawn(pose(&folder, "openmvg"));
    wait_while_running(&mut child, || processes(folder.path()).len() == 2);
    child.kill().expect("a kill");
    end(&mut child).expect("an end");
    for process in processes(folder.path()) {
        let ended = Command::new("kill").args(["-KILL", &process]).status().expect("kill runs");
        assert!(ended.success());
    }
    assert_eq!(names_in(&scratch).len(), 2, "what the kill left, and a person's");
    // What has such a name and is a person's.
    folder.write("scratch/viewfuse-scratch-photos/a.txt", "mine");
    folder.write("openmvg", "#!/bin/sh\nexit 1\n");
    let before = names_in(&scratch).len();
    let outcome = viewfuse_tests::command::Outcome::of(pose(&folder, "openmvg"));
    assert_eq!(outcome.code, Some(1), "{}", outcome.stderr);
    assert_eq!((before, names_in(&scratch)), (3, vec!["notes.txt".to_owned(), "viewfuse-scratch-photos".to_owned()]));
    assert!(scratch.join("viewfuse-scratch-photos/a.txt").exists());
}
