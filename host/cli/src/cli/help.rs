//! The help: `-h` has what a person needs first, `--help` everything; and what a network's option says without a
//! network.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, Error};
use std::ffi::OsString;
use viewfuse_field::rows::ROWS;

/// Options that `-h` shows of the commands that have dozens, by their identifiers.
const FIRST: &str = "scene scenes targets orbit camera_path sources weights fast size background model device video \
                     replace output port no_browser protocol split verbose json latex shard help version";

/// An option of all networks.
const COMPUTE: &str = "compute";

/// The commands with dozens of options.
const LONG: [&str; 3] = ["render", "view", "evaluate"];

/// The commands, of which the longest show only the first options with `-h`.
pub(crate) fn shortened(mut commands: Command) -> Command {
    for name in LONG {
        commands = commands.mut_subcommand(name, |command| {
            command.mut_args(|argument| {
                let is_first = FIRST.split(' ').any(|first| first == argument.get_id().as_str());
                if is_first { argument } else { argument.hide_short_help(true) }
            })
        });
    }
    commands
}

/// Commands of the laboratory, which a person may look for here.
const IN_THE_LABORATORY: [&str; 3] = ["train", "scenes", "report"];

/// What is said of an option that other commands have.
fn of_another_command(error: &Error, commands: &Command) -> Option<String> {
    let Some(ContextValue::String(given)) = error.get(ContextKind::InvalidArg) else { return None };
    let has = |command: &&Command| {
        let mut long = command.get_arguments().filter_map(|argument| argument.get_long());
        given.strip_prefix("--").is_some_and(|given| long.any(|long| long == given))
    };
    let names: Vec<&str> = commands.get_subcommands().filter(has).map(Command::get_name).collect();
    let is_unknown = error.kind() == ErrorKind::UnknownArgument && !names.is_empty();
    is_unknown.then(|| format!("unexpected argument '{given}': it is an option of {}", names.join(", ")))
}

/// An error of arguments, in words where an option of a network was given without one, and where a command is the
/// laboratory's.
pub(crate) fn explained(error: Error, arguments: impl Iterator<Item = OsString>, command: &mut Command) -> Error {
    if let Some(ContextValue::String(name)) = error.get(ContextKind::InvalidSubcommand)
        && IN_THE_LABORATORY.contains(&name.as_str())
    {
        let message = format!(
            "`{name}` is a command of the laboratory: in the repository, `cargo run --release -p viewfuse-lab -- \
                {name}`"
        );
        return command.error(ErrorKind::InvalidSubcommand, message);
    }
    if let Some(message) = of_another_command(&error, command) {
        return command.error(ErrorKind::UnknownArgument, message);
    }
    let is_model = |value: &ContextValue| match value {
        ContextValue::Strings(missing) => missing.len() == 1 && missing[0].starts_with("--model "),
        _ => false,
    };
    let lacks_model =
        error.kind() == ErrorKind::MissingRequiredArgument && error.get(ContextKind::InvalidArg).is_some_and(is_model);
    if !lacks_model {
        return error;
    }
    let given: Vec<String> =
        arguments.filter_map(|word| Some(word.to_str()?.strip_prefix("--")?.split('=').next()?.to_owned())).collect();
    let of_network = |name: &String| {
        let row = ROWS.into_iter().find(|row| row.flags.iter().any(|flag| flag.name == *name));
        row.filter(|row| row.prefix().is_some()).map(|row| (name.clone(), row.title))
    };
    let message = match given.iter().find_map(of_network) {
        Some((name, title)) => {
            format!("--{name} is an option of a {title}, and needs its checkpoint: --model FILE")
        }
        None if given.iter().any(|name| name == COMPUTE) => {
            format!("--{COMPUTE} computes what a network leaves out, and needs its checkpoint: --model FILE")
        }
        None => return error,
    };
    command.error(ErrorKind::MissingRequiredArgument, message)
}
