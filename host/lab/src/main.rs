//! The command `viewfuse-lab`.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    viewfuse_lab::main()
}
