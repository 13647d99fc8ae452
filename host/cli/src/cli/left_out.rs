//! Commands that this build leaves out: what they would compile costs most and serves fewest.

use super::wrong;
use clap::Args;
use std::ffi::OsString;
use std::process::ExitCode;

/// Whatever the command would take.
#[derive(Args)]
#[command(disable_help_flag = true)]
pub(crate) struct Arguments {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _all: Vec<OsString>,
}

/// Says how to get the command, whose feature has its name.
pub(crate) fn run(command: &str, _arguments: &Arguments) -> anyhow::Result<ExitCode> {
    Err(wrong(format_args!(
        "this build has no `{command}`: run `cargo run --release --features {command} -- {command} ...`, or install it \
         with `cargo install viewfuse-cli --features {command}`"
    )))
}
