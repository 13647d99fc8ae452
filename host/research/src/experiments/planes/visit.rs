//! The targets of a protocol on a scene, with what the sweep knows of them.

use super::TargetPlanes;
use super::keeping::Keeping;
use anyhow::Context;
use std::sync::Arc;
use viewfuse_evaluate::protocol::{Draws, Protocol};
use viewfuse_evaluate::without_masks;
use viewfuse_field::render::{Frame, RenderOptions, Stage, Truth};
use viewfuse_field::training_free::TrainingFree;
use viewfuse_field::{Field, On};
use viewfuse_job::progress::Silent;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::target_of;
use viewfuse_scene::photographs::{Album, BackgroundChoice, SourceImages, scaled_size};
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
    /// Which source each of its views is.
    pub(crate) blended: &'a [usize],
    /// The field's own picture, not rounded: red, green, blue over the background, and opacity.
    pub(crate) colours: &'a [[f32; 4]],
    /// The picture's confidences; 0 where no source shows the surface, and the colours around it fill it.
    pub(crate) confidences: &'a [f32],
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
    let field = TrainingFree::default();
    for (sources, target) in pairs.into_iter().step_by(step) {
        let album = Album::open(scene, sources.iter().copied().chain([target]), &Silent)?;
        let device = Keeping::default();
        let (images, frame) = rendered(&device, &field, scene, &album, sources, target, &options)?;
        // Objects with silhouettes are rendered without the sweep, whose planes are then those of a picture of its own.
        let planes = match device.take() {
            Some(planes) => planes,
            None => {
                rendered(&device, &field.sweep, scene, &album, sources, target, &options)?;
                device.take().context("the sweep blended no planes")?
            }
        };
        visit(&Visit {
            scene,
            album: &album,
            sources,
            target,
            size: [planes.block.target.width, planes.block.target.height],
            blended: &planes.sources(&images.images),
            planes: &planes,
            colours: &frame.colours,
            confidences: &frame.confidences,
            truth: frame.truth.as_ref().context("no photograph to compare with")?,
            has_silhouettes: images.has_silhouettes,
            background: images.background,
        })?;
    }
    Ok(())
}

/// The sources and the picture of a target by a field.
fn rendered(
    device: &Keeping,
    field: &(impl Field + Sync),
    scene: &Scene,
    album: &Album<'_>,
    sources: &[usize],
    target: usize,
    options: &RenderOptions,
) -> anyhow::Result<(Arc<SourceImages>, Frame)> {
    let weighting = Weighting::open(SCHEME)?;
    let renderer = On { device, field };
    let mut stage = Stage::prepare(scene, album, sources, &renderer, options, &Silent)?;
    stage.weigh(&weighting, &Silent)?;
    let frame = stage.frame(&weighting, &target_of(scene, target), &Silent)?;
    Ok((stage.images, frame))
}
