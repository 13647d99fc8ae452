//! Running tests of the copy: which places each reaches, and which changes each notices.

use crate::copy::{Binary, copy};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// No driver: changes are in what the CPU runs.
const NO_DRIVER: &str = "/nowhere.json";

/// A test, what it reaches and how long it takes.
pub struct Test {
    pub group: String,
    pub name: String,
    pub binary: PathBuf,
    pub seconds: f64,
    pub reached: Vec<u32>,
}

/// What becomes of a test.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    Passes,
    Fails,
    /// It did not end.
    Hangs,
}

/// The group of a test that is asked, by its binary and name.
fn group(binary: &str, name: &str) -> Option<&'static str> {
    match binary {
        "parity" if name.starts_with("cpu::") => Some("case"),
        "parity" if name.starts_with("bodies::") || name.starts_with("workgroups::") => Some("bodies"),
        "numerics" => Some("numerics"),
        _ => None,
    }
}

/// Runs a test with a change, or with a list of what it reaches.
pub fn run(binary: &Path, name: &str, change: u32, list: Option<&Path>, limit: Duration) -> Outcome {
    let mut test = Command::new(binary);
    test.args([name, "--exact", "--test-threads=1"]).current_dir(copy().join("tests"));
    // One thread: changes run side by side.
    test.env("VK_DRIVER_FILES", NO_DRIVER).env("RAYON_NUM_THREADS", "1").env("VIEWFUSE_MUTANT", change.to_string());
    if let Some(list) = list {
        test.env("VIEWFUSE_MUTANT_LIST", list);
    }
    for name in ["VIEWFUSE_REQUIRE_VULKAN", "VK_ADD_DRIVER_FILES", "VIEWFUSE_REQUIRE_DRIVERS"] {
        test.env_remove(name);
    }
    let mut child = test.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("a test binary");
    let start = Instant::now();
    loop {
        match child.try_wait().expect("a process") {
            Some(status) if status.success() => return Outcome::Passes,
            Some(_) => return Outcome::Fails,
            None if start.elapsed() > limit => {
                child.kill().and_then(|()| child.wait()).expect("an end");
                return Outcome::Hangs;
            }
            None => std::thread::sleep(Duration::from_millis(2)),
        }
    }
}

/// Runs each test of these binaries that is asked once, and keeps a line for it: its group, its name, the binary,
/// seconds, and the places that it reaches.
pub fn list(binaries: &[Binary]) -> String {
    binaries.iter().map(listed).collect()
}

fn listed(binary: &Binary) -> String {
    let Binary { name: binary, path } = binary;
    let mut listing = Command::new(path);
    listing.arg("--list").env("VK_DRIVER_FILES", NO_DRIVER).current_dir(copy().join("tests"));
    let output = listing.output().expect("a list");
    let mut lines = String::new();
    for line in String::from_utf8_lossy(&output.stdout).lines() {
        let Some(name) = line.strip_suffix(": test") else { continue };
        let Some(group) = group(binary, name) else { continue };
        let list = copy().join("reached.txt");
        let _ = fs::remove_file(&list);
        let start = Instant::now();
        if run(path, name, u32::MAX, Some(&list), Duration::from_secs(120)) != Outcome::Passes {
            println!("not asked, it fails without a change: {name}");
            continue;
        }
        let seconds = start.elapsed().as_secs_f64();
        let reached = fs::read_to_string(&list).unwrap_or_default().replace('\n', " ");
        lines += &format!("{group}\t{name}\t{}\t{seconds:.3}\t{reached}\n", path.display());
    }
    lines
}

/// The tests of a list, the quickest first.
pub fn read(list: &str) -> Vec<Test> {
    let test = |line: &str| {
        let [group, name, binary, seconds, reached] = line.split('\t').collect::<Vec<_>>()[..] else {
            panic!("no test: {line}")
        };
        Test {
            group: group.to_owned(),
            name: name.to_owned(),
            binary: PathBuf::from(binary),
            seconds: seconds.parse().expect("seconds"),
            reached: reached.split_whitespace().map(|place| place.parse().expect("a place")).collect(),
        }
    };
    let mut tests: Vec<Test> = list.lines().map(test).collect();
    tests.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    tests
}
