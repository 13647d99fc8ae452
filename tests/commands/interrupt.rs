//! Ctrl-C in the middle of a render, and everywhere else.
#![cfg(unix)]

use super::start;
use std::fs::{self, OpenOptions};
use std::process::Command;
use std::thread::sleep;
use std::time::Duration;
use viewfuse_tests::command::{files_below, interrupt, names_in, resident_kib, toy};
use viewfuse_tests::patience::wait_while_running;
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    ctrl_c_leaves_whole_files_and_no_record, a_signal_ends_what_waits_for_a_pipe, a_signal_ends_long_pieces_of_work,
];

/// Starts a render that would take minutes, sends a signal when its second picture is there, and looks at what is left.
#[track_caller]
fn assert_stops_cleanly(folder: &Folder, signal: &str) {
    let output = folder.join("out");
    let mut child = start(folder, "render toy --orbit 5000 --size 96x96 -o out");
    wait_while_running(&mut child, || output.join("orbit-001.png").exists());
    interrupt(child, signal);
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
    let record = r#"{"viewfuse": "0.1.0", "frames": []}"#;
    fs::write(folder.join("out/run.json"), record).expect("an old record");
    fs::remove_file(folder.join("out/orbit-001.png")).expect("an old picture");
    assert_stops_cleanly(&folder, "-TERM");
}

/// Whether a process has a handler for SIGINT. Where the system does not say it, it counts as one that has.
fn catches_interrupts(process: u32) -> bool {
    let Ok(text) = fs::read_to_string(format!("/proc/{process}/status")) else { return true };
    let caught = text.lines().find_map(|line| u64::from_str_radix(line.strip_prefix("SigCgt:")?.trim(), 16).ok());
    caught.is_none_or(|signals| signals & 0b10 != 0)
}

fn a_signal_ends_what_waits_for_a_pipe() {
    let folder = toy();
    let made = Command::new("mkfifo").arg(folder.join("pipe")).status().expect("mkfifo runs");
    assert!(made.success());
    let waits = [
        "compare pipe toy/rgb/000000.png --device cpu",
        "verify pipe --device cpu",
        "weights toy --target 20 --weights attention:pipe",
        "report --pareto pipe -o page.html",
    ];
    for (index, arguments) in waits.into_iter().enumerate() {
        // `files_below` must not open the pipe, and does not: it asks for lengths only.
        let before = files_below(&folder);
        let mut child = start(&folder, arguments);
        let process = child.id();
        wait_while_running(&mut child, || catches_interrupts(process));
        // Then it soon waits for the pipe. A slow machine is still on the way there, which must end as well.
        sleep(Duration::from_millis(300));
        interrupt(child, ["-TERM", "-INT"][index % 2]);
        assert_eq!(files_below(&folder), before, "viewfuse {arguments} left something");
    }
}

/// Pieces of work that do not look at the signal themselves.
fn a_signal_ends_long_pieces_of_work() {
    let folder = toy();
    let large = image::GrayImage::from_pixel(9000, 9000, image::Luma([99]));
    large.save(folder.join("large.png")).expect("a picture");
    // 512 MiB of zeros that take no room on a disk.
    let header = r#"{"a":{"dtype":"F32","shape":[134217728],"data_offsets":[0,536870912]}} "#;
    let mut file = (header.len() as u64).to_le_bytes().to_vec();
    file.extend(header.bytes());
    fs::write(folder.join("large.safetensors"), &file).expect("a file");
    let sparse = OpenOptions::new().write(true).open(folder.join("large.safetensors")).expect("the file");
    sparse.set_len(file.len() as u64 + (512 << 20)).expect("zeros");

    let before = files_below(&folder);
    if cfg!(target_os = "linux") {
        let mut child = start(&folder, "compare large.png large.png --device cpu");
        // The first picture is there: what follows takes longer than that.
        let process = child.id();
        wait_while_running(&mut child, || resident_kib(process) > (9000 * 9000) >> 10);
        interrupt(child, "-TERM");
        assert_eq!(files_below(&folder), before);
    }
    let mut child = start(&folder, "convert large.safetensors out.safetensors --half");
    // The output has begun.
    wait_while_running(&mut child, || names_in(&folder).iter().any(|name| name.starts_with('.')));
    interrupt(child, "-INT");
    assert_eq!(files_below(&folder), before);
}
