//! Programs as processes that end with their owner.

use crate::solution::SolverError;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;
use viewfuse_job::progress::Progress;

/// How often the person's wish to stop is looked at while a process says nothing.
pub(crate) const LOOK: Duration = Duration::from_millis(50);

/// A process, killed when it is dropped.
pub(crate) struct Process(pub(crate) Child);

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

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
/// cannot be written or read, [`SolverError::Interrupted`].
pub(crate) fn run(
    command: &mut Command,
    solver: &'static str,
    log: &Path,
    progress: &dyn Progress,
) -> Result<Ended, SolverError> {
    let program = Path::new(command.get_program()).to_path_buf();
    let broken = |error: std::io::Error| SolverError::Broken {
        program: program.clone(),
        problem: format!("{}: {error}", log.display()),
    };
    let output = File::create(log).map_err(broken)?;
    let errors = output.try_clone().map_err(broken)?;
    let started = command.stdin(Stdio::null()).stdout(output).stderr(errors).spawn();
    let mut process = Process(started.map_err(|cause| SolverError::not_started(solver, &program, &cause))?);
    let status = loop {
        progress.check()?;
        match process.0.try_wait().map_err(broken)? {
            Some(status) => break status,
            None => std::thread::sleep(LOOK),
        }
    };
    let said = String::from_utf8_lossy(&fs::read(log).map_err(broken)?).into_owned();
    Ok(Ended { status, said })
}
