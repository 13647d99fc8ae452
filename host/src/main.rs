//! The command `viewfuse`.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    match cli::run() {
        Ok(code) => code,
        Err(error) => {
            eprintln!("viewfuse: {error:#}");
            let interrupted = error.chain().any(|cause| cause.is::<viewfuse::interrupt::Interrupted>());
            ExitCode::from(if interrupted { 130 } else { 1 })
        }
    }
}
