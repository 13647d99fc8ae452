//! Ctrl-C in the middle of a render.
#![cfg(unix)]

use std::fs;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use viewfuse_tests::command::{command, names_in, toy, without_progress};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![ctrl_c_leaves_whole_files_and_no_record,];

const PATIENCE: Duration = Duration::from_secs(120);

/// Waits until `ready` holds; the command must still be running then.
#[track_caller]
fn wait_for(child: &mut Child, ready: impl Fn() -> bool) {
    let start = Instant::now();
    while !ready() {
        assert!(child.try_wait().expect("a process").is_none(), "the command ended early");
        assert!(start.elapsed() < PATIENCE, "nothing appeared");
        sleep(Duration::from_millis(5));
    }
}

/// Starts a render that would take minutes, sends a signal when its second picture is there, and looks at what is left.
#[track_caller]
fn assert_stops_cleanly(folder: &Folder, signal: &str) {
    let output = folder.path().join("out");
    let arguments = "render toy --orbit 5000 --size 96x96 -o out";
    let mut run = command(super::BINARY, folder.path(), arguments);
    let mut child = run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the command starts");
    wait_for(&mut child, || output.join("orbit-001.png").exists());
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("kill runs");
    assert!(sent.success());
    let start = Instant::now();
    while child.try_wait().expect("a process").is_none() {
        if start.elapsed() > PATIENCE {
            child.kill().expect("a process to end");
            panic!("{signal} does not stop the command");
        }
        sleep(Duration::from_millis(5));
    }
    let result = child.wait_with_output().expect("its output");
    let said = without_progress(&String::from_utf8_lossy(&result.stderr));
    assert_eq!(result.status.code(), Some(130), "{said}");
    assert_eq!(said, "viewfuse: interrupted; nothing half-written is left behind\n");
    assert_eq!(String::from_utf8_lossy(&result.stdout), "");

    let names = names_in(&output);
    assert!(names.iter().any(|name| name == "orbit-001.png") && names.len() < 5000 * 3, "{names:?}");
    for name in names {
        // No run record, no temporary file; what the run continues from.
        if name == "frames.jsonl" {
            continue;
        }
        assert!(name.starts_with("orbit-") && name.ends_with(".png"), "{name} is left");
        image::open(output.join(&name)).unwrap_or_else(|error| panic!("{name} is not whole: {error}"));
    }
}

fn ctrl_c_leaves_whole_files_and_no_record() {
    let folder = toy();
    assert_stops_cleanly(&folder, "-INT");
    // Also over an older run: its record does not stay beside the new pictures.
    fs::write(folder.path().join("out/run.json"), "{}").expect("an old record");
    fs::remove_file(folder.path().join("out/orbit-001.png")).expect("an old picture");
    assert_stops_cleanly(&folder, "-TERM");
}
