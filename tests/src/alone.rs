//! A test in a process of its own, for what is counted for a whole process: memory, threads.

use std::env;
use std::process::Command;

const ALONE: &str = "VIEWFUSE_TEST_ALONE";

/// Runs the test of this name (its path in the binary) again, as the only one of a new process, and there `test`.
#[track_caller]
pub fn alone(name: &str, test: impl FnOnce()) {
    if env::var_os(ALONE).is_some() {
        return test();
    }
    let binary = env::current_exe().expect("the path of this program");
    let output = Command::new(binary).args([name, "--exact", "--nocapture"]).env(ALONE, "1").output();
    let output = output.expect("it starts again");
    let said = String::from_utf8_lossy(&output.stdout);
    println!("{said}");
    assert!(
        output.status.success() && said.contains("1 passed"),
        "{name}: {said}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
}
