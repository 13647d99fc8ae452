//! The sources that are held out, rendered coarsely from the others: an estimate of a field's quality without the
//! truth.

use super::calibration::Sample;
use super::gain::nearest;
use super::kept::Kept;
use crate::budget::Bound;
use crate::held_out::{HeldOut, HoldOut, Photographs};
use crate::render::{RenderError, RenderOptions, SceneSources, Stage};
use crate::renderer::Renderer;
use crate::standing::{Measure, Standing};
use crate::{AnyOptions, Check, Drawing, Purpose, Rendered};
use bytemuck::{bytes_of, cast_slice};
use image::{Rgb, RgbImage};
use std::ops::Range;
use viewfuse_core::pose::Pose;
use viewfuse_job::progress::{Interrupted, Progress, Quiet};
use viewfuse_scene::few_shot::Target;
use viewfuse_scene::photographs::{GroundTruth, SourceImages, scaled_size, to_rgb8};
use viewfuse_weighting::Weighting;

/// Sources are held out one at a time, small, and each is rendered from its neighbours.
pub const HOLD_OUT: HoldOut = HoldOut { max_views: 6, max_neighbours: 8, side: 96 };
/// Root mean square error of these pictures, 40 dB: beside errors of 20 to 25 dB, as those of networks, it changes a
/// score by
/// 0.04 to 0.14 dB if it is independent of them, and those of all schemes alike.
const MAX_ERROR: f32 = 0.01;

/// The sources that are held out, each with the others on the device.
pub(super) struct HeldOutSources<'a> {
    sources: Vec<Source<'a>>,
    /// The weighting under which the others are encoded.
    weighting: Weighting,
    /// Their pictures so far, of earlier runs as well.
    kept: Kept,
}

/// A source that is held out.
struct Source<'a> {
    held_out: HeldOut<'a>,
    /// Whether the others are encoded.
    is_encoded: bool,
    target: Target,
    /// Its geometry among the others.
    standing: Standing,
    /// The score of a copy of the nearest of the others.
    copy: f64,
}

/// The result of a held-out source.
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

/// The options of pictures of held-out sources. Where a field can check single pixels, these pictures are within
/// [`MAX_ERROR`] of the exact ones; elsewhere a check would take a second picture, and they are not bounded.
pub(super) fn coarse(options: &RenderOptions, stage: &Stage<'_>) -> RenderOptions {
    let camera = stage.scene().and_then(|of| of.scene.views.first()).map(|view| view.camera);
    let size = camera.map(|camera| scaled_size(&camera, HOLD_OUT.side.min(stage.side())).into());
    let bound = (stage.session.prepared.check() == Check::Pixels).then_some(Bound::Error(MAX_ERROR));
    RenderOptions { size, field: None, mixture: None, bound, is_rounded: false, ..options.clone() }
}

/// The longest side of coarse pictures.
pub(super) fn coarse_side(coarse: &RenderOptions) -> u32 {
    coarse.size.map_or(HOLD_OUT.side, |[width, height]| width.max(height))
}

impl<'a> HeldOutSources<'a> {
    /// Holds out sources of `stage`; the others will be encoded when a picture needs them, weighted by `weighting`,
    /// with the field's own options. Empty if there are too few sources. A source without which the field finds no
    /// object is skipped.
    pub(super) fn prepare(
        stage: &'a Stage<'_>,
        weighting: &Weighting,
        renderer: &'a dyn Renderer,
        options: &'a RenderOptions,
        progress: &dyn Progress,
    ) -> Result<HeldOutSources<'a>, RenderError> {
        let about = renderer.about();
        let mut sources = Vec::new();
        let weighting = weighting.clone();
        let Some(&SceneSources { scene, album, ref views }) = stage.scene() else {
            return Ok(HeldOutSources { sources, weighting, kept: Kept::default() });
        };
        let poses: Vec<Pose> = views.iter().map(|&view| scene.views[view].camera.pose).collect();
        if poses.len() <= about.least_sources {
            return Ok(HeldOutSources { sources, weighting, kept: Kept::default() });
        }
        let cameras: Vec<_> = stage.images.images.iter().map(|image| image.camera).collect();
        let measure = Measure::of(&cameras);
        let hold_out = HoldOut { side: coarse_side(options), ..HOLD_OUT };
        let (images, surfaces) = (&stage.images, stage.surfaces());
        let photographs = Photographs::new((scene, album), views.clone(), images, surfaces, hold_out, &about)?;
        let chosen = hold_out.views(&poses);
        progress.expect(chosen.len());
        let quiet = &Quiet(progress);
        for source in chosen {
            progress.check().map_err(stopped)?;
            if !photographs.shows_anything(source) {
                progress.step();
                continue;
            }
            let copies = photographs.copies(source);
            let mut others = hold_out.neighbours_among(&poses, source, |other| !copies.contains(&other));
            others.sort_unstable();
            let standing = measure.standing(&poses[source], others.iter().map(|&other| &poses[other]));
            let prepared = photographs.hold_out(source, others, renderer, options, quiet).and_then(|mut held_out| {
                held_out.stage.reduce(Purpose::Trial)?;
                Ok(held_out)
            });
            progress.step();
            let held_out = match prepared {
                Err(RenderError::Unsuitable { .. }) => continue,
                prepared => prepared?,
            };
            let name = scene.views[views[source]].name.clone();
            let target = Target { name, camera: held_out.camera, truth: None };
            if held_out.stage.size_at(&target.camera)? != <[u32; 2]>::from(held_out.truth.picture.dimensions()) {
                continue;
            }
            let copy = held_out.score(&held_out.nearest_copy());
            sources.push(Source { held_out, is_encoded: false, target, standing, copy });
        }
        let field = renderer.options();
        let kept = field.folder().map_or_else(Kept::default, |folder| {
            let depends_on = format!("{} {} {field:?} {options:?} {weighting}", about.name, renderer.device_name());
            Kept::open(folder, &[depends_on.as_bytes(), &bytes(images)].concat(), progress)
        });
        Ok(HeldOutSources { sources, weighting, kept })
    }

    /// Whether nothing could be held out.
    pub(super) fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// How many sources are held out.
    pub(super) fn len(&self) -> usize {
        self.sources.len()
    }

    /// Which of them is nearest to the others.
    pub(super) fn nearest(&self) -> usize {
        nearest(self.sources.iter().map(|source| source.standing.gap)).unwrap_or(0)
    }

    /// The names of the held-out sources.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.sources.iter().map(|source| source.target.name.as_str())
    }

    /// The results of [`HeldOutSources::frames`].
    pub(super) fn outcomes(
        &mut self,
        weighting: &Weighting,
        asked: &[(Range<usize>, &AnyOptions)],
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<Outcome>>, RenderError> {
        let frames = self.frames(weighting, asked, progress)?;
        let outcome = |(index, frame): (usize, &Rendered)| {
            let picture = to_rgb8(&frame.colours, [frame.width, frame.height]);
            self.outcome(index, &picture, &frame.confidences)
        };
        let all = asked.iter().zip(&frames);
        Ok(all.map(|((which, _), frames)| which.clone().zip(frames).map(outcome).collect()).collect())
    }

    /// Pictures with a weighting, for each of the options those of some held-out sources: kept ones, or rendered. All of
    /// them are begun before the first one is waited for.
    pub(super) fn frames(
        &mut self,
        weighting: &Weighting,
        asked: &[(Range<usize>, &AnyOptions)],
        progress: &dyn Progress,
    ) -> Result<Vec<Vec<Rendered>>, RenderError> {
        let begun = asked.iter().map(|(which, options)| self.begin(which.clone(), weighting, options, progress));
        let begun = begun.collect::<Result<Vec<_>, _>>()?;
        let mut all = Vec::with_capacity(begun.len());
        for begun in begun {
            let mut frames = Vec::with_capacity(begun.len());
            for (name, drawing) in begun {
                if let Some(drawing) = drawing {
                    self.kept.add(name.clone(), drawing().map_err(RenderError::Field)?);
                }
                frames.extend(self.kept.picture(&name).cloned());
                progress.step();
            }
            all.push(frames);
        }
        Ok(all)
    }

    /// Begins the pictures that are not kept; with the names of all.
    fn begin(
        &mut self,
        which: Range<usize>,
        weighting: &Weighting,
        options: &AnyOptions,
        progress: &dyn Progress,
    ) -> Result<Vec<(String, Option<Drawing<'a>>)>, RenderError> {
        let quiet = &Quiet(progress);
        let is_kept = |index: usize| self.kept.picture(&Kept::name(index, weighting, options)).is_some();
        let missing: Vec<usize> = which.clone().filter(|index| !is_kept(*index)).collect();
        for &index in &missing {
            progress.check().map_err(stopped)?;
            self.sources[index].set(&self.weighting, options, progress)?;
        }
        // All of them go as far as they can before one waits for the device.
        let mut waiting = missing.clone();
        while !waiting.is_empty() {
            let mut still = Vec::with_capacity(waiting.len());
            for index in waiting {
                progress.check().map_err(stopped)?;
                let Source { held_out, target, .. } = &mut self.sources[index];
                if !held_out.stage.advance(weighting, target, quiet)? {
                    still.push(index);
                }
            }
            waiting = still;
        }
        let mut begun = Vec::with_capacity(which.len());
        for index in which {
            progress.check().map_err(stopped)?;
            let Source { held_out, target, .. } = &mut self.sources[index];
            let is_missing = missing.contains(&index);
            let drawing = is_missing.then(|| held_out.stage.draw(weighting, target, quiet)).transpose()?;
            begun.push((Kept::name(index, weighting, options), drawing));
        }
        Ok(begun)
    }

    /// Keeps the pictures for the next run, if there is a folder for them.
    pub(super) fn keep(&mut self, progress: &dyn Progress) {
        self.kept.write(progress);
    }

    /// What the held-out sources show.
    pub(super) fn truths(&self) -> impl Iterator<Item = &GroundTruth> {
        self.sources.iter().map(|source| &source.held_out.truth)
    }

    /// The result of a picture of a held-out source, with the confidences of its pixels.
    pub(super) fn outcome(&self, index: usize, picture: &RgbImage, confidences: &[f32]) -> Outcome {
        let Source { held_out, standing, copy, .. } = &self.sources[index];
        let GroundTruth { picture: truth, seen } = &held_out.truth;
        let square = |(pixel, truth): (&Rgb<u8>, &Rgb<u8>)| {
            let difference = |channel: usize| (f32::from(pixel.0[channel]) - f32::from(truth.0[channel])) / 255.0;
            (0..3).map(|channel| difference(channel).powi(2)).sum::<f32>() / 3.0
        };
        let samples = confidences.iter().zip(picture.pixels().zip(truth.pixels()));
        let samples = samples.map(|(&confidence, pair)| Sample { confidence, square: square(pair) });
        let is_seen = |index: usize| seen.as_ref().is_none_or(|seen| seen.as_raw()[index] > 0);
        let samples = samples.enumerate().filter(|(index, _)| is_seen(*index)).map(|(_, sample)| sample).collect();
        let (psnr, confidence) = (held_out.score(picture), mean(confidences));
        Outcome { psnr, confidence, samples, standing: *standing, copy: *copy }
    }
}

impl Source<'_> {
    /// Sets the options of its next picture from the others, which are encoded under the `first` weighting.
    fn set(&mut self, first: &Weighting, options: &AnyOptions, progress: &dyn Progress) -> Result<(), RenderError> {
        let (stage, quiet) = (&mut self.held_out.stage, &Quiet(progress));
        if !self.is_encoded {
            stage.weigh(first, quiet)?;
            stage.encode_all(quiet)?;
            self.is_encoded = true;
        }
        stage.vary(Some(options), None, progress)
    }
}

/// All that is known of the sources, as bytes.
fn bytes(images: &SourceImages) -> Vec<u8> {
    let SourceImages { images, background, has_silhouettes, points, near_far, focus, warnings: _ } = images;
    let mut bytes = format!("{background:?} {has_silhouettes} {points:?} {near_far:?} {focus:?}").into_bytes();
    for image in images {
        bytes.extend(bytes_of(&image.camera.block(0)));
        bytes.extend(cast_slice::<_, u8>(&image.texels));
    }
    bytes
}

/// The mean of confidences; `None` if there are none.
fn mean(confidences: &[f32]) -> Option<f64> {
    let sum: f64 = confidences.iter().copied().map(f64::from).sum();
    (!confidences.is_empty()).then(|| sum / confidences.len() as f64)
}

fn stopped(interrupted: Interrupted) -> RenderError {
    RenderError::Field(interrupted.into())
}
