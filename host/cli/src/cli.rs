//! The command line: what each command takes. What each does is in its own file.

mod check;
mod compare;
mod convert;
mod devices;
mod evaluate;
mod inspect;
mod left_out;
mod metrics_options;
mod model;
mod options;
#[cfg(feature = "pareto")]
mod pareto;
mod parse;
mod render;
#[cfg(feature = "report")]
mod report;
mod scenes;
mod table;
mod terminal;
#[cfg(feature = "train")]
mod train;
mod verify;
mod weights;

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

#[derive(Parser)]
#[command(
    name = "viewfuse",
    version,
    about = "From a handful of posed photographs, the picture from a camera that was never there.",
    long_about = "Few-shot novel view synthesis. Every source view is weighted by how relevant its camera is to the \
        target (\"Pay Attention to Where You Looked\"), and the weighted views are fused into a picture.\n\n\
        A scene is an SRN folder (rgb/, pose/, intrinsics.txt), a folder with transforms.json (Blender, instant-ngp, \
        nerfstudio), or a Middlebury folder with *_par.txt.",
    after_help = "Exit code: 0 done, 1 the job failed, 2 wrong arguments, 130 interrupted.",
    max_term_width = 110
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render novel views: pictures, depth maps, contact sheets and a run record.
    Render(render::Arguments),
    /// Show the weight that every scheme gives each source for a target.
    Weights(weights::Arguments),
    /// Show what was read: cameras from above, what they look at, and what looks wrong.
    Inspect(inspect::Arguments),
    /// Compare weighting schemes on views that are left out of the sources.
    Evaluate(evaluate::Arguments),
    /// Measure error against run time over what can be left out, on each device.
    #[cfg(feature = "pareto")]
    Pareto(pareto::Arguments),
    /// (Not in this build) Measure error against run time over what can be left out, on each device.
    #[cfg(not(feature = "pareto"))]
    Pareto(left_out::Arguments),
    /// Score pictures against what they should be.
    Compare(compare::Arguments),
    /// Learn a network, or the weighting of views for one, from scenes.
    #[cfg(feature = "train")]
    Train(train::Arguments),
    /// (Not in this build) Learn a network, or the weighting of views for one, from scenes.
    #[cfg(not(feature = "train"))]
    Train(left_out::Arguments),
    /// Make scenes to learn from.
    Scenes(scenes::Arguments),
    /// Write evaluations, run times and trainings as one HTML page.
    #[cfg(feature = "report")]
    Report(report::Arguments),
    /// (Not in this build) Write evaluations, run times and trainings as one HTML page.
    #[cfg(not(feature = "report"))]
    Report(left_out::Arguments),
    /// Write a checkpoint as safetensors.
    Convert(convert::Arguments),
    /// List the devices that kernels can run on, and what those that cannot be used lack.
    Devices(devices::Arguments),
    /// Compare this build with files of reference values.
    Verify(verify::Arguments),
    /// Check how closely each device agrees with the mathematics, kernel by kernel.
    Check(check::Arguments),
}

/// Runs the command that the process was started with.
pub(crate) fn run() -> anyhow::Result<ExitCode> {
    let mut command = Arguments::command();
    let matches = command.get_matches_mut();
    let arguments = Arguments::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
    terminal::listen()?;
    match arguments.command {
        Command::Render(arguments) => render::run(&arguments),
        Command::Weights(arguments) => weights::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments, options::values(&command, &matches)),
        #[cfg(feature = "pareto")]
        Command::Pareto(arguments) => pareto::run(&arguments),
        #[cfg(not(feature = "pareto"))]
        Command::Pareto(arguments) => left_out::run("pareto", &arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        #[cfg(feature = "train")]
        Command::Train(arguments) => train::run(&arguments),
        #[cfg(not(feature = "train"))]
        Command::Train(arguments) => left_out::run("train", &arguments),
        Command::Scenes(arguments) => scenes::run(&arguments),
        #[cfg(feature = "report")]
        Command::Report(arguments) => report::run(&arguments),
        #[cfg(not(feature = "report"))]
        Command::Report(arguments) => left_out::run("report", &arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Devices(arguments) => devices::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
    }
}

/// Arguments that do not fit what a file turned out to hold; the exit code is that of wrong arguments.
fn wrong(message: impl Display) -> anyhow::Error {
    clap::Error::raw(ErrorKind::ArgumentConflict, format_args!("{message}\n\nFor more information, try '--help'.\n"))
        .into()
}

/// Prints a line. A reader that has gone away (`| head`) is no reason to stop: files are still to be written.
fn say(text: impl Display) -> io::Result<()> {
    match writeln!(io::stdout().lock(), "{text}") {
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        outcome => outcome,
    }
}

/// Runs a piece of work on this many threads instead of all cores.
fn on_threads<T: Send>(threads: Option<u16>, work: impl FnOnce() -> T + Send) -> anyhow::Result<T> {
    match threads {
        None => Ok(work()),
        Some(count) => Ok(rayon::ThreadPoolBuilder::new().num_threads(count.into()).build()?.install(work)),
    }
}
