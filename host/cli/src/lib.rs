//! The command `viewfuse`, called by its binary. It is a library so that tests can build it with all features.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;
use viewfuse_job::progress::Interrupted;

/// Runs the command line and returns the exit code: 0 done, 1 the job failed, 2 wrong arguments, 130 interrupted.
pub fn main() -> ExitCode {
    match cli::run() {
        Ok(code) => code,
        Err(error) => {
            if let Some(interrupted) = error.chain().find_map(|cause| cause.downcast_ref::<Interrupted>()) {
                eprintln!("viewfuse: {interrupted}");
                return ExitCode::from(130);
            }
            if let Some(wrong) = error.downcast_ref::<clap::Error>() {
                eprint!("{wrong}");
                return ExitCode::from(2);
            }
            match cli::hint(&error) {
                Some(hint) => eprintln!("viewfuse: {error:#}; {hint}"),
                None => eprintln!("viewfuse: {error:#}"),
            }
            ExitCode::from(1)
        }
    }
}
