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
                cli::complain(interrupted);
                return ExitCode::from(cli::INTERRUPTED);
            }
            if let Some(wrong) = error.downcast_ref::<clap::Error>() {
                cli::complain_of_arguments(wrong);
                return ExitCode::from(2);
            }
            match cli::hint(&error) {
                Some(hint) => cli::complain(format_args!("{error:#}; {hint}")),
                None => cli::complain(format_args!("{error:#}")),
            }
            if cli::is_of_arguments(&error) {
                return ExitCode::from(2);
            }
            ExitCode::from(1)
        }
    }
}
