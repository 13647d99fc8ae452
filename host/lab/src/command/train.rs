//! `viewfuse-lab train`.

use crate::train::{
    Augmentation, Embedding, GenvsSettings, MAX_LEVEL_SHARE, Outcome, PixelNerfSettings, Schedule, WeightingSettings,
    train_genvs, train_pixelnerf, train_weighting,
};
use clap::{Args, Subcommand, ValueEnum};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_cli::shared::{Terminal, keep_input, on_threads, say};
use viewfuse_core::weighting::Scheme;
use viewfuse_field::genvs::Estimate;
use viewfuse_field::pixelnerf;
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::Checkpoint;
use viewfuse_scene::dataset::{Dataset, Split};
use viewfuse_weighting::{WeightingError, WeightingSpec};

/// The file of a run that holds the trained network.
const MODEL: &str = "model.safetensors";

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse-lab scenes make cars learn/ --train 400 --val 12 --views 30 --size 64\n  \
    viewfuse-lab train pixelnerf learn/cars -o runs/pixelnerf --steps 5000\n      a small PixelNeRF: an hour on one core\n  \
    viewfuse-lab train genvs learn/cars -o runs/genvs\n  \
    viewfuse-lab train weighting runs/pixelnerf/model.safetensors learn/cars -o runs/weighting --steps 1000\n      \
    the paper's attention weighting for it\n\n\
    The same command continues an interrupted run, with the same results as an uninterrupted one. With more --steps it goes on \
    behind the end of a shorter run: the rate, which falls until the last step, is from there on that of the longer one.")]
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
    /// Folder of the run: its state, the trained model, curves and a record. An existing run is continued, also with more
    /// --steps
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Steps of the run
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..))]
    steps: u32,
    /// Learning rate; it rises over the first hundred steps and falls along a cosine
    #[arg(long, value_name = "RATE", default_value_t = 1.0e-3, value_parser = rate)]
    rate: f64,
    /// Seed of every random draw
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Steps from one validation to the next
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..))]
    validate_every: u32,
    /// Seconds between writing the state
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = pause)]
    write_every: f64,
    /// Work on this many threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
}

impl RunOptions {
    fn schedule(&self) -> Schedule {
        let RunOptions { steps, rate, seed, validate_every, write_every, .. } = *self;
        Schedule { steps, rate, seed, validate_every, write_every }
    }
}

#[derive(Args)]
struct PixelNerfArguments {
    #[command(flatten)]
    run: RunOptions,
    /// Start from the parameters of this network, with new steps, rates and data
    #[arg(long, value_name = "FILE", conflicts_with = "width")]
    from: Option<PathBuf>,
    /// Width of the point network
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = count)]
    width: usize,
    /// Levels of the trunk, 1 to 4: with more, a pixel's features depend on more of the photograph. More than those of
    /// the file of --from are added [default: 3, or those of the file]
    #[arg(long, value_name = "N", value_parser = levels)]
    levels: Option<usize>,
    /// Side of the pictures, pixels, a multiple of 16
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = side)]
    side: u32,
    /// Objects of a step
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = count)]
    objects: usize,
    /// Rays of each object
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = count)]
    rays: usize,
    /// Samples of a ray in the first pass
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = samples)]
    coarse: usize,
    /// Samples that the second pass adds
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = added_samples)]
    fine: usize,
    /// Sides of the sources' pictures, multiples of 16 up to --side; each step draws one of the list [default: --side]
    #[arg(long, value_name = "N,N", value_delimiter = ',', value_parser = side)]
    sides: Vec<u32>,
    #[command(flatten)]
    augmentation: AugmentationOptions,
}

/// What differs from step to step.
#[derive(Args)]
struct AugmentationOptions {
    /// Numbers of sources; each step draws one of the list [default: 1,2,3,3,3,3,4,6 for a PixelNeRF, 1,2,3,3 for a
    /// GeNVS]
    #[arg(long, value_name = "N,N", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=256))]
    sources: Vec<u16>,
    /// Let each source show only a square of its photograph, somewhere in it, of at least this share of its side
    #[arg(long, value_name = "SHARE", default_value_t = 1.0, value_parser = crop)]
    least_crop: f32,
    /// The views' weights: a formula, mean, error:alpha=1, ...; of several, each step draws one, and validation has the
    /// first [default: mean]
    #[arg(long, value_name = "SCHEME", value_parser = formula)]
    weights: Vec<Scheme>,
}

impl AugmentationOptions {
    fn augmentation(&self, default: Augmentation) -> Augmentation {
        let AugmentationOptions { sources, least_crop, weights } = self;
        Augmentation {
            sources: if sources.is_empty() {
                default.sources
            } else {
                sources.iter().map(|n| usize::from(*n)).collect()
            },
            least_crop: *least_crop,
            schemes: if weights.is_empty() { default.schemes } else { weights.clone() },
            ..default
        }
    }
}

fn crop(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(share) if share > 0.0 && share <= 1.0 => Ok(share),
        _ => Err("a number above 0, at most 1, is needed".to_owned()),
    }
}

fn formula(text: &str) -> Result<Scheme, String> {
    let spec: WeightingSpec = text.parse().map_err(|error: WeightingError| error.to_string())?;
    spec.formula()
        .ok_or_else(|| "networks are trained with formulas only (`train weighting` trains attention)".to_owned())
}

#[derive(Args)]
struct GenvsArguments {
    #[command(flatten)]
    run: RunOptions,
    /// Start from the parameters of this network, with new steps, rates and data
    #[arg(long, value_name = "FILE", conflicts_with = "width")]
    from: Option<PathBuf>,
    /// Channels of the denoiser's first level, a multiple of 4
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = width)]
    width: usize,
    /// Side of the pictures, pixels, a multiple of 16
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = side)]
    side: u32,
    /// Objects of a step
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count)]
    objects: usize,
    /// Targets of each object; one in steps with weights other than the mean
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = count)]
    targets: usize,
    /// Samples of a ray: as many as in renders
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=4096))]
    samples: u32,
    /// Share of the pictures that have the largest noise level, 0 to 1
    #[arg(long, value_name = "SHARE", default_value_t = MAX_LEVEL_SHARE, value_parser = share)]
    largest_share: f32,
    /// What a new denoiser's estimate is relative to: the colours of the feature image, or nothing, as published
    #[arg(long, value_enum, default_value = "colours")]
    estimate: EstimateName,
    /// With --from: begin with a new denoiser
    #[arg(long, requires = "from")]
    new_denoiser: bool,
    #[command(flatten)]
    augmentation: AugmentationOptions,
}

/// See [`Estimate`].
#[derive(Clone, Copy, ValueEnum)]
enum EstimateName {
    Colours,
    Published,
}

fn share(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("a number from 0 to 1 is needed".to_owned()),
    }
}

fn width(text: &str) -> Result<usize, String> {
    number(text, 4).map(|number| number as usize)
}

fn side(text: &str) -> Result<u32, String> {
    number(text, 16)
}

fn count(text: &str) -> Result<usize, String> {
    number(text, 1).map(|number| number as usize)
}

fn levels(text: &str) -> Result<usize, String> {
    let fits = |levels: &usize| (1..=4).contains(levels);
    count(text).ok().filter(fits).ok_or_else(|| "a whole number from 1 to 4 is needed".to_owned())
}

fn samples(text: &str) -> Result<usize, String> {
    number(text, 1)
        .ok()
        .filter(|number| *number > 1)
        .map(|number| number as usize)
        .ok_or_else(|| "a whole number from 2 to 1024 is needed".to_owned())
}

fn added_samples(text: &str) -> Result<usize, String> {
    if text == "0" { Ok(0) } else { count(text) }
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (0.0..=1.0).contains(&rate) => Ok(rate),
        _ => Err("a number from 0 to 1 is needed".to_owned()),
    }
}

fn pause(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=86_400.0).contains(&seconds) => Ok(seconds),
        _ => Err("a number of seconds from 0 to 86400 is needed".to_owned()),
    }
}

/// A whole number above zero, a multiple of `step`.
fn number(text: &str, step: u32) -> Result<u32, String> {
    match text.parse::<u32>() {
        Ok(number @ 1..=1024) if number % step == 0 => Ok(number),
        _ if step == 1 => Err("a whole number from 1 to 1024 is needed".to_owned()),
        _ => Err(format!("a multiple of {step} from {step} to 1024 is needed")),
    }
}

#[derive(Args)]
struct WeightingArguments {
    /// The network: a checkpoint that `train pixelnerf` or `train genvs` wrote
    #[arg(value_name = "FILE")]
    model: PathBuf,
    #[command(flatten)]
    run: RunOptions,
    /// Embedding of poses
    #[arg(long, value_enum, default_value = "fourier")]
    embedding: EmbeddingName,
    /// Side of the pictures, pixels
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = side)]
    side: u32,
    /// Objects of a step, each with one target
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = count)]
    objects: usize,
    /// Rays of each target; with a GeNVS a target is a whole picture
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = count)]
    rays: usize,
}

/// See [`Embedding`].
#[derive(Clone, Copy, ValueEnum)]
enum EmbeddingName {
    Fourier,
    Flat,
}

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    match &arguments.what {
        What::Pixelnerf(arguments) => pixelnerf(arguments),
        What::Genvs(arguments) => genvs(arguments),
        What::Weighting(arguments) => weighting(arguments),
    }
}

fn pixelnerf(arguments: &PixelNerfArguments) -> anyhow::Result<ExitCode> {
    let &PixelNerfArguments { ref run, ref from, width, levels, side, objects, rays, coarse, fine, .. } = arguments;
    let augmentation = Augmentation {
        sides: arguments.sides.clone(),
        ..arguments.augmentation.augmentation(Augmentation::pixelnerf())
    };
    let settings = PixelNerfSettings { width, levels, side, objects, rays, coarse, fine, augmentation };
    let [train, validation] = scenes(run, from.as_deref())?;
    let progress = Terminal::new("reading the scenes");
    let from = from.as_deref().map(|path| network(path, &progress)).transpose()?;
    let train_it =
        || train_pixelnerf(&settings, from.as_ref(), &run.schedule(), [&train, &validation], &run.output, &progress);
    let outcome = on_threads(run.threads, train_it)??;
    drop(progress);
    report(&outcome)
}

fn genvs(arguments: &GenvsArguments) -> anyhow::Result<ExitCode> {
    let &GenvsArguments { ref run, ref from, width, side, objects, targets, samples, .. } = arguments;
    let &GenvsArguments { largest_share: share_of_largest, estimate, new_denoiser, .. } = arguments;
    let estimate = match estimate {
        EstimateName::Colours => Estimate::FromColours,
        EstimateName::Published => Estimate::Published,
    };
    let augmentation = arguments.augmentation.augmentation(Augmentation::genvs());
    let settings = GenvsSettings {
        width,
        side,
        objects,
        targets,
        samples,
        share_of_largest,
        estimate,
        new_denoiser,
        augmentation,
    };
    let [train, validation] = scenes(run, from.as_deref())?;
    let progress = Terminal::new("reading the scenes");
    let from = from.as_deref().map(|path| network(path, &progress)).transpose()?;
    let train_it =
        || train_genvs(&settings, from.as_ref(), &run.schedule(), [&train, &validation], &run.output, &progress);
    let outcome = on_threads(run.threads, train_it)??;
    drop(progress);
    report(&outcome)
}

fn weighting(arguments: &WeightingArguments) -> anyhow::Result<ExitCode> {
    let WeightingArguments { model, run, embedding, side, objects, rays } = arguments;
    let embedding = match embedding {
        EmbeddingName::Fourier => Embedding::Fourier,
        EmbeddingName::Flat => Embedding::Flat,
    };
    let settings = WeightingSettings { embedding, side: *side, objects: *objects, rays: *rays };
    let [train, validation] = scenes(run, Some(model))?;
    let progress = Terminal::new("reading the scenes");
    let checkpoint = network(model, &progress)?;
    let (schedule, scenes) = (run.schedule(), [&train[..], &validation[..]]);
    let train_it = || train_weighting(&settings, &checkpoint, &schedule, scenes, &run.output, &progress);
    let outcome = on_threads(run.threads, train_it)??;
    drop(progress);
    report(&outcome)
}

/// Opens a network, and says what is assumed of it.
fn network(path: &Path, progress: &Terminal) -> anyhow::Result<Checkpoint> {
    let checkpoint = Checkpoint::open(path)?;
    pixelnerf::Architecture::assumption(&checkpoint).iter().for_each(|assumption| progress.warn(assumption));
    Ok(checkpoint)
}

/// Training and validation scenes, once the folder of the run is known to be one that can be written and is none of the
/// inputs.
fn scenes(run: &RunOptions, network: Option<&Path>) -> anyhow::Result<[Vec<PathBuf>; 2]> {
    let RunOptions { data, output, .. } = run;
    check_writable(&output.join(MODEL))?;
    network.map_or(Ok(()), |network| keep_input(network, &output.join(MODEL)))?;
    let sets = [Dataset::open(data, Split::Train)?.scenes, Dataset::open(data, Split::Validation)?.scenes];
    sets.iter().flatten().try_for_each(|scene| keep_input(scene, output))?;
    Ok(sets)
}

fn report(outcome: &Outcome) -> anyhow::Result<ExitCode> {
    if let Some((step, score)) = outcome.scores.last() {
        say(format_args!("{step} steps in {:.0} s, validation {score:.2}", outcome.seconds))?;
    }
    say(format_args!("{}", outcome.model.display()))?;
    Ok(ExitCode::SUCCESS)
}
