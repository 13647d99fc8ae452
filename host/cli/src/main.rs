//! The command `viewfuse`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    viewfuse_cli::main()
}
