//! The command line: what each command takes. What each does is in its own file.

#[cfg(feature = "check")]
mod bench;
#[cfg(feature = "check")]
mod check;
mod compare;
#[cfg(feature = "completions")]
mod completions;
mod convert;
mod devices;
mod ending;
mod environment;
mod evaluate;
mod export;
mod help;
mod hints;
mod inspect;
mod left_out;
mod metrics_options;
mod model;
mod optimise;
mod options;
mod outputs;
#[cfg(feature = "pareto")]
mod pareto;
mod parse;
mod path;
mod points;
#[cfg(feature = "pose")]
mod pose;
mod posed;
mod printing;
mod render;
#[cfg(feature = "report")]
mod report;
#[cfg(feature = "scenes")]
mod scenes;
mod select;
mod shown;
mod table;
mod terminal;
#[cfg(feature = "train")]
mod train;
#[cfg(feature = "check")]
mod verify;
#[cfg(feature = "view")]
mod view;
mod weighting;
mod weights;

#[cfg(not(feature = "completions"))]
use left_out::completions;
#[cfg(not(feature = "pareto"))]
use left_out::pareto;
#[cfg(not(feature = "pose"))]
use left_out::pose;
#[cfg(not(feature = "report"))]
use left_out::report;
#[cfg(not(feature = "scenes"))]
use left_out::scenes;
#[cfg(not(feature = "train"))]
use left_out::train;
#[cfg(not(feature = "view"))]
use left_out::view;
#[cfg(not(feature = "check"))]
use left_out::{bench, check, verify};

use clap::error::ErrorKind;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::env::args_os;
use std::fmt::Display;
use std::process::ExitCode;

#[derive(Parser)]
#[command(
    name = "viewfuse",
    version,
    about = "Renders novel views of an object from a few posed photographs.",
    long_about = long_about(),
    after_help = "Exit code: 0 done, 1 the job failed, 2 wrong arguments, 130 interrupted.",
    max_term_width = 110
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Find the camera poses of bare photographs, and write them as a scene.
    Pose(pose::Arguments),
    /// Render novel views: pictures, depth maps, contact sheets and a run record.
    Render(render::Arguments),
    /// Look around in a scene, in the browser: drag the camera and see the picture and the weights change.
    View(view::Arguments),
    /// Show the weight of each source view for a target view under every scheme.
    Weights(weights::Arguments),
    /// Select the few sources that targets need, for systems that take a list of views.
    Select(select::Arguments),
    /// Write the surfaces that the sources show as a coloured point cloud (PLY).
    Points(points::Arguments),
    /// Optimise a scene of Gaussians from the sources, for pictures at once and for other viewers (PLY).
    Optimise(optimise::Arguments),
    /// Show a scene: its cameras from above, the point that they look at, and warnings.
    Inspect(inspect::Arguments),
    /// Compare weighting schemes on held-out views.
    Evaluate(evaluate::Arguments),
    /// Measure error against run time for all omissions, on each device.
    Pareto(pareto::Arguments),
    /// Score pictures against their ground truth.
    Compare(compare::Arguments),
    /// Train a network, or the weighting of views for a network, on scenes.
    Train(train::Arguments),
    /// Generate scenes for training.
    Scenes(scenes::Arguments),
    /// Write an HTML page with evaluations, run times and trainings.
    Report(report::Arguments),
    /// Write a checkpoint as safetensors.
    Convert(convert::Arguments),
    /// Write a scene in another layout.
    Export(export::Arguments),
    /// Print what a shell needs to complete commands and options, or write manual pages.
    Completions(completions::Arguments),
    /// List the devices, and the missing requirements of those that cannot be used.
    Devices(devices::Arguments),
    /// Compare this build with files of reference values.
    Verify(verify::Arguments),
    /// Compare every kernel on each device with an evaluation in double precision.
    Check(check::Arguments),
    /// Measure the rates of kernels beside what each device can do at most.
    Bench(bench::Arguments),
}

pub(crate) use ending::INTERRUPTED;
pub(crate) use hints::{hint, is_of_arguments};
use printing::say;
pub(crate) use printing::{complain, complain_of_arguments};

fn long_about() -> String {
    format!(
        "Few-shot novel view synthesis. Every source view is weighted by how relevant its camera is to the target \
         (\"Pay Attention to Where You Looked\"), and the weighted views are fused into a picture.\n\n\
         A scene is one of: {}.",
        viewfuse_scene::looked_for(&viewfuse_scene::READERS)
    )
}

/// Runs the command that the process was started with.
pub(crate) fn run() -> anyhow::Result<ExitCode> {
    let mut command = help::shortened(left_out::marked(Arguments::command()));
    let matches = match command.try_get_matches_from_mut(args_os()) {
        Ok(matches) => matches,
        Err(error) => help::explained(error, args_os(), &mut command).exit(),
    };
    let arguments = Arguments::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
    terminal::silence_caught_panics();
    terminal::listen()?;
    match arguments.command {
        Command::Pose(arguments) => pose::run(&arguments),
        Command::Render(arguments) => render::run(&arguments, &options::values(&command, &matches)),
        #[cfg(feature = "view")]
        Command::View(arguments) => view::run(&arguments, &options::given(&command, &matches)),
        #[cfg(not(feature = "view"))]
        Command::View(arguments) => view::run(&arguments),
        Command::Weights(arguments) => weights::run(&arguments),
        Command::Select(arguments) => select::run(&arguments),
        Command::Optimise(arguments) => optimise::run(&arguments),
        Command::Points(arguments) => points::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments, options::values(&command, &matches)),
        Command::Pareto(arguments) => pareto::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Train(arguments) => train::run(&arguments),
        Command::Scenes(arguments) => scenes::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        #[cfg(feature = "completions")]
        Command::Completions(arguments) => completions::run(&arguments, command),
        #[cfg(not(feature = "completions"))]
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Devices(arguments) => devices::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
    }
}

/// The error of arguments that do not fit the content of a file; the exit code is that of wrong arguments.
fn wrong(message: impl Display) -> anyhow::Error {
    clap::Error::raw(ErrorKind::ArgumentConflict, format_args!("{message}\n\nFor more information, try '--help'.\n"))
        .into()
}

/// Runs `work` on this many threads instead of all cores.
fn on_threads<T: Send>(threads: Option<u16>, work: impl FnOnce() -> T + Send) -> anyhow::Result<T> {
    match threads {
        None => Ok(work()),
        Some(count) => Ok(rayon::ThreadPoolBuilder::new().num_threads(count.into()).build()?.install(work)),
    }
}
