//! Waiting for other processes, and for what they leave.
//!
//! No test asserts a time: how fast something is belongs in `bench`, `cargo bench` and host/results. A process
//! that hangs would end no test, so every wait ends at one deadline.

use std::io;
use std::process::{Child, Command, ExitStatus};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// The deadline of every wait. The longest one, of an emulated processor, takes under two minutes on two idle cores: a
/// machine that is four times slower and runs four other busy processes does not reach the deadline.
pub const PATIENCE: Duration = Duration::from_secs(1800);

/// Time between two looks.
const PAUSE: Duration = Duration::from_millis(2);

/// Waits until `ready` holds; `problem` says what is wrong if it never does.
#[track_caller]
pub fn wait_until(problem: &str, mut ready: impl FnMut() -> bool) {
    let start = Instant::now();
    while !ready() {
        assert!(start.elapsed() < PATIENCE, "{problem}");
        sleep(PAUSE);
    }
}

/// Waits until `ready` holds; the process must still be running until then.
#[track_caller]
pub fn wait_while_running(child: &mut Child, mut ready: impl FnMut() -> bool) {
    wait_until("nothing appeared", || {
        let is_ready = ready();
        assert!(is_ready || child.try_wait().expect("a process").is_none(), "the command ended early");
        is_ready
    });
}

/// Waits for the end of a process; at the deadline it is killed.
///
/// # Errors
/// The deadline, or what the system says.
pub fn end(child: &mut Child) -> io::Result<ExitStatus> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status);
        }
        if start.elapsed() > PATIENCE {
            // It may have ended just now: then there is nothing to kill.
            child.kill().ok();
            child.wait()?;
            return Err(io::ErrorKind::TimedOut.into());
        }
        sleep(PAUSE);
    }
}

/// Sends a signal such as `-INT`.
#[track_caller]
pub fn send(signal: &str, child: &Child) {
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("kill runs");
    assert!(sent.success(), "{signal} is not sent");
}
