//! The command `viewfuse`, called by its binary. It is a library so that tests can build it with all features, and so
//! that the laboratory's command speaks as this one does ([`shared`]).
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

/// What the laboratory's command has of this one: the terminal, outputs that replace no inputs, exit codes.
pub mod shared {
    pub use crate::cli::{
        Terminal, be_patient, keep_input, keep_others, listen, on_threads, parse_size, refuse_extension, say, wrong,
    };

    use crate::cli;
    use std::process::ExitCode;
    use viewfuse_job::progress::Interrupted;

    /// The exit code of what a command returned, once its error is printed: 1 the job failed, 2 wrong arguments, 130
    /// interrupted. A hint stands behind the error.
    pub fn finish(
        outcome: anyhow::Result<ExitCode>,
        hint: impl Fn(&anyhow::Error) -> Option<&'static str>,
    ) -> ExitCode {
        let error = match outcome {
            Ok(code) => return code,
            Err(error) => error,
        };
        if let Some(interrupted) = error.chain().find_map(|cause| cause.downcast_ref::<Interrupted>()) {
            cli::complain(interrupted);
            return ExitCode::from(cli::INTERRUPTED);
        }
        if let Some(wrong) = error.downcast_ref::<clap::Error>() {
            cli::complain_of_arguments(wrong);
            return ExitCode::from(2);
        }
        match hint(&error) {
            Some(hint) => cli::complain(format_args!("{error:#}; {hint}")),
            None => cli::complain(format_args!("{error:#}")),
        }
        ExitCode::from(if cli::is_of_arguments(&error) { 2 } else { 1 })
    }
}

/// Runs the command line and returns the exit code: 0 done, 1 the job failed, 2 wrong arguments, 130 interrupted.
pub fn main() -> ExitCode {
    shared::finish(cli::run(), cli::hint)
}
