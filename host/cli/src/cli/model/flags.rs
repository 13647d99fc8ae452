//! Flags of the fields, made from their rows. One that several fields have is stated once, and checked when the field is
//! known.

use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use viewfuse_field::options::{FieldOptions, Flag, FlagAbout};
use viewfuse_field::row::{Origin, Row};
use viewfuse_field::rows::ROWS;

/// Heading of the options of any network.
pub(super) const NETWORK: &str = "Options of networks";

/// The rows that have a flag, each with its form of it.
fn stated(name: &str) -> Vec<(&'static Row, &'static Flag)> {
    let of = |row: &'static Row| row.flags.iter().find(|flag| flag.name == name).map(|flag| (row, flag));
    ROWS.into_iter().filter_map(of).collect()
}

/// The names of all flags about something.
fn names(about: FlagAbout) -> Vec<&'static str> {
    let mut names = Vec::new();
    for flag in ROWS.iter().flat_map(|row| row.flags).filter(|flag| flag.about == about) {
        if !names.contains(&flag.name) {
            names.push(flag.name);
        }
    }
    names
}

fn argument(name: &'static str) -> Arg {
    let stated = stated(name);
    let mut help: Vec<&str> = stated.iter().map(|(_, flag)| flag.help).collect();
    help.dedup();
    let argument = Arg::new(name)
        .long(name)
        .help(help.join("; "))
        .help_heading(match &stated[..] {
            [(row, _)] => row.heading,
            _ => NETWORK,
        })
        .conflicts_with_all(stated.iter().flat_map(|(_, flag)| flag.conflicts.iter().copied()));
    let argument = match stated.iter().all(|(row, _)| matches!(row.origin, Origin::Learned { .. })) {
        true => argument.requires("model"),
        false => argument,
    };
    let Some(form) = stated.iter().find_map(|(_, flag)| flag.value) else {
        return argument.action(ArgAction::SetTrue);
    };
    let argument = argument.value_name(form);
    match stated[..] {
        [(_, flag)] => argument.value_parser(|text: &str| (flag.check)(text).map(|()| text.to_owned())),
        _ => argument,
    }
}

/// The given flags about something, with their values.
#[derive(Default)]
struct Given(Vec<(&'static str, String)>);

impl Given {
    fn of(matches: &ArgMatches, about: FlagAbout) -> Given {
        let value = |name: &'static str| match stated(name)[0].1.value {
            None => matches.get_flag(name).then(|| (name, String::new())),
            Some(_) => matches.get_one::<String>(name).map(|value| (name, value.clone())),
        };
        Given(names(about).into_iter().filter_map(value).collect())
    }
}

/// Declares the flags about something as a group of arguments.
macro_rules! groups {
    ($($(#[$doc:meta])* $Group:ident $about:ident)+) => {$(
        $(#[$doc])*
        pub(crate) struct $Group(Given);

        impl $Group {
            /// `options` with these flags.
            pub(crate) fn given_to(&self, options: FieldOptions) -> FieldOptions {
                self.0.0.iter().fold(options, |options, (name, value)| options.with(*name, value))
            }
        }

        impl FromArgMatches for $Group {
            fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
                Ok($Group(Given::of(matches, FlagAbout::$about)))
            }

            fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
                self.0 = Given::of(matches, FlagAbout::$about);
                Ok(())
            }
        }

        impl Args for $Group {
            fn augment_args(command: Command) -> Command {
                command.args(names(FlagAbout::$about).into_iter().map(argument))
            }

            fn augment_args_for_update(command: Command) -> Command {
                Self::augment_args(command)
            }
        }
    )+};
}

groups! {
    /// What the exact pictures depend on.
    PictureFlags Picture
    /// What is left out of them.
    EffortFlags Effort
    /// How a picture follows from the one before.
    SequenceFlags Sequence
}

impl SequenceFlags {
    /// Whether pictures follow from one another.
    pub(crate) fn are_given(&self) -> bool {
        !self.0.0.is_empty()
    }
}
