//! Held-out sources, rendered coarsely from the other sources: an estimate of a field's quality without the truth.

use super::calibration::Sample;
use crate::Setting;
use crate::budget::Bound;
use crate::render::{Frame, RenderError, RenderOptions, SceneSources, Stage};
use crate::renderer::Renderer;
use crate::scores::psnr_of_seen;
use crate::session::Judge;
use crate::standing::{Measure, Standing};
use image::imageops::{self, FilterType};
use image::{GrayImage, Rgb, RgbImage};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use viewfuse_core::Vec3;
use viewfuse_core::camera::PinholeError;
use viewfuse_core::pose::Pose;
use viewfuse_job::progress::{Interrupted, Progress, Quiet};
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::Target;
use viewfuse_scene::photographs::{SourceImage, SourceImages, scaled_size};
use viewfuse_scene::rig::spread;
use viewfuse_weighting::Weighting;

/// Most sources that are left out, one at a time.
pub const MAX_LEFT_OUT: usize = 6;
/// Most of the other sources that a source is rendered from, the nearest ones.
pub const MAX_NEIGHBOURS: usize = 8;
/// Longest side of these pictures, in pixels.
pub const SIDE: u32 = 96;
/// Root mean square error of these pictures, 40 dB: beside errors of 20 to 25 dB, as those of networks, it changes a score by
/// 0.04 to 0.14 dB if it is independent of them, and those of all schemes alike.
const MAX_ERROR: f32 = 0.01;
/// The greatest score, decibels: that of 8-bit pictures that differ in rounding alone.
const MAX_PSNR: f64 = 51.0;

/// Sources that are left out, each with the others on the device.
pub(super) struct Trials<'a> {
    trials: Vec<Trial<'a>>,
}

/// A source that is left out.
struct Trial<'a> {
    stage: Stage<'a>,
    target: Target,
    truth: RgbImage,
    /// Where the source shows something; `None` if everywhere.
    seen: Option<GrayImage>,
    standing: Standing,
    /// The score of a copy of the nearest of the others.
    copy: f64,
}

/// The result of a source that was left out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Outcome {
    /// Peak signal to noise ratio, decibels.
    pub(super) psnr: f64,
    /// Mean confidence of its pixels; `None` if the field does not estimate it.
    pub(super) confidence: Option<f64>,
    /// The pixels that the source shows; empty if the field estimates no confidence.
    pub(super) samples: Vec<Sample>,
    /// Its geometry among the others.
    pub(super) standing: Standing,
    /// The score of a copy of the nearest of the others.
    pub(super) copy: f64,
}

/// The options of pictures of sources that are left out. Where a field can check single pixels, these pictures are within
/// [`MAX_ERROR`] of the exact ones; elsewhere a check would take a second picture, and they are not bounded.
pub(super) fn coarse(options: &RenderOptions, stage: &Stage<'_>) -> RenderOptions {
    let camera = stage.scene().and_then(|of| of.scene.views.first()).map(|view| view.camera);
    let size = camera.map(|camera| scaled_size(&camera, SIDE.min(stage.side())).into());
    let bound = (stage.session.judge == Judge::Pixels).then_some(Bound::Error(MAX_ERROR));
    RenderOptions { size, settings: Vec::new(), mixture: None, bound, ..options.clone() }
}

impl<'a> Trials<'a> {
    /// Leaves sources of `stage` out and encodes the others, weighted by `weighting`, with the default settings. Empty
    /// if there are too few sources. A source without which the field finds no object is skipped.
    pub(super) fn prepare(
        stage: &Stage<'a>,
        weighting: &Weighting,
        renderer: &'a dyn Renderer,
        options: &'a RenderOptions,
        progress: &dyn Progress,
    ) -> Result<Trials<'a>, RenderError> {
        let about = renderer.about();
        let mut trials = Vec::new();
        let Some(&SceneSources { scene, album, ref views }) = stage.scene() else { return Ok(Trials { trials }) };
        let poses: Vec<Pose> = views.iter().map(|&view| scene.views[view].camera.pose).collect();
        if poses.len() <= about.least_sources {
            return Ok(Trials { trials });
        }
        let cameras: Vec<_> = stage.images.images.iter().map(|image| image.camera).collect();
        let measure = Measure::of(&cameras);
        let side = options.size.map_or(SIDE, |[width, height]| width.max(height));
        let reduced: Vec<SourceImage> = stage
            .images
            .images
            .iter()
            .map(|image| small(image, about.source_side.of(side), scene))
            .collect::<Result<_, _>>()?;
        let surfaces = stage.surfaces();
        let centres: Vec<Vec3> = poses.iter().map(Pose::centre_world).collect();
        let chosen = spread(&centres, MAX_LEFT_OUT);
        progress.expect(chosen.len());
        for source in chosen {
            progress.check().map_err(stopped)?;
            let others = nearest(&poses, source, MAX_NEIGHBOURS);
            let other_views: Vec<usize> = others.iter().map(|&other| views[other]).collect();
            let images = Arc::new(SourceImages {
                images: others.iter().map(|&other| reduced[other].clone()).collect(),
                background: stage.images.background,
                has_silhouettes: stage.images.has_silhouettes,
                points: surfaces.points.clone(),
                near_far: surfaces.near_far,
                warnings: Vec::new(),
            });
            let quiet = &Quiet(progress);
            let prepared =
                Stage::of_images(scene, album, &other_views, images, renderer, options, quiet).and_then(|mut own| {
                    own.set_trial();
                    own.weigh(weighting, quiet)?;
                    own.encode_all(quiet)?;
                    Ok(own)
                });
            progress.step();
            let own = match prepared {
                Err(RenderError::Unsuitable { .. }) => continue,
                own => own?,
            };
            let shown = small(&stage.images.images[source], side, scene)?;
            let name = scene.views[views[source]].name.clone();
            let target = Target { name, camera: shown.camera, truth: None };
            let seen = if stage.images.has_silhouettes { None } else { shown_part(&shown) };
            let truth = SourceImages { images: vec![shown], ..own.images.as_ref().clone() }.picture(0);
            if own.size_at(&target.camera)? != [truth.width(), truth.height()] {
                continue;
            }
            let standing = measure.standing(&poses[source], others.iter().map(|&other| &poses[other]));
            let nearest = (0..others.len()).min_by(|&a, &b| {
                let distance = |other: usize| poses[others[other]].distance(&poses[source]);
                distance(a).total_cmp(&distance(b))
            });
            let copy = nearest.map_or(0.0, |nearest| copy_score(&own.images.picture(nearest), &truth, seen.as_ref()));
            trials.push(Trial { stage: own, target, truth, seen, standing, copy });
        }
        Ok(Trials { trials })
    }

    /// Whether nothing could be left out.
    pub(super) fn is_empty(&self) -> bool {
        self.trials.is_empty()
    }

    /// How many sources are left out.
    pub(super) fn len(&self) -> usize {
        self.trials.len()
    }

    /// The names of the sources that are left out.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.trials.iter().map(|trial| trial.target.name.as_str())
    }

    /// Renders these of the sources that are left out with this weighting and these settings.
    pub(super) fn outcomes(
        &mut self,
        which: Range<usize>,
        weighting: &Weighting,
        settings: &[Setting],
        progress: &dyn Progress,
    ) -> Result<Vec<Outcome>, RenderError> {
        let frames = self.frames(which.clone(), weighting, settings, progress)?;
        let outcome = |(index, frame): (usize, &Frame)| self.outcome(index, &frame.picture, &frame.confidences);
        Ok(which.zip(&frames).map(outcome).collect())
    }

    /// The settings whose pictures are worth mixing where these were chosen.
    pub(super) fn parts(&mut self, chosen: &[Setting]) -> Vec<Vec<Setting>> {
        self.trials.first_mut().map_or_else(Vec::new, |trial| trial.stage.parts(chosen))
    }

    /// The pictures of these of the sources that are left out.
    pub(super) fn frames(
        &mut self,
        which: Range<usize>,
        weighting: &Weighting,
        settings: &[Setting],
        progress: &dyn Progress,
    ) -> Result<Vec<Frame>, RenderError> {
        let mut frames = Vec::with_capacity(which.len());
        for Trial { stage, target, .. } in &mut self.trials[which] {
            progress.check().map_err(stopped)?;
            stage.tune(settings, None);
            frames.push(stage.frame(weighting, target, &Quiet(progress))?);
            progress.step();
        }
        Ok(frames)
    }

    /// What the sources that are left out show, and where they show something, if not everywhere.
    pub(super) fn truths(&self) -> impl Iterator<Item = (&RgbImage, Option<&GrayImage>)> {
        self.trials.iter().map(|trial| (&trial.truth, trial.seen.as_ref()))
    }

    /// The result of a picture of a source that is left out, with the confidences of its pixels.
    pub(super) fn outcome(&self, index: usize, picture: &RgbImage, confidences: &[f32]) -> Outcome {
        let Trial { truth, seen, standing, copy, .. } = &self.trials[index];
        let psnr = psnr_of_seen(picture, truth, seen.as_ref()).min(MAX_PSNR);
        let square = |(own, truth): (&Rgb<u8>, &Rgb<u8>)| {
            let of = |channel: usize| (f32::from(own.0[channel]) - f32::from(truth.0[channel])) / 255.0;
            (0..3).map(|channel| of(channel).powi(2)).sum::<f32>() / 3.0
        };
        let samples = confidences.iter().zip(picture.pixels().zip(truth.pixels()));
        let samples = samples.map(|(&confidence, pair)| Sample { confidence, square: square(pair) });
        let is_seen = |index: usize| seen.as_ref().is_none_or(|seen| seen.as_raw()[index] > 0);
        let samples = samples.enumerate().filter(|(index, _)| is_seen(*index)).map(|(_, sample)| sample).collect();
        Outcome { psnr, confidence: mean(confidences), samples, standing: *standing, copy: *copy }
    }
}

/// The score of a picture that is resampled to the truth's size.
fn copy_score(picture: &RgbImage, truth: &RgbImage, seen: Option<&GrayImage>) -> f64 {
    let (width, height) = truth.dimensions();
    let copy = match picture.dimensions() == (width, height) {
        true => Cow::Borrowed(picture),
        false => Cow::Owned(imageops::resize(picture, width, height, FilterType::Triangle)),
    };
    psnr_of_seen(&copy, truth, seen).min(MAX_PSNR)
}

/// The pixels that a whole photograph shows: those its lens did not see have alpha 0. `None` if it shows all of them.
fn shown_part(SourceImage { camera, texels }: &SourceImage) -> Option<GrayImage> {
    let levels: Vec<u8> = texels.iter().map(|texel| if texel[3] > 0.999 { u8::MAX } else { 0 }).collect();
    GrayImage::from_raw(camera.pinhole.width(), camera.pinhole.height(), levels)
        .filter(|seen| seen.as_raw().contains(&0))
}

/// A source with a longest side of at most `side` pixels.
fn small(image: &SourceImage, side: u32, scene: &Scene) -> Result<SourceImage, RenderError> {
    let unusable =
        |error: PinholeError| RenderError::Unsuitable { scene: scene.path.display().to_string(), reason: error.into() };
    image.reduced(side).map_err(unusable)
}

/// The mean of confidences; `None` if there are none.
pub(super) fn mean(confidences: &[f32]) -> Option<f64> {
    let sum: f64 = confidences.iter().copied().map(f64::from).sum();
    (!confidences.is_empty()).then(|| sum / confidences.len() as f64)
}

fn stopped(interrupted: Interrupted) -> RenderError {
    RenderError::Field(interrupted.into())
}

/// Up to `count` of the other cameras, the nearest ones, ascending.
fn nearest(poses: &[Pose], own: usize, count: usize) -> Vec<usize> {
    let mut others: Vec<usize> = (0..poses.len()).filter(|other| *other != own).collect();
    others.sort_by(|a, b| poses[*a].distance(&poses[own]).total_cmp(&poses[*b].distance(&poses[own])));
    others.truncate(count);
    others.sort_unstable();
    others
}
