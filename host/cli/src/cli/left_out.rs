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
            commands = commands.mut_subcommand(name, |command| mark(command, feature));
        }
    }
    commands
}

fn mark(command: clap::Command, feature: &str) -> clap::Command {
    let about = command.get_about().map(ToString::to_string).unwrap_or_default();
    command.about(format!("{about} [not in this build: feature `{feature}`]"))
}

/// A stand-in for each command, in a module of its name, if the build leaves it out.
macro_rules! commands {
    ($($command:ident $feature:literal),*) => {
        /// The commands that a build may leave out: name, feature, and whether this one has it.
        const COMMANDS: [(&str, &str, bool); [$($feature),*].len()] =
            [$((stringify!($command), $feature, cfg!(feature = $feature))),*];
        $(
            // Tests have all features, and try the stand-ins all the same.
            #[cfg(any(test, not(feature = $feature)))]
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

        /// What each stand-in says when it is called with these words.
        #[cfg(test)]
        fn answers(words: &[&str]) -> Vec<String> {
            use clap::{Args, FromArgMatches};
            vec![$({
                let command = $command::Arguments::augment_args(clap::Command::new(stringify!($command)));
                let matches = command.get_matches_from([&[stringify!($command)], words].concat());
                let arguments = $command::Arguments::from_arg_matches(&matches).expect("any words");
                $command::run(&arguments).expect_err("a command that is not built").to_string()
            }),*]
        }
    };
}

commands!(
    bench "check", check "check", completions "completions", pareto "pareto", pose "pose", report "report", scenes "scenes", train "train", verify "check",
    view "view"
);

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// The features of the command's package, as its manifest declares them.
    fn features() -> Vec<&'static str> {
        let manifest = include_str!("../../Cargo.toml");
        let section =
            manifest.split("\n[features]\n").nth(1).expect("features").split("\n[").next().expect("a section");
        section.lines().filter_map(|line| line.split_once(" = ")).map(|(name, _)| name).collect()
    }

    #[test]
    fn a_command_that_is_left_out_says_how_to_get_it() {
        for words in [[].as_slice(), &["--help"], &["a", "--device", "cpu", "-x"]] {
            let answers = answers(words);
            assert_eq!(answers.len(), COMMANDS.len());
            for (answer, (name, feature, _)) in answers.iter().zip(COMMANDS) {
                let line = answer.lines().next().expect("a line");
                assert!(line.contains(&format!("this build has no command `{name}`; ")), "{line}");
                for way in [
                    "cargo run --release --features",
                    "cargo install --path host/cli --features",
                    concat!(
                        "cargo install --git ",
                        env!("CARGO_PKG_REPOSITORY"),
                        " ",
                        env!("CARGO_PKG_NAME"),
                        " --features"
                    ),
                ] {
                    assert!(line.contains(&format!("`{way} {feature}")), "{way}: {line}");
                }
                assert!(features().contains(&feature), "{name}: there is no feature {feature}");
            }
        }
        assert!(env!("CARGO_MANIFEST_DIR").ends_with("host/cli"), "the path that is named");
        assert!(!features().contains(&"report-all"), "a feature that does not exist");
    }

    #[test]
    fn help_marks_what_is_left_out() {
        let commands = crate::cli::Arguments::command();
        for (name, feature, _) in COMMANDS {
            let command = commands.find_subcommand(name).unwrap_or_else(|| panic!("no command {name}"));
            let about = mark(command.clone(), feature).get_about().expect("what it does").to_string();
            let plain = command.get_about().expect("what it does").to_string();
            assert_eq!(about, format!("{plain} [not in this build: feature `{feature}`]"));
        }
    }
}
