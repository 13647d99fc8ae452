//! Ctrl-C in the middle of a render, and everywhere else.
#![cfg(unix)]

use std::fs;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use viewfuse_tests::command::{command, names_in, toy, without_progress};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    ctrl_c_leaves_whole_files_and_no_record,
    a_signal_ends_what_waits_for_a_pipe,
    a_signal_ends_long_pieces_of_work,
];

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
    let record = r#"{"viewfuse": "0.1.0", "frames": []}"#;
    fs::write(folder.path().join("out/run.json"), record).expect("an old record");
    fs::remove_file(folder.path().join("out/orbit-001.png")).expect("an old picture");
    assert_stops_cleanly(&folder, "-TERM");
}

/// CPU time of a process in seconds, of all its threads; `None` where the system does not say it, or after its end.
fn cpu_time(process: u32) -> Option<f64> {
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let mut numbers = text.rsplit_once(") ")?.1.split(' ').skip(11);
    let ticks = numbers.next()?.parse::<f64>().ok()? + numbers.next()?.parse::<f64>().ok()?;
    Some(ticks / 100.0)
}

/// Starts a command, sends a signal when `ready` holds for its CPU time, and waits for its end. It must take no more than
/// 2 s of CPU time from there, and leave nothing behind.
#[track_caller]
fn assert_ends_soon(folder: &Folder, arguments: &str, signal: &str, ready: impl Fn(f64) -> bool) {
    let before = viewfuse_tests::command::files_below(folder.path());
    let mut run = command(super::BINARY, folder.path(), arguments);
    let mut child = run.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the command starts");
    let process = child.id();
    let start = Instant::now();
    wait_for(&mut child, || cpu_time(process).map_or(start.elapsed().as_secs() > 1, &ready));
    let first = cpu_time(process).unwrap_or(0.0);
    let sent = Command::new("kill").args([signal, &process.to_string()]).status().expect("kill runs");
    assert!(sent.success());
    let (start, mut last) = (Instant::now(), first);
    while child.try_wait().expect("a process").is_none() {
        last = cpu_time(process).unwrap_or(0.0).max(last);
        if start.elapsed() > PATIENCE {
            child.kill().expect("a process to end");
            panic!("{signal} does not end viewfuse {arguments}");
        }
        sleep(Duration::from_millis(5));
    }
    let result = child.wait_with_output().expect("its output");
    let said = String::from_utf8_lossy(&result.stderr);
    assert_eq!(result.status.code(), Some(130), "viewfuse {arguments}: {said}");
    assert_eq!(said, "viewfuse: interrupted; nothing half-written is left behind\n");
    assert!(last - first < 2.0, "viewfuse {arguments} took {:.1} s of CPU time after {signal}", last - first);
    assert_eq!(viewfuse_tests::command::files_below(folder.path()), before, "viewfuse {arguments} left something");
}

fn a_signal_ends_what_waits_for_a_pipe() {
    let folder = toy();
    let made = Command::new("mkfifo").arg(folder.path().join("pipe")).status().expect("mkfifo runs");
    assert!(made.success());
    let waits = [
        "compare pipe toy/rgb/000000.png --device cpu",
        "convert pipe out.safetensors",
        "verify pipe --device cpu",
        "weights toy --target 20 --weights attention:pipe",
        "render toy --targets 20 --model pipe -o out",
        "report --pareto pipe -o page.html",
    ];
    for (index, arguments) in waits.into_iter().enumerate() {
        // `files_below` must not open the pipe, and does not: it asks for lengths only.
        let signal = ["-TERM", "-INT"][index % 2];
        let start = Instant::now();
        assert_ends_soon(&folder, arguments, signal, |_| start.elapsed() > Duration::from_millis(300));
    }
}

/// Pieces of work that do not look at the signal themselves.
fn a_signal_ends_long_pieces_of_work() {
    let folder = toy();
    let large = image::GrayImage::from_pixel(9000, 9000, image::Luma([99]));
    large.save(folder.path().join("large.png")).expect("a picture");
    assert_ends_soon(&folder, "compare large.png large.png --device cpu", "-TERM", |time| time > 0.5);
    // 512 MiB of zeros that take no room on a disk, and an output that has begun.
    let header = r#"{"a":{"dtype":"F32","shape":[134217728],"data_offsets":[0,536870912]}} "#;
    let mut file = (header.len() as u64).to_le_bytes().to_vec();
    file.extend(header.bytes());
    fs::write(folder.path().join("large.safetensors"), &file).expect("a file");
    let sparse = fs::OpenOptions::new().write(true).open(folder.path().join("large.safetensors")).expect("the file");
    sparse.set_len(file.len() as u64 + (512 << 20)).expect("zeros");
    assert_ends_soon(&folder, "convert large.safetensors out.safetensors --half", "-INT", |time| time > 0.3);
}
