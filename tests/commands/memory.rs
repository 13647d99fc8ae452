//! What a render takes of memory.

use super::{command, read_json};
use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;
use viewfuse_tests::command::toy;
use viewfuse_tests::trials::lacking;

viewfuse_tests::trials![;
    lacking(cfg!(target_os = "linux"), "the system does not say what a process takes") =>
        more_samples_take_no_more, a_larger_picture_takes_no_more,
];

/// Largest resident set in KiB of a command that must succeed, as the system counts it; looked at until it ends.
fn most_memory(folder: &Path, arguments: &str) -> u64 {
    let mut child = command(folder, arguments).stdout(Stdio::null()).spawn().expect("the command starts");
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    loop {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let peak = text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
        most = most.max(peak.unwrap_or(0));
        if let Some(status) = child.try_wait().expect("a status") {
            assert!(status.success(), "viewfuse {arguments}");
            return most;
        }
        sleep(Duration::from_millis(2));
    }
}

/// Of the rays of a GeNVS so many are worked on at once as take little memory; what it takes is known before.
fn more_samples_take_no_more() {
    let scene = toy();
    let render = |samples: u32| {
        let arguments = format!(
            "render toy --targets 20 --sources 000000,000008,000016 --model genvs:small --steps 2 --samples {samples} \
             --device cpu -o out"
        );
        most_memory(&scene, &arguments)
    };
    // All points of the rays with more samples would take at least 70 MB more.
    let (few, many) = (render(32), render(512));
    assert!(many < few + (24 << 10), "{few} KiB became {many} KiB");
    let record = read_json(scene.join("out/run.json"));
    let estimate = record["memory_estimate"].as_u64().expect("an estimate") >> 10;
    assert!(
        few > estimate / 2 && many < 3 * estimate / 2 + (16 << 10),
        "{few} to {many} KiB, {estimate} KiB estimated"
    );
}

fn a_larger_picture_takes_no_more() {
    let scene = toy();
    let render = |side: u32| {
        let arguments = format!(
            "render toy --targets 20 --sources 000000,000008,000016 --model formula:8 --exact --samples 32,4,4 \
             --size {side}x{side} --device cpu -o out{side}"
        );
        most_memory(&scene, &arguments)
    };
    // The smaller one is as many rays as are worked on at once; all rays of the larger one together would take three
    // times as much more, 20 MB.
    let (small, large) = (render(64), render(128));
    assert!(small > 4 << 10, "{small} KiB");
    assert!(large < small + (8 << 10), "{small} KiB became {large} KiB");
}
