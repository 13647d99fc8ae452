//! Flags of the fields, made from their rows. One that several fields have is stated once, and checked when the field
//! is known.

use clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches};
use viewfuse_field::options::{Flag, FlagAbout, Given};
use viewfuse_field::row::Row;
use viewfuse_field::rows::ROWS;

/// Heading of the options of any network.
pub(super) const NETWORK: &str = "Options of networks";

/// The rows that have a flag, each with its form of it.
fn stated(name: &str) -> Vec<(&'static Row, &'static Flag)> {
    let flag_of = |row: &'static Row| row.flags.iter().find(|flag| flag.name == name).map(|flag| (row, flag));
    ROWS.into_iter().filter_map(flag_of).collect()
}

/// The names of all flags about something.
fn names(about: u8) -> Vec<&'static str> {
    let mut names = Vec::new();
    for flag in ROWS.iter().flat_map(|row| row.flags).filter(|flag| flag.about as u8 == about) {
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
    let is_learned = stated.iter().all(|(row, _)| row.prefix().is_some());
    let argument = if is_learned { argument.requires("model") } else { argument };
    match stated[..] {
        [(_, Flag { form: "", .. }), ..] => argument.action(ArgAction::SetTrue),
        [(_, flag)] => {
            let parse = move |text: &str| (flag.check)(text).map(|()| text.to_owned());
            argument.value_name(flag.form).value_parser(parse)
        }
        [(_, flag), ..] => argument.value_name(flag.form),
        [] => argument,
    }
}

/// The options that say how a field makes its pictures, for what makes them without one. `with_sequence`: where the
/// command has the options of sequences.
pub(crate) fn of_fields(with_sequence: bool) -> Vec<&'static str> {
    let about = [PICTURE, EFFORT].into_iter().chain(with_sequence.then_some(SEQUENCE));
    let flags = about.flat_map(names);
    flags.chain(["model", "compute", "leave_out", "early_termination", "max_error", "max_time"]).collect()
}

/// What flags are about, as a parameter.
pub(crate) const PICTURE: u8 = FlagAbout::Picture as u8;
pub(crate) const EFFORT: u8 = FlagAbout::Effort as u8;
pub(crate) const SEQUENCE: u8 = FlagAbout::Sequence as u8;

/// The given flags about something, with their values.
pub(crate) struct Flags<const ABOUT: u8>(Vec<(&'static str, String)>);

impl<const ABOUT: u8> Flags<ABOUT> {
    /// What is given, with these flags.
    pub(crate) fn add_to(&self, given: Given) -> Given {
        self.0.iter().fold(given, |given, (name, value)| given.with(*name, value))
    }

    /// Whether none is given.
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<const ABOUT: u8> FromArgMatches for Flags<ABOUT> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let value = |name: &'static str| match stated(name)[0].1.form {
            "" => matches.get_flag(name).then(|| (name, String::new())),
            _ => matches.get_one::<String>(name).map(|value| (name, value.clone())),
        };
        Ok(Flags(names(ABOUT).into_iter().filter_map(value).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Flags::from_arg_matches(matches)?;
        Ok(())
    }
}

impl<const ABOUT: u8> Args for Flags<ABOUT> {
    fn augment_args(command: Command) -> Command {
        command.args(names(ABOUT).into_iter().map(argument))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}
