//! `viewfuse render`.

mod identity;
mod outputs;
mod stream;

use super::model::{Flags, ModelOptions, SEQUENCE};
use super::options::{BoundOptions, DeviceOptions, PictureOptions, SourceOptions};
use super::outputs::keep_folder_apart;
use super::path::PathOptions;
use super::posed::PoseOption;
use super::terminal::Terminal;
use super::weighting::choice_help;
use super::{complain, on_threads, say};
use clap::Args;
use identity::run_identity;
use outputs::OutputOptions;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;
use viewfuse_device::choice::Chosen;
use viewfuse_field::AnyField;
use viewfuse_field::auto::{self, Candidate, Expected, PixelErrors};
use viewfuse_field::budget::{Estimate, Kept};
use viewfuse_field::gaussians::GivenGaussians;
use viewfuse_field::render::{Frame, Seen, render};
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::{Part, Progress};
use viewfuse_output::folder::check_folder;
use viewfuse_output::rate::FrameRate;
use viewfuse_output::record::{ChosenRecord, FrameRecord, RunRecord};
use viewfuse_output::run::{Circumstances, RECORD, RunWriter};
use viewfuse_output::video::VideoFormat;
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::few_shot::{FewShot, Target};
use viewfuse_scene::gaussians::GaussianScene;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_scene::{READERS, Scene, looked_for};
use viewfuse_weighting::{Weighting, WeightingChoice};

/// From which share on a picture that few photographs show is said to be one.
const MIN_FEW: f32 = 0.2;
/// Share of pixels that are expected to be poor from which on a person is told.
const MIN_POOR: f32 = 0.1;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    viewfuse render photos/ --orbit 24 -o out\n      24 views around what the cameras look at, from photograph to photograph\n  \
    viewfuse render dino/ --targets 1,4,7 --size 160x120 -o out\n      views 1, 4 and 7 from the other thirteen, with scores\n  \
    viewfuse render car/ --targets 5 --sources all/3 --weights mean -o out\n      view 5 from every third view, averaged instead of weighted\n  \
    viewfuse render photos/ --between 3 7 --frames 120 --video webp,mp4 -o out\n      the way from view 3 to view 7 as a video\n  \
    viewfuse render photos/ --camera-path camera_path.json -o - | ffplay -\n      a path from nerfstudio's viewer, played as it comes\n  \
    viewfuse render photos/ --gaussians photos.ply --orbit 24 -o out\n      the Gaussians that `optimise` wrote\n\n\
    Writes NAME.png, NAME_depth.png (16 bit; scale in run.json; none with a GeNVS), NAME_confidence.png (8 bit; where the field \
    tells), NAME_sheet.png for each target, and run.json. A run that was interrupted continues where it was when it is started \
    again. With `-o -` the pictures go to standard output as y4m, and nothing is written.")]
pub(crate) struct Arguments {
    #[arg(help = scene_help())]
    scene: PathBuf,
    #[command(flatten)]
    pose: PoseOption,
    /// Views to render, as for --sources; left out of the sources [default: the scene's target poses]
    #[arg(long, value_name = "VIEWS")]
    targets: Option<String>,
    #[command(flatten)]
    path: PathOptions,
    #[command(flatten)]
    sources: SourceOptions,
    #[arg(long, value_name = "SCHEME", help = choice_help())]
    weights: Option<WeightingChoice>,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    bound: BoundOptions,
    #[command(flatten)]
    model: ModelOptions,
    #[command(flatten)]
    sequence: Flags<SEQUENCE>,
    /// Render the Gaussians of this file, of `optimise` or of another program, in the coordinates of the scene's files
    #[arg(long, value_name = "FILE", conflicts_with = "model")]
    gaussians: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceOptions,
    /// Seed of every random draw (the training-free field makes none)
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    outputs: OutputOptions,
    /// Folder for the results, made if missing; `-` for y4m on standard output
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

fn scene_help() -> String {
    format!("The scene: {}", looked_for(&READERS))
}

impl Arguments {
    /// The weighting; `None` where the scene is to decide.
    fn weighting(&self) -> anyhow::Result<Option<Weighting>> {
        Ok(match &self.weights {
            Some(WeightingChoice::Given(spec)) => Some(spec.open()?),
            // A network's pictures take too long to try out schemes unasked; Gaussians show the same under all of them.
            None if self.model.label().is_some() || self.gaussians.is_some() => Some(Weighting::default_scheme()),
            Some(WeightingChoice::Auto) | None => None,
        })
    }

    /// The field that renders the scene.
    fn field(&self, scene: &Scene) -> anyhow::Result<AnyField> {
        match &self.gaussians {
            Some(path) => Ok(AnyField::new(GivenGaussians { scene: GaussianScene::read(path, &scene.frame)? })),
            None => self.model.open(self.seed, Some(&self.sequence)),
        }
    }

    /// The files of the field.
    fn files(&self) -> impl Iterator<Item = &Path> {
        self.model.file().into_iter().chain(self.gaussians.as_deref())
    }
}

/// `values` are all options and their values as a person would write them.
pub(crate) fn run(arguments: &Arguments, values: &BTreeMap<String, String>) -> anyhow::Result<ExitCode> {
    let start = Instant::now();
    let weighting = arguments.weighting()?;
    let (folder, scene) = arguments.pose.open(&arguments.scene)?;
    let is_stream = arguments.output == Path::new("-");
    if !is_stream {
        keep_folder_apart([&scene], &arguments.output)?;
    }
    let open_time = start.elapsed();
    let field = arguments.field(&scene)?;
    let about = field.about();
    let selection = arguments.sources.to_selection(arguments.targets.as_deref(), arguments.path.choice());
    let job = selection.resolve(&scene, about.least_sources)?;
    let options = arguments.bound.bounded(arguments.picture.to_render_options(arguments.model.exact, &about)?);
    let rate = arguments.outputs.rate(job.frames_per_second);
    if !is_stream {
        check_writable(&arguments.output.join(RECORD))?;
        check_folder(&arguments.output, &job.targets, arguments.outputs.replace)?;
    }
    let Chosen { device, reason } = arguments.device.open()?;
    let renderer = field.on(&device);
    let renderer = renderer.as_ref();
    let progress = Terminal::new("rendering");
    let leaving = leaving(arguments, &scene, &job, &progress);
    let formats = if is_stream { Vec::new() } else { progress.aside(|| video_formats(arguments)) };
    if is_stream {
        let render = || stream::render_to_stdout(&scene, &job, weighting.as_ref(), renderer, &options, rate, &progress);
        on_threads(arguments.picture.threads, render)??;
        return Ok(ExitCode::SUCCESS);
    }
    let before = weighting.clone().unwrap_or_else(Weighting::default_scheme);
    let mut writer = RunWriter::new(&arguments.output, &scene, folder.display().to_string(), &job, &before);
    writer.lock()?;
    writer.set_outputs(arguments.outputs.outputs());
    leaving.into_iter().for_each(|warning| writer.warn(warning));
    let files: Vec<&Path> = arguments.files().chain(before.file()).collect();
    // Frames that follow from one another are not continued.
    let job = if arguments.sequence.is_empty() {
        let run = run_identity(values, &device.name(), &scene, &job, &files)?;
        let finished = writer.resume(&run)?;
        let is_left = |target: &Target| !finished.contains(&target.name);
        FewShot { targets: job.targets.into_iter().filter(is_left).collect(), ..job }
    } else {
        job
    };
    // A frame of a video takes a part of the time that it took to render.
    let frames = 10 * job.targets.len().max(1);
    let of = frames + job.targets.len() * formats.len();
    let part = Part::begin(&progress, "", 0..frames, of);
    let (record, videos) = on_threads(arguments.picture.threads, || -> anyhow::Result<(RunRecord, Vec<String>)> {
        let finished = match &weighting {
            Some(weighting) => {
                let write = |sources: &SourceImages, frame: Frame| anyhow::Ok(writer.write(sources, &frame)?);
                render(&scene, &job, weighting, renderer, &options, &part, write)?
            }
            None => {
                let write = |sources: &SourceImages, frame: Frame, chosen: &auto::Chosen| {
                    writer.set_chosen(chosen);
                    anyhow::Ok(writer.write(sources, &frame)?)
                };
                auto::render(&scene, &job, renderer, &options, &part, write)?.0
            }
        };
        let videos = videos(&writer, &formats, rate, &Part::begin(&progress, "", frames..of, of))?;
        let circumstances = Circumstances {
            program: env!("CARGO_PKG_VERSION"),
            device_reason: reason,
            model: arguments.model.label(),
            exact: arguments.model.exact,
            seed: arguments.seed,
            open_time,
            total_time: start.elapsed(),
        };
        Ok((writer.finish(renderer, &options, finished, circumstances)?, videos))
    })??;
    drop(progress);
    print(&record, &arguments.output)?;
    videos.iter().try_for_each(say)?;
    Ok(ExitCode::SUCCESS)
}

/// Says where an orbit ends, and warns if cameras without a photograph leave what the sources show. Not with a network, which is
/// there to guess what they do not.
fn leaving(arguments: &Arguments, scene: &Scene, job: &FewShot, progress: &Terminal) -> Option<String> {
    let cameras = job.source_cameras(scene);
    progress.aside(|| arguments.path.tell_arc(&cameras));
    let new = job.targets.iter().filter(|target| target.truth.is_none());
    let pictures = new.map(|target| (target.name.as_str(), &target.camera));
    let is_learned = arguments.model.label().is_some();
    let warning = if is_learned { None } else { Coverage::of(&cameras).warning(pictures) };
    warning.iter().for_each(|warning| progress.warn(warning));
    warning
}

/// The formats of videos, y4m in place of MP4 where there is no ffmpeg: a person learns it before the work.
fn video_formats(arguments: &Arguments) -> Vec<VideoFormat> {
    let mut formats = Vec::new();
    for format in &arguments.outputs.video {
        let format = if format.is_possible() {
            *format
        } else {
            let path = arguments.output.join("video.y4m");
            complain(format_args!("{}, not mp4, is written: there is no ffmpeg on the path", path.display()));
            VideoFormat::Y4m
        };
        if !formats.contains(&format) {
            formats.push(format);
        }
    }
    formats
}

/// Writes the pictures as videos; returns a line about each.
fn videos(
    writer: &RunWriter,
    formats: &[VideoFormat],
    rate: FrameRate,
    progress: &dyn Progress,
) -> anyhow::Result<Vec<String>> {
    let mut lines = Vec::new();
    for (index, format) in formats.iter().enumerate() {
        progress.stage(&format!("writing video.{format}"), index..index + 1, formats.len());
        lines.push(writer.write_video(*format, rate, progress)?.display().to_string());
    }
    Ok(lines)
}

/// Prints the summary of a run.
fn print(record: &RunRecord, folder: &Path) -> std::io::Result<()> {
    for frame in &record.frames {
        say(format_args!("{}", summary(frame, &record.sources, folder)))?;
    }
    say(format_args!(
        "{} from {} sources, {}, {} on {}: {:.2} s",
        if record.frames.len() == 1 { "1 view".to_owned() } else { format!("{} views", record.frames.len()) },
        record.sources.len(),
        record.weighting,
        record.field,
        record.device,
        record.times.total
    ))?;
    if record.continued > 0 {
        say(format_args!("continued: {} of them were there", record.continued))?;
    }
    if let Some(chosen) = &record.chosen {
        say(format_args!("{}", choice(chosen, &record.weighting)))?;
    }
    if let Some(largest) = record.kernels.iter().max_by(|a, b| a.share.total_cmp(&b.share)) {
        let seconds: f64 = record.kernels.iter().map(|kernel| kernel.seconds).sum();
        let (name, share) = (largest.kernel, 100.0 * largest.share);
        say(format_args!("kernels took {seconds:.2} s, {share:.0} % of it {name}; all in {RECORD}"))?;
    }
    say(format_args!("device: {}, {}", record.device, record.device_reason))
}

/// What was chosen for the scene, and what it gained.
fn choice(chosen: &ChosenRecord, weighting: &str) -> String {
    let ChosenRecord { settings, mixture, candidates, left_out, .. } = chosen;
    if left_out.is_empty() {
        return format!("chosen: {weighting}, the default: too few sources to leave one out");
    }
    let of = |candidate: &Candidate| candidate.weighting == weighting && candidate.settings == *settings;
    // A mixture is tried last.
    let own = match mixture {
        Some(_) => candidates.last(),
        None => candidates.iter().find(|candidate| of(candidate)),
    };
    let own = own.and_then(|candidate| candidate.psnr).unwrap_or(0.0);
    let gain = own - candidates.first().and_then(|first| first.psnr).unwrap_or(own);
    let with = match mixture {
        Some(mixture) => format!(", {} pictures under different settings mixed by region", mixture.parts.len()),
        None if settings.is_empty() => String::new(),
        None => " with settings for these photographs".to_owned(),
    };
    let more = if gain > 0.0 { format!(", {gain:.2} dB more than by default") } else { String::new() };
    let count = left_out.len();
    format!(
        "chosen: {weighting}{with}: {count} photographs that were left out have {own:.1} dB{more} (what was tried: {RECORD})"
    )
}

fn summary(frame: &FrameRecord, sources: &[String], folder: &Path) -> String {
    let score = match (frame.psnr, frame.ssim) {
        (Some(psnr), Some(ssim)) => format!("  PSNR {psnr:.2} dB  SSIM {ssim:.3}"),
        (Some(psnr), None) => format!("  PSNR {psnr:.2} dB"),
        _ => String::new(),
    };
    let expected = frame.expected.map_or_else(String::new, |Expected { psnr, interval: [low, high], pixels }| {
        let poor =
            pixels.filter(|pixels| pixels.poor >= MIN_POOR).map_or_else(String::new, |PixelErrors { poor, .. }| {
                format!(", {:.0} % of it off by more than a tenth of the range", 100.0 * poor)
            });
        format!("  expected PSNR {psnr:.1} dB (80 %: {low:.1} to {high:.1}){poor}")
    });
    let left_out = match frame.left_out.len() {
        0 => String::new(),
        1 => format!("  1 source left out (weight {:.4})", frame.left_out_weight),
        count => format!("  {count} sources left out (weight {:.4})", frame.left_out_weight),
    };
    let kept = frame.kept.as_ref().map_or_else(String::new, kept);
    let few = few_photographs(frame, sources).unwrap_or_default();
    format!("{}{score}{expected}{few}{left_out}{kept}", folder.join(format!("{}.png", frame.target)).display())
}

/// What a picture lacks, and where to photograph: between the two sources that matter most to it.
fn few_photographs(frame: &FrameRecord, sources: &[String]) -> Option<String> {
    let Seen { by_none, by_one } = frame.seen_by.filter(|seen| seen.by_none + seen.by_one >= MIN_FEW)?;
    let mut order: Vec<usize> = (0..sources.len().min(frame.weights.len())).collect();
    order.sort_by(|a, b| frame.weights[*b].total_cmp(&frame.weights[*a]));
    let [first, second, ..] = order[..] else { return None };
    Some(format!(
        "  {:.0} % of it seen by fewer than two photographs, {:.0} % by none: photograph from between {} and {}",
        100.0 * (by_none + by_one),
        100.0 * by_none,
        sources[first],
        sources[second]
    ))
}

/// How a frame keeps its bound.
fn kept(kept: &Kept) -> String {
    let decibels = |error: f64| -20.0 * error.max(1.0e-6).log10();
    let error = match kept.error {
        Some(Estimate { value: 0.0, .. }) | None => String::new(),
        Some(Estimate { value, upper, .. }) => {
            format!(", about {:.1} dB from exact (at least {:.1})", decibels(value), decibels(upper))
        }
    };
    let missed = match (kept.is_kept, kept.most_seconds) {
        (false, Some(most)) => format!("; MORE than the {most} s that were asked for"),
        (false, None) => "; MORE error than was asked for".to_owned(),
        (true, _) => String::new(),
    };
    format!("  {}{error}, {:.2} s{missed}", kept.effort, kept.seconds)
}
