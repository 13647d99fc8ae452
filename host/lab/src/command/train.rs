//! `viewfuse-lab train`.

use crate::train::{
    Augmentation, GenvsSettings, Outcome, PixelNerfSettings, Schedule, Task, TrainError, WeightingSettings, side,
    train_genvs, train_pixelnerf, train_weighting,
};
use clap::{Args, Subcommand};
use std::fs::canonicalize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_cli::shared::{Terminal, be_patient, keep_input, on_threads, say, wrong};
use viewfuse_field::pixelnerf;
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::Checkpoint;
use viewfuse_scene::dataset::{Dataset, Split};

/// The file of a run that holds the trained network.
const MODEL: &str = "model.safetensors";

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse-lab scenes make cars learn/ --train 400 --val 12 --views 30 --size 64\n  \
    viewfuse-lab train pixelnerf learn/cars -o runs/pixelnerf --steps 5000\n      a small PixelNeRF: an hour on one \
    core\n  viewfuse-lab train genvs learn/cars -o runs/genvs\n  \
    viewfuse-lab train weighting runs/pixelnerf/model.safetensors learn/cars -o runs/weighting --steps 1000\n      \
    the paper's attention weighting for it\n\n\
    The same command continues an interrupted run, with the same results as an uninterrupted one. With more --steps it \
    goes on behind the end of a shorter run: the rate, which falls until the last step, is from there on that of the \
    longer one.")]
pub(super) struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// A small PixelNeRF, from scratch or from a trained network.
    Pixelnerf(PixelNerfArguments),
    /// A small GeNVS, from scratch or from a trained network: volumes, feature images and the denoiser together.
    Genvs(GenvsArguments),
    /// The weighting of views for a fixed network.
    Weighting(WeightingArguments),
}

/// Options of every run.
#[derive(Args)]
struct RunOptions {
    /// Data: ROOT/cars for ROOT/cars_train and ROOT/cars_val, or a folder that holds such folders
    data: PathBuf,
    /// Folder of the run: its state, the trained model, curves and a record. An existing run is continued, also with
    /// more --steps
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    #[command(flatten)]
    schedule: Schedule,
    /// Work on this many threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

#[derive(Args)]
struct PixelNerfArguments {
    #[command(flatten)]
    run: RunOptions,
    /// Start from the parameters of this network, with new steps, rates and data
    #[arg(long, value_name = "FILE", conflicts_with = "width")]
    from: Option<PathBuf>,
    #[command(flatten)]
    settings: PixelNerfSettings,
    /// Sides of the sources' pictures, multiples of 16 up to --side; each step draws one of the list [default: --side]
    #[arg(long, value_name = "N,N", value_delimiter = ',', value_parser = side())]
    sides: Vec<u32>,
    #[command(flatten)]
    augmentation: Augmentation,
}

#[derive(Args)]
struct GenvsArguments {
    #[command(flatten)]
    run: RunOptions,
    /// Start from the parameters of this network, with new steps, rates and data
    #[arg(long, value_name = "FILE", conflicts_with = "width")]
    from: Option<PathBuf>,
    #[command(flatten)]
    settings: GenvsSettings,
    #[command(flatten)]
    augmentation: Augmentation,
}

#[derive(Args)]
struct WeightingArguments {
    /// The network: a checkpoint that `train pixelnerf` or `train genvs` wrote
    #[arg(value_name = "FILE")]
    model: PathBuf,
    #[command(flatten)]
    run: RunOptions,
    #[command(flatten)]
    settings: WeightingSettings,
}

pub(super) fn run(arguments: Arguments) -> anyhow::Result<ExitCode> {
    match arguments.what {
        What::Pixelnerf(PixelNerfArguments { run, from, mut settings, sides, augmentation }) => {
            settings.augmentation = Augmentation { sides, ..augmentation };
            trained(&run, from.as_deref(), |from, task| train_pixelnerf(settings, from, task))
        }
        What::Genvs(GenvsArguments { run, from, mut settings, augmentation }) => {
            settings.augmentation = augmentation;
            trained(&run, from.as_deref(), |from, task| train_genvs(settings, from, task))
        }
        What::Weighting(WeightingArguments { model, run, settings }) => {
            trained(&run, Some(&model), |network, task| train_weighting(settings, network, task))
        }
    }
}

/// Trains once the folder of the run is known to be one that can be written and is none of the inputs.
fn trained(
    run: &RunOptions,
    network: Option<&Path>,
    train: impl FnOnce(Option<&Checkpoint>, &Task<'_>) -> Result<Outcome, TrainError> + Send,
) -> anyhow::Result<ExitCode> {
    let RunOptions { data, output, schedule, threads } = run;
    check_writable(&output.join(MODEL))?;
    network.map_or(Ok(()), |network| keep_input(network, &output.join(MODEL)))?;
    let sets = [Dataset::open(data, Split::Train)?.scenes, Dataset::open(data, Split::Validation)?.scenes];
    sets.iter().flatten().try_for_each(|scene| keep_input(scene, output))?;
    sets.iter().flatten().try_for_each(|scene| keep_data(scene, output))?;
    let progress = Terminal::new("reading the scenes");
    if sets[0] == sets[1] {
        progress.warn(
            "validation is on the scenes of training, since these are in no folder *_train beside a *_val: \
            its score says nothing about other scenes",
        );
    }
    let network = network.map(Checkpoint::open).transpose()?;
    let assumption = network.as_ref().and_then(pixelnerf::Architecture::assumption);
    assumption.iter().for_each(|assumption| progress.warn(assumption));
    be_patient();
    let task = Task { schedule, scenes: [&sets[0], &sets[1]], folder: output, progress: &progress };
    let outcome = on_threads(*threads, || train(network.as_ref(), &task))??;
    drop(progress);
    if let Some((step, score)) = outcome.scores.last() {
        say(format_args!("{step} steps in {:.0} s, validation {score:.2}", outcome.seconds))?;
    }
    say(format_args!("{}", outcome.model.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// Refuses a folder of the run within a scene's, or that of a split's scenes.
fn keep_data(scene: &Path, output: &Path) -> anyhow::Result<()> {
    let nearest =
        output.ancestors().find_map(|folder| canonicalize(if folder == "" { Path::new(".") } else { folder }).ok());
    let (Ok(scene), Some(nearest)) = (canonicalize(scene), nearest) else { return Ok(()) };
    let is_split = canonicalize(output).is_ok_and(|output| scene.parent() == Some(&output));
    match nearest.starts_with(&scene) || is_split {
        true => {
            let (output, scene) = (output.display(), scene.display());
            Err(wrong(format_args!("--output {output}: the scene {scene} is there; give another folder")))
        }
        false => Ok(()),
    }
}
