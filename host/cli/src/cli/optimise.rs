//! `viewfuse optimise`.

use super::ending::INTERRUPTED;
use super::options::{DeviceOptions, PictureOptions, SourceOptions};
use super::outputs::{is_same, keep_file_apart, keep_others};
use super::printing::{say, warn_of};
use super::terminal::Terminal;
use super::threads::on_threads;
use crate::shared::wrong;
use anyhow::bail;
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;
use viewfuse_device::Memory;
use viewfuse_device::choice::{AnyDevice, Chosen};
use viewfuse_field::gaussians::{MAX_COUNT, MAX_ITERATIONS, Quality, Recipe, RecipeOptions};
use viewfuse_field::optimise::{EndedOptimisation, SceneOptimisation, TOWARDS};
use viewfuse_job::files::{WriteError, check_writable, remove_if_there};
use viewfuse_output::gaussian_page::{check_name, holds_harmonics, is_page, write_optimised};
use viewfuse_scene::Scene;
use viewfuse_scene::gaussians::{GaussianFile, GaussianScene};
use viewfuse_weighting::{WeightingSpec, grammar};

/// Photographs from which on a page is of the standard quality.
const SHARP_SOURCES: usize = 20;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse optimise photos/ -o photos.ply\n  \
    viewfuse optimise dino/ --left-out '#3' -o dino.ply\n      view 3 is kept back, and scored as the Gaussians become \
    better\n  viewfuse optimise dino/ --towards '#3' --left-out '#3' -o dino.ply\n      at last for view 3: its nearest \
    photographs count most\n  viewfuse optimise photos/ --quality standard -o photos.ply\n      sharper, in minutes; \
    --max-time 10m says how many\n  viewfuse optimise photos/ -o photos.html\n      one page for any browser, without \
    a server: to share\n  viewfuse render photos/ --gaussians photos.ply --orbit 24 -o out\n\n\
    Begins with the surfaces that the training-free field finds, and takes some ten seconds; --quality standard takes \
    minutes, and is sharper from a dozen photographs on, or from five that are near to one another. Ctrl-C writes \
    what there is so far, and a .ply is written on the way: --resume goes on from it with the iterations of the finest \
    size. Where photos.ply is there already, both write photos.unfinished.ply until all is done. The file has the \
    layout of \"3D Gaussian Splatting\", which other viewers read, in the coordinates of the scene's files; a .spz has \
    less than a tenth of its bytes, a .splat an eighth.")]
pub(crate) struct Arguments {
    /// The scene
    scene: PathBuf,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", default_value_t = WeightingSpec::default(), help = scheme_help())]
    weights: WeightingSpec,
    /// Views that are kept back, to be rendered and scored on the way
    #[arg(long, value_name = "VIEWS")]
    left_out: Option<String>,
    #[arg(long, value_name = "VIEWS", help = towards_help())]
    towards: Option<String>,
    /// How sharp the Gaussians are to be: fast takes some ten seconds, standard minutes and high five times as long;
    /// these hold some photographs out of a trial first, and take fast where that is better, as they do for fewer than
    /// 12: with more iterations if that helps. Photographs are seen at --size, by fast at 280 pixels at most, by
    /// standard at 800 and by high at 1600 [default: fast, for a page of 20 photographs and more standard]
    #[arg(long, value_name = "fast|standard|high")]
    quality: Option<Quality>,
    /// At most this time for standard or high, with as many iterations as fit into it: seconds, or minutes as 10m
    #[arg(long, value_name = "TIME", value_parser = parse_time)]
    max_time: Option<Duration>,
    #[arg(long, value_name = "N", help = count_help(),
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_COUNT)))]
    count: Option<u32>,
    /// Iterations at each size of the sources, the finest last
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_ITERATIONS)))]
    iterations: Option<u32>,
    /// Go on from the Gaussians of this file, at the finest size
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
    /// Each Gaussian is fainter by as much as a pixel widens it, in the file's pictures too: for sizes other than the
    /// photographs'; .ply and .spz say so
    #[arg(long)]
    antialias: bool,
    /// Seed of the random draws
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    device: DeviceOptions,
    /// The .ply file, a smaller .spz or .splat, or an .html page with the source cameras and their weights
    #[arg(short, long, value_name = "FILE", value_parser = PathBufValueParser::new().try_map(known_file))]
    output: PathBuf,
}

fn scheme_help() -> String {
    format!("Weighting scheme of the surfaces and of --towards: {}", grammar())
}

fn towards_help() -> String {
    format!("{TOWARDS} iterations more with the loss of each source by its weight for these views, which are kept back")
}

fn count_help() -> String {
    let limits = Quality::ALL.map(|quality| {
        let Recipe { max_count, max_per_pixel, .. } = quality.recipe(false);
        format!("{max_per_pixel} a pixel of a source, at most {max_count} with {quality}")
    });
    format!("Most Gaussians [default: {}]", limits.join(", "))
}

/// Seconds, or minutes with an `m`.
fn parse_time(text: &str) -> Result<Duration, String> {
    let (number, unit) =
        text.strip_suffix('m').map_or((text.strip_suffix('s').unwrap_or(text), 1.0), |minutes| (minutes, 60.0));
    let seconds =
        number.trim().parse::<f64>().ok().map(|number| number * unit).filter(|seconds| (1.0..=1.0e6).contains(seconds));
    let seconds = seconds.ok_or_else(|| format!("{text} is no time of at least a second: 90, 90s or 10m"))?;
    Ok(Duration::from_secs_f64(seconds))
}

/// The quality for a file, if none is given.
fn quality_for(output: &Path, source_count: usize) -> Quality {
    if is_page(output) && source_count >= SHARP_SOURCES { Quality::Standard } else { Quality::Fast }
}

/// The file for what is not finished: `photos.unfinished.ply` beside `photos.ply`.
fn beside(output: &Path) -> PathBuf {
    let extension = output.extension().unwrap_or_default().to_string_lossy();
    output.with_extension(format!("unfinished.{extension}"))
}

/// What cannot be written in a file's format is kept in a `.ply` beside it, and the error says where.
fn rescued(written: &Path, scene: &Scene, ended: &EndedOptimisation, error: WriteError) -> anyhow::Error {
    let ply = written.with_extension("ply");
    let place = [beside(&ply), ply].into_iter().rfind(|place| !place.exists());
    match place.filter(|place| ended.gaussians.write(place, &scene.frame).is_ok()) {
        Some(place) => {
            anyhow::Error::from(error).context(format!("the Gaussians are in {} in its place", place.display()))
        }
        None => error.into(),
    }
}

/// A file of a format that is written.
fn known_file(path: PathBuf) -> Result<PathBuf, &'static str> {
    check_name(&path).map(|()| path)
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weighting = arguments.weights.open()?;
    let scene = arguments.picture.masks.open(&arguments.scene)?;
    warn_of(&scene);
    let Arguments { left_out, towards, output, .. } = arguments;
    let selection = arguments.sources.to_selection(None, None);
    let of_scene = SceneOptimisation::new(&scene, &selection, left_out.as_deref(), towards.as_deref())?;
    let options = arguments.picture.to_render_options();
    check_writable(output)?;
    keep_file_apart([&scene], output)?;
    keep_others(output)?;
    GaussianScene::check_place(output, &scene)?;
    let before = arguments.resume.as_ref().map(|path| GaussianFile::open(path, &scene)).transpose()?;
    let quality = arguments.quality.unwrap_or_else(|| quality_for(output, of_scene.sources.len()));
    let Arguments { iterations, count, seed, max_time, .. } = *arguments;
    if max_time.is_some() && quality == Quality::Fast {
        return Err(wrong("--max-time is for --quality standard and high: fast has a few hundred iterations"));
    }
    if let (Some(GaussianFile { scene, .. }), Some(count)) = (&before, count)
        && scene.gaussians.len() > count as usize
    {
        let there = scene.gaussians.len();
        return Err(wrong(format!(
            "--count {count}: the file to go on from has {there} Gaussians, and none are removed"
        )));
    }
    let is_antialiased = arguments.antialias || before.as_ref().is_some_and(|before| before.scene.is_antialiased);
    let is_of_one_colour = !holds_harmonics(output);
    if is_antialiased && is_of_one_colour {
        return Err(wrong("no .html and no .splat says that Gaussians are antialiased; write a .ply or a .spz"));
    }
    let recipe = RecipeOptions { quality, iterations, count, is_of_one_colour, is_antialiased, seed };
    let optimisation = SceneOptimisation { options, weighting, recipe, max_time, before, ..of_scene };
    let Chosen { device, reason } = arguments.device.open()?;
    let progress = Terminal::new("optimising");
    // For --resume, if the program is killed. A file that is there stays as it is until there is a finished one.
    let is_resumable = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"));
    let unfinished = if output.exists() { beside(output) } else { output.clone() };
    let goes_on_from_it = arguments.resume.as_ref().is_some_and(|from| is_same(from, &unfinished));
    if unfinished.exists() && !goes_on_from_it {
        bail!(
            "{}: is of an optimisation that was stopped, and would be replaced; go on from it with --resume, or remove it",
            unfinished.display()
        );
    }
    let mut is_kept = false;
    let keep = |so_far: &GaussianScene| {
        is_kept |= is_resumable;
        if is_resumable { so_far.write(&unfinished, &scene.frame) } else { Ok(()) }
    };
    let ended = on_threads(arguments.picture.threads, || optimisation.run(&device, &progress, keep))??;
    drop(progress);
    let EndedOptimisation { gaussians, done, of, fit, .. } = &ended;
    let written = if done < of { &unfinished } else { output };
    if let Err(error) = write_optimised(written, &scene, &optimisation.sources, &ended) {
        return Err(rescued(written, &scene, &ended, error));
    }
    if written != &unfinished && (is_kept || goes_on_from_it) {
        remove_if_there(&unfinished)?;
    }
    let count = gaussians.gaussians.len();
    let gaussians = if count == 1 { "Gaussian" } else { "Gaussians" };
    say(format_args!("{}: {count} {gaussians} after {done} of {of} iterations", written.display()))?;
    let is_moved = scene.frame.origin.to_array() != [0.0; 3];
    if is_moved && written.extension().is_some_and(|extension| extension == "ply") {
        let [x, y, z] = scene.frame.origin.to_array();
        say(format_args!(
            "positions are about ({x}, {y}, {z}), where the scene is: a comment of the file says so, which other programs \
             do not read"
        ))?;
    }
    if written != output {
        say(format_args!("{}: as it was before", output.display()))?;
    }
    if let Some((psnr, count)) = fit {
        say(format_args!(
            "fit: PSNR {psnr:.2} dB on {count} of the sources themselves, which says nothing of new views: --left-out \
             VIEW keeps one back and scores it"
        ))?;
    }
    let loops = match &device {
        AnyDevice::Vulkan(gpu) if gpu.is_software() => {
            "; a software driver: the steps were made by the CPU's own loops"
        }
        _ => "",
    };
    say(format_args!("device: {}, {reason}{loops}", device.name()))?;
    Ok(if done < of { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}
