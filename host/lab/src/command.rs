//! The command line of the laboratory: what each command takes. What each does is in its own file.

mod report;
mod scenes;
mod train;

use clap::{Parser, Subcommand};
use std::process::ExitCode;
use viewfuse_cli::shared;

use crate::train::TrainError;

#[derive(Parser)]
#[command(
    name = "viewfuse-lab",
    version,
    about = "Trains networks and weightings, generates scenes, and shows what was measured on a page.",
    after_help = "Exit code: 0 done, 1 the job failed, 2 wrong arguments, 130 interrupted.",
    max_term_width = 110
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Train a network, or the weighting of views for a network, on scenes.
    Train(Box<train::Arguments>),
    /// Generate scenes for training.
    Scenes(scenes::Arguments),
    /// Write an HTML page with evaluations, run times and trainings.
    Report(report::Arguments),
}

/// Runs the command line and returns the exit code: 0 done, 1 the job failed, 2 wrong arguments, 130 interrupted.
pub fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let run = || match arguments.command {
        Command::Train(arguments) => train::run(*arguments),
        Command::Scenes(arguments) => scenes::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
    };
    shared::finish(shared::listen().and_then(|()| run()), hint)
}

/// The hint at an option for an error, printed behind it.
fn hint(error: &anyhow::Error) -> Option<&'static str> {
    error.chain().find_map(|cause| match cause.downcast_ref::<TrainError>() {
        Some(TrainError::NotFinite { .. }) => Some("a lower --rate may help"),
        _ => None,
    })
}
