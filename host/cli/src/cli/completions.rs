//! `viewfuse completions`: what a shell completes, and manual pages, from the command line itself.

use super::outputs::{keep_others, keep_unlike};
use super::printing::{data_out, say};
use clap::{Args, Command, ValueEnum};
use clap_complete::{Shell, generate};
use clap_mangen::Man;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_job::files::write_whole;

/// Name of the command in scripts and pages.
const NAME: &str = "viewfuse";

#[derive(Args)]
#[command(
    after_help = "Examples:\n  viewfuse completions bash -o ~/.local/share/bash-completion/completions/viewfuse\n  \
    viewfuse completions zsh -o ~/.zfunc/_viewfuse\n  \
    viewfuse completions man -o ~/.local/share/man/man1\n      a page for each command: man viewfuse-render"
)]
pub(crate) struct Arguments {
    /// The shell, or `man` for manual pages
    #[arg(value_name = "SHELL")]
    what: What,
    /// Write to this file, the pages to this folder [default: standard output; of the pages, the first]
    #[arg(short, long, value_name = "PATH")]
    output: Option<PathBuf>,
}

/// What is written.
#[derive(Clone, Copy, ValueEnum)]
enum What {
    Bash,
    Elvish,
    Fish,
    Powershell,
    Zsh,
    Man,
}

impl What {
    fn shell(self) -> Option<Shell> {
        match self {
            What::Bash => Some(Shell::Bash),
            What::Elvish => Some(Shell::Elvish),
            What::Fish => Some(Shell::Fish),
            What::Powershell => Some(Shell::PowerShell),
            What::Zsh => Some(Shell::Zsh),
            What::Man => None,
        }
    }
}

pub(crate) fn run(arguments: &Arguments, mut command: Command) -> anyhow::Result<ExitCode> {
    let output = arguments.output.as_deref();
    let Some(shell) = arguments.what.shell() else {
        write_pages(command, output)?;
        return Ok(ExitCode::SUCCESS);
    };
    let mut script = Vec::new();
    generate(shell, &mut command, NAME, &mut script);
    match output {
        Some(path) => {
            keep_others(path)?;
            keep_unlike(path, &script, is_script)?;
            write_whole(path, &script)?;
            say(path.display())?;
        }
        None => put(&script)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether a file is a script for the same shell as another one, by its first line: what a shell reads at its start may
/// name this command, too.
fn is_script(there: &[u8], new: &[u8]) -> bool {
    let first = |text: &[u8]| text.split(|byte| *byte == b'\n').find(|line| !line.is_empty()).map(<[u8]>::to_vec);
    first(there) == first(new)
}

/// A page for the command and each of its commands in a folder, or the first on standard output.
fn write_pages(mut command: Command, folder: Option<&Path>) -> anyhow::Result<()> {
    command.build();
    let page = |command: &Command| -> io::Result<Vec<u8>> {
        let mut page = Vec::new();
        Man::new(command.clone()).render(&mut page)?;
        Ok(page)
    };
    let Some(folder) = folder else { return Ok(put(&page(&command)?)?) };
    let commands = command.get_subcommands().filter(|within| within.get_name() != "help");
    let mut pages = Vec::new();
    for page_of in [&command].into_iter().chain(commands) {
        let path = folder.join(format!("{}.1", page_of.get_display_name().unwrap_or(page_of.get_name())));
        // Before the first is written, all are asked.
        keep_others(&path)?;
        pages.push((path, page(page_of)?));
    }
    for (path, page) in pages {
        write_whole(&path, &page)?;
        say(path.display())?;
    }
    Ok(())
}

/// Bytes on standard output. A closed pipe (`| head`) is no error.
fn put(bytes: &[u8]) -> io::Result<()> {
    match data_out().write_all(bytes) {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}
