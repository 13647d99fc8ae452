//! `viewfuse optimise`.

use super::ending::INTERRUPTED;
use super::options::{DeviceOptions, PictureOptions, SourceOptions};
use super::outputs::keep_file_apart;
use super::printing::{say, warn_of};
use super::terminal::Terminal;
use super::threads::on_threads;
use anyhow::bail;
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::gaussian::GaussianBlock;
use viewfuse_device::choice::{AnyDevice, Chosen};
use viewfuse_device::cpu::Cpu;
use viewfuse_device::{Device, Memory};
use viewfuse_field::AnyField;
use viewfuse_field::gaussians::{GivenGaussians, MAX_COUNT, MAX_ITERATIONS, Optimiser, Recipe, behind, scene_of};
use viewfuse_field::point_cloud::point_cloud;
use viewfuse_field::render::{RenderOptions, Stage, open_album};
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_output::gaussian_page::{GaussianPage, write_html};
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{Selection, Target, target_of};
use viewfuse_scene::gaussians::{GaussianFile, GaussianScene};
use viewfuse_scene::photographs::Album;
use viewfuse_scene::unit::RigUnit;
use viewfuse_weighting::sources::SourcePoses;
use viewfuse_weighting::{Weighting, WeightingSpec, grammar};

/// Iterations between two scores, and between two files on the way.
const SCORED: u32 = 40;
/// Sources that are scored where no view is kept back.
const FIT_SOURCES: usize = 3;
/// Iterations with the weights of `--towards`.
const TOWARDS: u32 = 60;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse optimise photos/ -o photos.ply\n  \
    viewfuse optimise dino/ --left-out 3 -o dino.ply\n      view 3 is kept back, and scored as the Gaussians become better\n  \
    viewfuse optimise dino/ --towards 3 --left-out 3 -o dino.ply\n      at last for view 3: its nearest photographs count most\n  \
    viewfuse optimise photos/ -o photos.html\n      one page for any browser, without a server: to share\n  \
    viewfuse render photos/ --gaussians photos.ply --orbit 24 -o out\n\n\
    Begins with the surfaces that the training-free field finds, and takes a few seconds. Ctrl-C writes what there is so far, \
    and a .ply is written every 40 iterations: --resume goes on from it with the iterations of the finest size. The file has the layout of \"3D Gaussian Splatting\", which other viewers read, in the \
    coordinates of the scene's files; a .spz has less than a tenth of its bytes, a .splat an eighth.")]
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
    #[arg(long, value_name = "N", help = count_help(), value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_COUNT)))]
    count: Option<u32>,
    /// Iterations at each size of the sources, the finest last
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_ITERATIONS)))]
    iterations: Option<u32>,
    /// Go on from the Gaussians of this file, at the finest size
    #[arg(long, value_name = "FILE")]
    resume: Option<PathBuf>,
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
    let Recipe { max_count, max_per_pixel, .. } = Recipe::default();
    format!("Most Gaussians [default: {max_per_pixel} a pixel of a source, at most {max_count}]")
}

/// A file of a format that is written.
fn known_file(path: PathBuf) -> Result<PathBuf, &'static str> {
    match ["ply", "splat", "spz", "html"].iter().any(|own| is_of(&path, own)) {
        true => Ok(path),
        false => Err("scenes of Gaussians are written as .ply or .html, and smaller as .splat or .spz"),
    }
}

fn is_of(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|own| own.eq_ignore_ascii_case(extension))
}

/// What an optimisation ends with.
struct Ended {
    gaussians: Vec<GaussianBlock>,
    /// What lies behind them.
    background: [f32; 3],
    done: u32,
    of: u32,
    /// Mean PSNR of the first sources, and how many they are, where no view is kept back.
    fit: Option<(f64, usize)>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weighting = arguments.weights.open()?;
    let scene = arguments.picture.masks.open(&arguments.scene)?;
    warn_of(&scene);
    let field = AnyField::default();
    let about = field.about();
    let views = |list: &Option<String>| -> anyhow::Result<Vec<Target>> {
        if list.is_none() {
            return Ok(Vec::new());
        }
        let selection = Selection { targets: list.clone(), ..Selection::default() };
        Ok(selection.resolve(&scene, about.least_sources)?.targets)
    };
    let (left_out, towards) = (views(&arguments.left_out)?, views(&arguments.towards)?);
    let photographs = |targets: &[Target]| targets.iter().filter_map(|own| own.truth).collect::<Vec<usize>>();
    let targets = photographs(&left_out);
    let kept_back = [targets.clone(), photographs(&towards)].concat();
    let selection = arguments.sources.to_selection(None, None);
    let sources = selection.sources_without(&scene, &kept_back, about.least_sources)?;
    let options = arguments.picture.to_render_options(false, &about)?;
    check_writable(&arguments.output)?;
    keep_file_apart([&scene], &arguments.output)?;
    GaussianScene::check_place(&arguments.output, &scene.frame)?;
    let before = arguments.resume.as_ref().map(|path| GaussianFile::open(path, &scene)).transpose()?;
    let Chosen { device, reason } = arguments.device.open()?;
    let progress = Terminal::new("optimising");
    let sources_of_job = sources.clone();
    let job = Job { arguments, scene: &scene, sources: sources_of_job, targets, towards, options, weighting, before };
    let ended = on_threads(arguments.picture.threads, || match &device {
        AnyDevice::Cpu(own) => job.optimise(own, &device, &field, &progress),
        // A software driver takes longer than the CPU's own loops for the same steps; see `gaussians::optimised`.
        AnyDevice::Vulkan(own) if own.is_software() => job.optimise(&Cpu, &device, &field, &progress),
        AnyDevice::Vulkan(own) => job.optimise(own.as_ref(), &device, &field, &progress),
    })??;
    drop(progress);
    let Ended { gaussians, background, done, of, fit } = &ended;
    match is_of(&arguments.output, "html") {
        true => {
            let cameras: Vec<(String, Camera)> =
                sources.iter().map(|view| &scene.views[*view]).map(|own| (own.name.clone(), own.camera)).collect();
            let (title, optimised) = (scene.name(), scene_of(gaussians));
            let page = GaussianPage { title: &title, scene: &optimised, cameras: &cameras, background: *background };
            write_html(&arguments.output, &page)?;
        }
        false => scene_of(gaussians).write(&arguments.output, &scene.frame)?,
    }
    let count = gaussians.len();
    say(format_args!("{}: {count} Gaussians after {done} of {of} iterations", arguments.output.display()))?;
    if let Some((psnr, count)) = fit {
        say(format_args!(
            "fit: PSNR {psnr:.2} dB on {count} of the sources themselves, which says nothing of new views: --left-out VIEW keeps \
             one back and scores it"
        ))?;
    }
    let loops = match &device {
        AnyDevice::Vulkan(own) if own.is_software() => {
            "; a software driver: the steps were made by the CPU's own loops"
        }
        _ => "",
    };
    say(format_args!("device: {}, {reason}{loops}", device.name()))?;
    Ok(if done < of { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// An optimisation and what it is of.
struct Job<'a> {
    arguments: &'a Arguments,
    scene: &'a Scene,
    sources: Vec<usize>,
    targets: Vec<usize>,
    /// Views that the optimisation ends with the weights of.
    towards: Vec<Target>,
    options: RenderOptions,
    weighting: Weighting,
    before: Option<GaussianFile>,
}

impl Job<'_> {
    fn optimise<D: Device>(
        &self,
        device: &D,
        any: &AnyDevice,
        field: &AnyField,
        progress: &Terminal,
    ) -> anyhow::Result<Ended> {
        let renderer = field.on(any);
        progress.stage("reading the photographs", 0..1, 10);
        let shown = self.sources.iter().chain(&self.targets).copied();
        let album = open_album(self.scene, shown, renderer.as_ref(), &self.options, progress)?;
        let mut stage = Stage::prepare(self.scene, &album, &self.sources, renderer.as_ref(), &self.options, progress)?;
        progress.stage("finding surfaces", 1..3, 10);
        let points = point_cloud(&mut stage, &self.weighting, Recipe::cloud(self.sources.len()), &Silent)?;
        let own = Recipe { seed: self.arguments.seed, ..Recipe::default() };
        let recipe = own.with(self.arguments.iterations, self.arguments.count);
        let Some(mut optimiser) = Optimiser::new(device, &stage.images, &points, recipe)? else {
            bail!("{}: too few views agree on any surface to begin Gaussians with", self.scene.path.display());
        };
        if let Some(before) = &self.before {
            before.notes.iter().for_each(|note| progress.warn(note));
            optimiser.resume(&before.scene.blocks(Vec3::ZERO));
        }
        progress.stage("optimising", 3..10, 10);
        let more = if self.towards.is_empty() { 0 } else { TOWARDS };
        progress.expect((optimiser.iteration_count() + more - optimiser.done()) as usize);
        self.advance(&mut optimiser, any, &album, progress)?;
        if more > 0 && !progress.is_cancelled() {
            optimiser.extend(more);
            optimiser.weigh(&self.weights()?);
            self.advance(&mut optimiser, any, &album, progress)?;
        }
        let (gaussians, done, of) = (optimiser.optimised().gaussians, optimiser.done(), optimiser.iteration_count());
        let sources = &self.sources[..self.sources.len().min(FIT_SOURCES)];
        let is_alone = self.targets.is_empty() && !progress.is_cancelled();
        let fit = is_alone.then(|| self.score(&gaussians, any, &album, sources)).transpose()?;
        let fit = fit.map(|psnr| (psnr, sources.len()));
        Ok(Ended { gaussians, background: behind(&stage.images), done, of, fit })
    }

    /// All iterations, with scores and files on the way; fewer if it is cancelled.
    fn advance<D: Device>(
        &self,
        optimiser: &mut Optimiser<'_, D>,
        any: &AnyDevice,
        album: &Album<'_>,
        progress: &Terminal,
    ) -> anyhow::Result<()> {
        let of = optimiser.iteration_count();
        while optimiser.done() < of && !progress.is_cancelled() {
            optimiser.advance()?;
            progress.step();
            let done = optimiser.done();
            if !done.is_multiple_of(SCORED) && done != of {
                continue;
            }
            let gaussians = optimiser.optimised().gaussians;
            if done < of && is_of(&self.arguments.output, "ply") {
                // For --resume, if the program is killed.
                scene_of(&gaussians).write(&self.arguments.output, &self.scene.frame)?;
            }
            if !self.targets.is_empty() {
                let psnr = self.score(&gaussians, any, album, &self.targets)?;
                progress.note(&format!("iteration {done} of {of}: views left out have a PSNR of {psnr:.2} dB"));
            }
        }
        Ok(())
    }

    /// The sources' weights for the views of `--towards`: their sum over these.
    fn weights(&self) -> anyhow::Result<Vec<f32>> {
        let unit = RigUnit::of_scene(self.scene);
        let poses: Vec<_> = self.sources.iter().map(|view| unit.pose(&self.scene.views[*view].camera.pose)).collect();
        let sources = SourcePoses::new(&poses)?;
        let mut sums = vec![0.0; poses.len()];
        for target in &self.towards {
            let weights = self.weighting.weigh(&sources, &unit.pose(&target.camera.pose));
            sums.iter_mut().zip(weights.values()).for_each(|(sum, weight)| *sum += weight);
        }
        Ok(sums)
    }

    /// Mean PSNR of these views.
    fn score(
        &self,
        gaussians: &[GaussianBlock],
        any: &AnyDevice,
        album: &Album<'_>,
        views: &[usize],
    ) -> anyhow::Result<f64> {
        let given = AnyField::new(GivenGaussians { scene: scene_of(gaussians), notes: Vec::new() });
        let renderer = given.on(any);
        let mut stage = Stage::prepare(self.scene, album, &self.sources, renderer.as_ref(), &self.options, &Silent)?;
        let mut sum = 0.0;
        for view in views {
            let frame = stage.frame(&self.weighting, &target_of(self.scene, *view), &Silent)?;
            sum += frame.truth.map_or(0.0, |truth| truth.psnr);
        }
        Ok(sum / views.len() as f64)
    }
}
