//! `viewfuse optimise`.

use super::on_threads;
use super::options::{DeviceOptions, PictureOptions, SourceOptions};
use super::outputs::keep_file_apart;
use super::terminal::Terminal;
use super::{INTERRUPTED, say};
use anyhow::bail;
use clap::Args;
use clap::builder::{PathBufValueParser, TypedValueParser};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::gaussian::GaussianBlock;
use viewfuse_device::Device;
use viewfuse_device::choice::{AnyDevice, Chosen};
use viewfuse_field::AnyField;
use viewfuse_field::gaussians::{GivenGaussians, Optimiser, Recipe, behind, scene_of};
use viewfuse_field::point_cloud::{CloudOptions, point_cloud};
use viewfuse_field::render::{RenderOptions, Stage, open_album};
use viewfuse_job::files::check_writable;
use viewfuse_job::progress::{Progress, Silent};
use viewfuse_output::gaussian_page::{GaussianPage, write_html};
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{Selection, target_of};
use viewfuse_scene::gaussians::GaussianScene;
use viewfuse_weighting::{Weighting, WeightingSpec, grammar};

/// Iterations between two scores.
const SCORED: u32 = 40;

#[derive(Args)]
#[command(after_help = "Examples:\n  viewfuse optimise photos/ -o photos.ply\n  \
    viewfuse optimise dino/ --left-out 3 -o dino.ply\n      view 3 is kept back, and scored as the Gaussians become better\n  \
    viewfuse optimise photos/ -o photos.html\n      one page for any browser, without a server: to share\n  \
    viewfuse render photos/ --gaussians photos.ply --orbit 24 -o out\n\n\
    Begins with the surfaces that the training-free field finds, and takes a few seconds. Ctrl-C writes what there is so far; \
    --resume goes on from a file. The file has the layout of \"3D Gaussian Splatting\", which other viewers read, in the \
    coordinates of the scene's files.")]
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
    /// Most Gaussians
    #[arg(long, value_name = "N", default_value_t = Recipe::default().max_count as u32, value_parser = clap::value_parser!(u32).range(1..=2_000_000))]
    count: u32,
    /// Iterations at each size of the sources, the finest last
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
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
    /// The .ply file, or an .html page with the source cameras and their weights
    #[arg(short, long, value_name = "FILE", value_parser = PathBufValueParser::new().try_map(known_file))]
    output: PathBuf,
}

fn scheme_help() -> String {
    format!("Weighting scheme of the surfaces: {}", grammar())
}

/// A file of a format that is written.
fn known_file(path: PathBuf) -> Result<PathBuf, &'static str> {
    match ["ply", "html"].iter().any(|own| is_of(&path, own)) {
        true => Ok(path),
        false => Err("scenes of Gaussians are written as .ply or .html"),
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
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let weighting = arguments.weights.open()?;
    let scene = Scene::open(&arguments.scene)?;
    let field = AnyField::default();
    let about = field.about();
    let targets = match &arguments.left_out {
        Some(views) => {
            let selection = Selection { targets: Some(views.clone()), ..Selection::default() };
            let job = selection.resolve(&scene, about.least_sources)?;
            job.targets.iter().filter_map(|target| target.truth).collect()
        }
        None => Vec::new(),
    };
    let selection = arguments.sources.to_selection(None, None);
    let sources = selection.sources_without(&scene, &targets, about.least_sources)?;
    let options = arguments.picture.to_render_options(false, &about)?;
    check_writable(&arguments.output)?;
    keep_file_apart([&scene], &arguments.output)?;
    let before = arguments.resume.as_ref().map(|path| GaussianScene::read(path, &scene.frame)).transpose()?;
    let Chosen { device, reason } = arguments.device.open()?;
    let progress = Terminal::new("optimising");
    let job = Job { arguments, scene: &scene, sources: sources.clone(), targets, options, weighting, before };
    let ended = on_threads(arguments.picture.threads, || match &device {
        AnyDevice::Cpu(own) => job.optimise(own, &device, &field, &progress),
        AnyDevice::Vulkan(own) => job.optimise(own.as_ref(), &device, &field, &progress),
    })??;
    drop(progress);
    let Ended { gaussians, background, done, of } = &ended;
    let optimised = scene_of(gaussians);
    match is_of(&arguments.output, "html") {
        true => {
            let cameras: Vec<(String, Camera)> =
                sources.iter().map(|view| &scene.views[*view]).map(|own| (own.name.clone(), own.camera)).collect();
            let page =
                GaussianPage { title: &scene.name(), scene: &optimised, cameras: &cameras, background: *background };
            write_html(&arguments.output, &page)?;
        }
        false => optimised.write(&arguments.output, &scene.frame)?,
    }
    let count = gaussians.len();
    say(format_args!("{}: {count} Gaussians after {done} of {of} iterations", arguments.output.display()))?;
    say(format_args!("device: {}, {reason}", device.name()))?;
    Ok(if done < of { ExitCode::from(INTERRUPTED) } else { ExitCode::SUCCESS })
}

/// An optimisation and what it is of.
struct Job<'a> {
    arguments: &'a Arguments,
    scene: &'a Scene,
    sources: Vec<usize>,
    targets: Vec<usize>,
    options: RenderOptions,
    weighting: Weighting,
    before: Option<GaussianScene>,
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
        let points = point_cloud(&mut stage, &self.weighting, CloudOptions::default(), &Silent)?;
        let mut recipe =
            Recipe { max_count: self.arguments.count as usize, seed: self.arguments.seed, ..Recipe::default() };
        if let Some(count) = self.arguments.iterations {
            recipe.iterations.iter_mut().filter(|own| **own > 0).for_each(|own| *own = count);
        }
        let Some(mut optimiser) = Optimiser::new(device, &stage.images, &points, recipe)? else {
            bail!("{}: too few views agree on any surface to begin Gaussians with", self.scene.path.display());
        };
        if let Some(before) = &self.before {
            optimiser.resume(&before.blocks(Vec3::ZERO));
        }
        let of = optimiser.iteration_count();
        progress.stage("optimising", 3..10, 10);
        progress.expect((of - optimiser.done()) as usize);
        while optimiser.done() < of && !progress.is_cancelled() {
            optimiser.advance()?;
            progress.step();
            let done = optimiser.done();
            if !self.targets.is_empty() && (done % SCORED == 0 || done == of) {
                let psnr = self.score(&optimiser.optimised().gaussians, any, &album)?;
                progress.note(&format!("iteration {done} of {of}: views left out have a PSNR of {psnr:.2} dB"));
            }
        }
        let (gaussians, done) = (optimiser.optimised().gaussians, optimiser.done());
        Ok(Ended { gaussians, background: behind(&stage.images), done, of })
    }

    /// Mean PSNR of the views that are left out.
    fn score(
        &self,
        gaussians: &[GaussianBlock],
        any: &AnyDevice,
        album: &viewfuse_scene::photographs::Album<'_>,
    ) -> anyhow::Result<f64> {
        let given = AnyField::new(GivenGaussians { scene: scene_of(gaussians) });
        let renderer = given.on(any);
        let mut stage = Stage::prepare(self.scene, album, &self.sources, renderer.as_ref(), &self.options, &Silent)?;
        let mut sum = 0.0;
        for view in &self.targets {
            let frame = stage.frame(&self.weighting, &target_of(self.scene, *view), &Silent)?;
            sum += frame.truth.map_or(0.0, |truth| truth.psnr);
        }
        Ok(sum / self.targets.len() as f64)
    }
}
