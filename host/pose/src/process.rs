//! Programs of others, as processes: what they say is bounded, and ends.

use crate::solution::SolverError;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};
use viewfuse_job::files::read_at_most;
use viewfuse_job::process::Process;
use viewfuse_job::progress::{Interrupted, Progress};

/// How often the person's wish to stop is looked at while a process says nothing.
pub(crate) const LOOK: Duration = Duration::from_millis(50);

/// Time for what should come at once: an end behind the last word, the last word behind an end.
pub(crate) const GRACE: Duration = Duration::from_secs(2);

/// Most bytes of a program's log.
const MAX_LOG: u64 = 64 << 20;

/// How a process ended, and what it said on standard output and standard error.
pub(crate) struct Ended {
    pub(crate) status: ExitStatus,
    pub(crate) said: String,
}

impl Ended {
    /// The last line that is not empty, which in programs' output is the one about the failure.
    pub(crate) fn last_line(&self) -> &str {
        self.said.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or("it said nothing")
    }
}

/// Runs a command to its end, or until the person stops the work. `log` is a file for what it says.
///
/// # Errors
/// [`SolverError::Missing`] with the name of the `solver` if it cannot be started, [`SolverError::Broken`] if the log
/// cannot be written or read or grows too long, [`SolverError::Interrupted`].
pub(crate) fn run(
    command: &mut Command,
    solver: &'static str,
    log: &Path,
    progress: &dyn Progress,
) -> Result<Ended, SolverError> {
    let program = Path::new(command.get_program()).to_path_buf();
    let broken = |problem: String| SolverError::Broken(program.clone(), problem);
    let of_log = |error: std::io::Error| broken(format!("{}: {error}", log.display()));
    let output = File::create(log).map_err(of_log)?;
    let errors = output.try_clone().map_err(of_log)?;
    command.stdin(Stdio::null()).stdout(output).stderr(errors);
    let process = Process::start(command).map_err(|cause| SolverError::not_started(solver, &program, &cause))?;
    let status = loop {
        progress.check()?;
        if fs::metadata(log).map_err(of_log)?.len() > MAX_LOG {
            return Err(broken(format!("says more than {} MiB", MAX_LOG >> 20)));
        }
        match process.try_wait().map_err(of_log)? {
            Some(status) => break status,
            None => std::thread::sleep(LOOK),
        }
    };
    let said = String::from_utf8_lossy(&read_at_most(log, MAX_LOG).map_err(of_log)?).into_owned();
    Ok(Ended { status, said })
}

/// How a process ended that has nothing more to say; `None` if it stays.
pub(crate) fn end_of(process: &Process, progress: &dyn Progress) -> Result<Option<ExitStatus>, Interrupted> {
    let start = Instant::now();
    loop {
        progress.check()?;
        match process.try_wait().ok().flatten() {
            None if start.elapsed() < GRACE => std::thread::sleep(LOOK),
            status => return Ok(status),
        }
    }
}
