//! Commands that a build leaves out because few people need them and they take long to compile. The help marks them, and each
//! says in one line how to get it.

use super::wrong;
use std::fmt::Display;

/// The error of a command or an option of a missing feature.
pub(crate) fn in_feature(what: impl Display, feature: &str) -> anyhow::Error {
    wrong(told(what, feature))
}

/// That this build lacks something, and how to get it.
pub(crate) fn told(what: impl Display, feature: &str) -> String {
    format!(
        "this build has no {what}; in the repository `cargo run --release --features {feature} -- ...` and \
         `cargo install --path host/cli --features {feature}` have it, elsewhere \
         `cargo install --git {} viewfuse-cli --features {feature}`",
        env!("CARGO_PKG_REPOSITORY")
    )
}

/// The commands with marks on those that this build leaves out.
pub(crate) fn marked(mut commands: clap::Command) -> clap::Command {
    for (name, feature, is_built) in COMMANDS {
        if !is_built {
            commands = commands.mut_subcommand(name, |command| {
                let about = command.get_about().map(ToString::to_string).unwrap_or_default();
                command.about(format!("{about} [not in this build: feature `{feature}`]"))
            });
        }
    }
    commands
}

/// A stand-in for each command, in a module of its name, if the build leaves it out.
macro_rules! commands {
    ($($command:ident $feature:literal),*) => {
        /// The commands that a build may leave out: name, feature, and whether this one has it.
        const COMMANDS: [(&str, &str, bool); [$($feature),*].len()] =
            [$((stringify!($command), $feature, cfg!(feature = $feature))),*];
        $(
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
                    Err(super::in_feature(concat!("command `", stringify!($command), "`"), $feature))
                }
            }
        )*
    };
}

commands!(
    bench "check", check "check", completions "completions", pareto "pareto", report "report", scenes "scenes", train "train", verify "check",
    view "view"
);
