//! What `tests/run` says at its end.
#![cfg(unix)]

use std::io::Write;
use std::process::{Command, Stdio};
use viewfuse_tests::places::repository;

/// The summary of what cargo printed before it ended with this exit code.
fn summary(printed: &str, code: i32) -> String {
    let script = repository().join("tests/summary.awk");
    let mut awk = Command::new("awk");
    awk.arg("-v").arg(format!("code={code}")).arg("-f").arg(script).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = awk.spawn().expect("awk");
    child.stdin.take().expect("a pipe").write_all(printed.as_bytes()).expect("a reader");
    let output = child.wait_with_output().expect("its output");
    assert!(output.status.success());
    String::from_utf8(output.stdout).expect("text")
}

/// Both harnesses, a binary that ends without a result, and an example of a document.
const PRINTED: &str = "     Running unittests src/lib.rs (target/release/deps/viewfuse_core-0123abcd)

running 2 tests
test a::b ... ok
test a::c ... ignored, needs a thing

test result: ok. 1 passed; 0 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s

     Running tests/commands/main.rs (target/release/deps/commands-0123abcd)

running 3 tests
test [no Chromium: tests/run installs it] view::x ... ignored
test b::x ... ok
test b::y ... FAILED

failures:

---- b::y ----
test panicked at tests/commands/b.rs:7

failures:
    b::y

test result: FAILED. 1 passed; 1 failed; 1 ignored; 0 measured; 0 filtered out; finished in 1.2s

error: test failed, to rerun pass `-p viewfuse-cli --test commands`
     Running tests/devices/main.rs (target/release/deps/devices-0123abcd)

running 2 tests
test c::x ... ok
error: test failed, to rerun pass `-p viewfuse-cli --test devices`
   Doc-tests viewfuse_core

running 1 test
test core/src/x.rs - foo (line 3) ... ok

test result: ok. 1 passed; 0 failed; 0 ignored; 0 measured; 0 filtered out; finished in 0.00s

error: 2 targets failed:
    `-p viewfuse-cli --test commands`
    `-p viewfuse-cli --test devices`
";

#[test]
fn what_failed_and_what_was_ignored_is_said_in_one_line_each() {
    let expected = "
== summary
ignored: viewfuse_core: a::c: needs a thing
ignored: commands: view::x: no Chromium: tests/run installs it
failed: commands: b::y
failed: -p viewfuse-cli --test devices: it ended without a result of its tests
3 passed, 2 failed, 2 skipped
";
    assert_eq!(summary(PRINTED, 101), expected);
}

#[test]
fn what_did_not_run_is_no_success() {
    let said = summary("error: could not compile `viewfuse-core`\n", 101);
    assert!(said.ends_with("failed: cargo test, exit code 101: see above\n0 passed, 1 failed, 0 skipped\n"), "{said}");
    let said = summary("test result: ok. 5 passed; 0 failed; 0 ignored; 0 measured\n", 0);
    assert!(said.ends_with("== summary\n5 passed, 0 failed, 0 skipped\n"), "{said}");
}
