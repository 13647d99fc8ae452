//! The targets of a protocol on a scene, with what the sweep knows of them.

use anyhow::Context;
use viewfuse_core::camera::Camera;
use viewfuse_device::cpu::Cpu;
use viewfuse_evaluate::protocol::{Draws, Protocol};
use viewfuse_evaluate::without_masks;
use viewfuse_field::On;
use viewfuse_field::render::{RenderOptions, Stage, Truth};
use viewfuse_field::training_free::{TargetPlanes, TrainingFree};
use viewfuse_job::progress::Silent;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::target_of;
use viewfuse_scene::photographs::{Album, BackgroundChoice, scaled_size};
use viewfuse_weighting::Weighting;

/// The scheme of all pictures: the best on average over left-out sources.
pub(crate) const SCHEME: &str = "distance:power=2";

/// A target.
pub(crate) struct Visit<'a> {
    /// The scene, without masks where the protocol hides them.
    pub(crate) scene: &'a Scene,
    /// Its photographs.
    pub(crate) album: &'a Album<'a>,
    /// Source views.
    pub(crate) sources: &'a [usize],
    /// The target view.
    pub(crate) target: usize,
    /// Columns and rows of the picture.
    pub(crate) size: [u32; 2],
    /// The planes of the sweep.
    pub(crate) planes: &'a TargetPlanes,
    /// The field's own picture, not rounded: red, green, blue over the background, and opacity.
    pub(crate) colours: &'a [[f32; 4]],
    /// The photograph and the field's scores.
    pub(crate) truth: &'a Truth,
    /// Whether alpha is a silhouette.
    pub(crate) has_silhouettes: bool,
    /// What is behind.
    pub(crate) background: [f32; 3],
}

impl Visit<'_> {
    /// The photograph's colours, of 1.
    pub(crate) fn photograph(&self) -> Vec<[f32; 3]> {
        self.truth.picture.pixels().map(|pixel| pixel.0.map(|level| f32::from(level) / 255.0)).collect()
    }

    /// The pixels that count.
    pub(crate) fn seen(&self) -> Vec<bool> {
        let all = || vec![true; self.colours.len()];
        let of = |seen: &image::GrayImage| seen.pixels().map(|pixel| pixel.0[0] == u8::MAX).collect();
        self.truth.seen.as_ref().map_or_else(all, of)
    }
}

/// Calls `visit` for at most `most_targets` targets of a job, with pictures of the longest side `side`.
pub(crate) fn visit(
    mut scene: Scene,
    protocol: &Protocol,
    side: u32,
    most_targets: usize,
    mut visit: impl FnMut(&Visit<'_>) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut options = RenderOptions::default();
    if protocol.hides_masks() {
        scene = without_masks(&scene);
        options.background = BackgroundChoice::None;
    }
    options.size = Some(scaled_size(&scene.views[0].camera, side).into());
    let scenes = [scene];
    let plan = protocol.plan(&scenes, Draws { seed: 0, trial_count: 1, target_count: most_targets }, 2)?;
    let scene = &scenes[0];
    let pairs: Vec<(&[usize], usize)> =
        plan.jobs.iter().flat_map(|job| job.targets.iter().map(|target| (&job.sources[..], *target))).collect();
    let step = pairs.len().div_ceil(most_targets).max(1);
    for (sources, target) in pairs.into_iter().step_by(step) {
        let album = Album::open(scene, sources.iter().copied().chain([target]), &Silent)?;
        let field = TrainingFree::default();
        let renderer = On { device: &Cpu, field: &field };
        let mut stage = Stage::prepare(scene, &album, sources, &renderer, &options, &Silent)?;
        let weighting = Weighting::open(SCHEME)?;
        stage.weigh(&weighting, &Silent)?;
        let frame = stage.frame(&weighting, &target_of(scene, target), &Silent)?;
        let size = stage.size_at(&scene.views[target].camera)?;
        let camera = scene.views[target].camera;
        let camera = Camera { pinhole: camera.pinhole.resized(size[0], size[1])?, ..camera };
        let relevance = stage.relevance(&weighting);
        let targets = [(camera, frame.omission.weights)];
        let planes = field.sweep.target_planes(&Cpu, &stage.images, &relevance, &targets, &Silent)?;
        visit(&Visit {
            scene,
            album: &album,
            sources,
            target,
            size,
            planes: planes.first().context("no planes")?,
            colours: &frame.colours,
            truth: frame.truth.as_ref().context("no photograph to compare with")?,
            has_silhouettes: stage.images.has_silhouettes,
            background: stage.images.background,
        })?;
    }
    Ok(())
}
