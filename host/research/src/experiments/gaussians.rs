//! Gaussians: the jobs of a protocol, with the points that an optimisation begins with and the field's own pictures.
//!
//! ```text
//! recipe    what matters in an optimisation
//! weights   the paper's question: a few iterations for a target, with the loss of each source by its relevance
//! frames    time of a picture by its stages, beside the arithmetic alone
//! ```

pub(super) mod frames;
pub(super) mod recipe;
pub(super) mod weights;

use super::planes::visit::SCHEME;
use anyhow::{Context, bail};
use std::path::Path;
use std::sync::Arc;
use viewfuse_device::choice::AnyDevice;
use viewfuse_device::cpu::Cpu;
use viewfuse_evaluate::protocol::{Draws, Protocol};
use viewfuse_evaluate::without_masks;
use viewfuse_field::gaussians::{GivenGaussians, Optimiser, scene_of};
use viewfuse_field::point_cloud::{CloudOptions, CloudPoint, point_cloud};
use viewfuse_field::render::{Frame, RenderOptions, Stage, Truth};
use viewfuse_field::training_free::TrainingFree;
use viewfuse_field::{AnyField, On};
use viewfuse_job::progress::Silent;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::target_of;
use viewfuse_scene::photographs::{Album, BackgroundChoice, SourceImages, scaled_size, to_rgb8};
use viewfuse_weighting::Weighting;

/// A job of a protocol.
struct Job<'a> {
    /// The scene's name.
    name: &'a str,
    scene: &'a Scene,
    album: &'a Album<'a>,
    options: &'a RenderOptions,
    sources: &'a [usize],
    targets: &'a [usize],
    images: &'a Arc<SourceImages>,
    /// Points on which two views agree.
    points: &'a [CloudPoint],
    /// The points of every view, confirmed or not.
    all_points: &'a [CloudPoint],
    /// The field's own picture of each target.
    frames: &'a [Frame],
}

/// A mean PSNR over the targets, and that of the pictures half and half with the field's.
#[derive(Clone, Copy)]
struct Score {
    alone: f64,
    half: f64,
}

impl Job<'_> {
    /// The frames of these Gaussians at the targets.
    fn frames_of(&self, gaussians: GivenGaussians) -> anyhow::Result<Vec<Frame>> {
        let (device, field) = (AnyDevice::Cpu(Cpu), AnyField::new(gaussians));
        let renderer = field.on(&device);
        let (renderer, images) = (renderer.as_ref(), Arc::clone(self.images));
        let mut stage =
            Stage::of_images(self.scene, self.album, self.sources, images, renderer, self.options, &Silent)?;
        let weighting = Weighting::open(SCHEME)?;
        let frame = |view: &usize| Ok(stage.frame(&weighting, &target_of(self.scene, *view), &Silent)?);
        self.targets.iter().map(frame).collect()
    }

    /// The scores of an optimisation so far.
    fn score(&self, optimiser: &Optimiser<'_, Cpu>) -> anyhow::Result<Score> {
        let frames = self.frames_of(GivenGaussians { scene: scene_of(&optimiser.optimised().gaussians) })?;
        let (mut alone, mut half) = (0.0, 0.0);
        for ((frame, own), view) in frames.iter().zip(self.frames).zip(self.targets) {
            alone += frame.truth.as_ref().context("no photograph to compare with")?.psnr;
            let mixed = |(a, b): (&[f32; 4], &[f32; 4])| [0, 1, 2, 3].map(|channel| 0.5 * (a[channel] + b[channel]));
            let colours: Vec<[f32; 4]> = frame.colours.iter().zip(&own.colours).map(mixed).collect();
            let size: [u32; 2] = frame.picture.dimensions().into();
            let behind = self.images.has_silhouettes.then_some(self.images.background);
            half += Truth::compare(&to_rgb8(&colours, size), self.album.truth(*view, size, behind)?).psnr;
        }
        let count = frames.len() as f64;
        Ok(Score { alone: alone / count, half: half / count })
    }

    /// The mean PSNR of the field's own pictures.
    fn field_score(&self) -> f64 {
        let scores = self.frames.iter().filter_map(|frame| Some(frame.truth.as_ref()?.psnr));
        scores.sum::<f64>() / self.frames.len() as f64
    }
}

/// Calls `visit` for each job of `SCENE=PROTOCOL`, with at most `most_targets` of its targets and pictures of this longest side.
fn visit(
    text: &str,
    side: u32,
    most_targets: usize,
    mut visit: impl FnMut(&Job<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let Some((folder, protocol)) = text.split_once('=') else { bail!("'{text}': a job is SCENE=PROTOCOL") };
    let protocol: Protocol = protocol.parse()?;
    let mut scene = Scene::open(Path::new(folder))?;
    let mut options = RenderOptions::default();
    if protocol.hides_masks() {
        scene = without_masks(&scene);
        options.background = BackgroundChoice::None;
    }
    options.size = Some(scaled_size(&scene.views[0].camera, side).into());
    let name = scene.name();
    let scenes = [scene];
    let plan = protocol.plan(&scenes, Draws { seed: 0, trial_count: 1, target_count: most_targets }, 2)?;
    let [scene] = &scenes;
    let field = TrainingFree::default();
    let renderer = On { device: &Cpu, field: &field };
    let weighting = Weighting::open(SCHEME)?;
    for job in &plan.jobs {
        let targets: Vec<usize> = job.targets.iter().copied().take(most_targets).collect();
        let album = Album::open(scene, job.sources.iter().chain(&targets).copied(), &Silent)?;
        let mut stage = Stage::prepare(scene, &album, &job.sources, &renderer, &options, &Silent)?;
        let points = point_cloud(&mut stage, &weighting, CloudOptions::default(), &Silent)?;
        let all_points = point_cloud(&mut stage, &weighting, CloudOptions { least_views: 1 }, &Silent)?;
        let frame = |view: &usize| Ok(stage.frame(&weighting, &target_of(scene, *view), &Silent)?);
        let frames: Vec<Frame> = targets.iter().map(frame).collect::<anyhow::Result<_>>()?;
        visit(&Job {
            name: &name,
            scene,
            album: &album,
            options: &options,
            sources: &job.sources,
            targets: &targets,
            images: &Arc::clone(&stage.images),
            points: &points,
            all_points: &all_points,
            frames: &frames,
        })?;
    }
    Ok(())
}
