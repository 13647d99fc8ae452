//! The command line: what each command takes. What each does is in its own file; a module uses only those above it.
//!
//! ```text
//! shown            text as a terminal may get it
//! verdict          what a score looks like, in words
//! printing         results and errors
//! wrong            the error of arguments, and what a build lacks
//! hints            what helps on from an error of a library
//! threads          `--threads`
//! environment      the environment's variables
//! parse            values of options
//! table            tables
//! ending           the end of a process that was told to end
//! terminal         progress and warnings
//! outputs          outputs that would replace inputs, of all commands
//! options, path, weighting, model, metrics_options
//!                  options that several commands share
//! pose, posed      poses of photographs that have none, by themselves or on the way
//! *                the other commands, a file each
//! help             the help, and what is said of wrong arguments
//! ```

mod bench;
mod check;
mod compare;
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
mod metrics_options;
mod model;
mod optimise;
mod options;
mod outputs;
mod pareto;
mod parse;
mod path;
mod points;
mod pose;
mod posed;
mod printing;
mod render;
mod select;
mod shown;
mod table;
mod terminal;
mod threads;
mod verdict;
mod verify;
mod view;
mod weighting;
mod weights;
mod wrong;

use anyhow::Context;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::env::args_os;
use std::process::ExitCode;

#[derive(Parser)]
#[command(
    name = "viewfuse",
    version,
    about = "Renders novel views of a scene from a few photographs.",
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
pub use ending::be_patient;
pub(crate) use hints::{hint, is_of_arguments};
pub use outputs::{keep_input, keep_others, refuse_extension};
pub use parse::parse_size;
pub use printing::say;
pub(crate) use printing::{complain, complain_of_arguments};
pub use terminal::Terminal;
pub use threads::on_threads;
pub use wrong::wrong;

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
    let mut command = help::shortened(Arguments::command());
    let matches = match command.try_get_matches_from_mut(args_os()) {
        Ok(matches) => matches,
        Err(error) => {
            let error = help::explained(error, args_os(), &mut command);
            // In colours if nothing on the command line, which may be made of files' names, controls the terminal.
            if !printing::is_harmless(&error) {
                return Err(error.into());
            }
            error.exit()
        }
    };
    let arguments = Arguments::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
    outputs::keep_inputs(&command, &matches)?;
    listen()?;
    match arguments.command {
        Command::Pose(arguments) => pose::run(&arguments),
        Command::Render(arguments) => render::run(&arguments, &options::values(&command, &matches)),
        Command::View(arguments) => view::run(&arguments, &options::given(&command, &matches)),
        Command::Weights(arguments) => weights::run(&arguments),
        Command::Select(arguments) => select::run(&arguments),
        Command::Optimise(arguments) => optimise::run(&arguments),
        Command::Points(arguments) => points::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments, options::values(&command, &matches)),
        Command::Pareto(arguments) => pareto::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments, command),
        Command::Devices(arguments) => devices::run(&arguments),
        Command::Verify(arguments) => verify::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
    }
}

/// Makes Ctrl-C set a flag that the work looks at and the limit of files' sizes an error, keeps panics silent that become
/// errors, and starts the threads.
///
/// # Errors
/// If another handler is already installed, or the system allows no more threads.
pub fn listen() -> anyhow::Result<()> {
    viewfuse_job::panics::silence_caught();
    terminal::survive_full_files();
    terminal::listen().context("Ctrl-C cannot be listened to")?;
    threads::start_threads()
}
