//! Progress where standard error is no terminal: each long command names its stages, its share never falls, and lines
//! come while it works, with the time that is left.

use super::command;
use std::fs;
use std::io::{BufRead, BufReader};
use std::ops::Range;
use std::path::Path;
use std::process::Stdio;
use std::sync::Mutex;
use viewfuse::check::check_kernel;
use viewfuse::check::measure::Role;
use viewfuse::device::cpu::Cpu;
use viewfuse::job::progress::Progress;
use viewfuse_tests::command::{toy, toy_twice};
use viewfuse_tests::places::data;
use viewfuse_vulkan::kernel::Kernel;

viewfuse_tests::trials![
    every_long_command_names_its_stages,
    training_and_its_scenes_name_their_stages,
    lines_come_while_it_works,
    a_check_says_what_is_compiled,
];

/// A line of progress.
#[derive(Debug)]
struct Line {
    /// In percent.
    share: u32,
    /// The stage, without the time that is left.
    stage: String,
    /// Whether the time that is left is told.
    has_time: bool,
}

impl Line {
    #[track_caller]
    fn read(text: &str) -> Line {
        let parts = text.strip_prefix("progress: ").and_then(|rest| rest.split_once(" %, "));
        let (share, words) = parts.unwrap_or_else(|| panic!("no line of progress: {text}"));
        let (stage, time) = words.split_once(", about ").unwrap_or((words, ""));
        Line { share: share.parse().expect("percent"), stage: stage.to_owned(), has_time: time.ends_with(" left") }
    }
}

/// Every change that a command tells; it must succeed.
#[track_caller]
fn lines(folder: &Path, arguments: &str) -> Vec<Line> {
    let mut run = command(folder, arguments);
    let output = run.env("VIEWFUSE_PROGRESS", "0").output().expect("the command starts");
    let said = String::from_utf8(output.stderr).expect("text");
    assert!(output.status.success(), "viewfuse {arguments}\n{said}");
    said.lines().filter(|line| line.starts_with("progress: ")).map(Line::read).collect()
}

/// The stages come in this order, among others; the share never falls and ends near the end.
#[track_caller]
fn assert_stages(lines: &[Line], expected: &[&str], arguments: &str) {
    let mut rest = lines.iter();
    for stage in expected {
        assert!(rest.any(|line| line.stage.contains(stage)), "{arguments}: no '{stage}' in its place: {lines:#?}");
    }
    for pair in lines.windows(2) {
        assert!(pair[0].share <= pair[1].share, "{arguments} goes back: {pair:?}");
    }
    let last = lines.last().expect("a line");
    assert!((50..=100).contains(&last.share), "{arguments}: {last:?}");
}

/// Commands with stages of theirs, in their order.
const COMMANDS: [(&str, &[&str]); 13] = [
    (
        "render toy --targets 20,21 --size 16x16 --device cpu --video y4m -o out",
        &["reading the sources", "choosing the scheme", "encoding", "view 1 of 2", "view 2 of 2", "writing video.y4m"],
    ),
    (
        "evaluate toy --targets 20,21 --sources 0..5 --size 16x16 --weights mean --weights auto --device cpu",
        &["reading photographs", "reading the sources", "mean, encoding", "mean, view 000021", "auto, view 000020"],
    ),
    (
        "evaluate toy again --targets 20 --sources 0..5 --size 16x16 --weights mean --device cpu",
        &["toy: mean, view 000020", "again: reading photographs", "again: mean, view 000020"],
    ),
    (
        "evaluate toy --protocol random --trials 2 --targets-per-trial 1 --size 16x16 --weights mean --device cpu",
        &["job 1 of 2, toy: reading", "job 1 of 2, toy: mean, view", "job 2 of 2, toy: mean, view"],
    ),
    (
        "points toy --size 32x32 --device cpu -o points.ply",
        &["reading the photographs", "depths of the views", "fusing the depths"],
    ),
    (
        "pareto toy --targets 20 --views 3 --size 16x16 --repeat 2 --only exact --device cpu -o sweep",
        &["reading the photographs", "cpu", "exact", "round 1 of 2", "round 2 of 2"],
    ),
    ("check --device cpu --seeds 1", &["picture: reading the sources", "picture: view 1 of 1", "fuse_views"]),
    ("verify weighting.json pixelnerf.safetensors --device cpu", &["weighting.json", "pixelnerf.safetensors"]),
    ("compare toy/rgb toy/rgb --device cpu", &["comparing pictures"]),
    ("convert pixelnerf.safetensors half.safetensors --half", &["converting"]),
    ("export toy --layout transforms -o exported", &["writing the photographs"]),
    ("bench --device cpu --rounds 2", &["round 1 of 2", "round 2 of 2"]),
    ("inspect toy", &["reading the photographs"]),
];

fn every_long_command_names_its_stages() {
    let folder = toy_twice();
    for (from, to) in [("weighting.json", "weighting.json"), ("pixelnerf_small.safetensors", "pixelnerf.safetensors")] {
        fs::copy(data(from), folder.join(to)).expect("a copy");
    }
    let mut has_time = false;
    for (arguments, expected) in COMMANDS {
        let lines = lines(&folder, arguments);
        assert_stages(&lines, expected, arguments);
        has_time |= lines.iter().any(|line| line.has_time);
    }
    assert!(has_time, "no command tells the time that is left");
}

fn training_and_its_scenes_name_their_stages() {
    let folder = toy();
    let make = "scenes make cars learn --train 2 --val 1 --test 0 --views 8 --test-views 8 --size 64";
    let told = lines(&folder, make);
    assert_stages(&told, &["making scenes"], make);
    assert!(told.len() > 20, "a step for each of 24 views: {told:#?}");
    let train = "train pixelnerf learn/cars --width 8 --objects 1 --rays 8 --coarse 4 --fine 2 --side 16 --steps 12 \
        --validate-every 4 --write-every 0 -o net";
    assert_stages(&lines(&folder, train), &["reading the scenes", "training"], train);
    let photograph = "scenes photograph room shoot --views 3 --size 32x24";
    assert_stages(&lines(&folder, photograph), &["photographing"], photograph);
}

/// Without its variable a line every five seconds; here every second, of work that is ended once it has told enough.
fn lines_come_while_it_works() {
    let scene = toy();
    let mut run = command(&scene, "render toy --orbit 5000 --size 96x96 --device cpu --no-sheets -o out");
    let run = run.env("VIEWFUSE_PROGRESS", "1").stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = run.spawn().expect("the command starts");
    let error = BufReader::new(child.stderr.take().expect("a pipe"));
    let told: Vec<Line> = error.lines().take(3).map(|text| Line::read(&text.expect("text"))).collect();
    child.kill().expect("a process to kill");
    child.wait().expect("a dead process");
    assert!(told.len() == 3 && told.is_sorted_by_key(|line| line.share), "{told:?}");
    // A command that takes less than the time between lines says nothing.
    let mut quick = command(&scene, "inspect toy --json");
    let quick = quick.env("VIEWFUSE_PROGRESS", "100000").output().expect("the command starts");
    assert!(quick.status.success() && quick.stderr.is_empty(), "{}", String::from_utf8_lossy(&quick.stderr));
}

/// Names of stages.
#[derive(Default)]
struct Stages(Mutex<Vec<String>>);

impl Progress for Stages {
    fn stage(&self, name: &str, _: Range<usize>, _: usize) {
        self.0.lock().expect("no panic").push(name.to_owned());
    }
}

/// Of a device other than the CPU, which has nothing to compile; here the CPU stands for it.
fn a_check_says_what_is_compiled() {
    for (role, expected) in [(Role::Other, ["compiling", "comparing"].as_slice()), (Role::Reference, &[])] {
        let stages = Stages::default();
        check_kernel(&Cpu, role, Kernel::ALL[0], 1, &stages).expect("a report");
        assert_eq!(stages.0.into_inner().expect("no panic"), expected);
    }
}
