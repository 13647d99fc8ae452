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
    pub name: String,
    /// Whether it is a kernel's case, on the CPU or of the body itself.
    pub is_case: bool,
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

/// Whether a test is a kernel's case, by its binary and name; none for a test that is not asked.
fn is_case(binary: &str, name: &str) -> Option<bool> {
    match binary {
        "parity" => ["cpu::", "bodies::", "workgroups::"].iter().any(|part| name.starts_with(part)).then_some(true),
        "numerics" => Some(false),
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

/// Runs each test of these binaries that is asked once, and keeps a line for it: whether it is a case, its name, the
/// binary, seconds, and the places that it reaches.
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
        let Some(is_case) = is_case(binary, name) else { continue };
        let list = copy().join("reached.txt");
        let _ = fs::remove_file(&list);
        let start = Instant::now();
        if run(path, name, u32::MAX, Some(&list), Duration::from_secs(120)) != Outcome::Passes {
            println!("not asked, it fails without a change: {name}");
            continue;
        }
        let seconds = start.elapsed().as_secs_f64();
        let reached = fs::read_to_string(&list).unwrap_or_default().replace('\n', " ");
        lines += &format!("{is_case}\t{name}\t{}\t{seconds:.3}\t{reached}\n", path.display());
    }
    lines
}

/// The tests of a list, the quickest first.
pub fn read(list: &str) -> Vec<Test> {
    let test = |line: &str| {
        let [is_case, name, binary, seconds, reached] = line.split('\t').collect::<Vec<_>>()[..] else {
            panic!("no test: {line}")
        };
        Test {
            name: name.to_owned(),
            is_case: is_case == "true",
            binary: PathBuf::from(binary),
            seconds: seconds.parse().expect("seconds"),
            reached: reached.split_whitespace().map(|place| place.parse().expect("a place")).collect(),
        }
    };
    let mut tests: Vec<Test> = list.lines().map(test).collect();
    tests.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    tests
}
