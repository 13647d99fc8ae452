//! Stand-ins for commands that a build leaves out because few people need them and they take long to compile. Each says in
//! one line how to get the command.

use super::wrong;
use std::fmt::Display;

/// The error of a command or an option of a missing feature.
pub(crate) fn in_feature(what: impl Display, feature: &str) -> anyhow::Error {
    wrong(format_args!(
        "this build has no {what}; `cargo run --release --features {feature} -- ...` has it, and so has \
         `cargo install viewfuse-cli --features {feature}`"
    ))
}

/// A stand-in for each command, in a module of its name, if the build leaves it out.
macro_rules! stand_ins {
    ($($command:ident $feature:literal),*) => {$(
        #[cfg(not(feature = $feature))]
        pub(crate) mod $command {
            use clap::Args;
            use std::ffi::OsString;
            use std::process::ExitCode;

            /// The command's arguments, which are ignored.
            #[derive(Args)]
            #[command(disable_help_flag = true)]
            pub(crate) struct Arguments {
                #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
                _all: Vec<OsString>,
            }

            pub(crate) fn run(_arguments: &Arguments) -> anyhow::Result<ExitCode> {
                Err(super::in_feature(concat!("command `", $feature, "`"), $feature))
            }
        }
    )*};
}

stand_ins!(pareto "pareto", report "report", train "train", view "view");
