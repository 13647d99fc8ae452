//! Chooses the weighting scheme and the field's scalars for a scene, and says which score to expect, from the sources alone:
//! some of them are left out, one at a time, and rendered coarsely from the others.
//!
//! ```text
//! geometry      how far a camera is from its sources
//! leave_out     sources rendered from the others
//! detail        what coarse pictures do not show
//! expectation   from these scores to a target's
//! ```
//!
//! The choice goes one coordinate at a time, the scheme first, then each of the field's scalars. All candidates are rendered
//! from what is encoded once, under the default scheme. A candidate replaces the default only if its gain is beyond the noise
//! between the sources that are left out.

mod detail;
mod expectation;
mod geometry;
mod leave_out;

pub use expectation::{Basis, Expected, TERMS};
pub use leave_out::{MOST_LEFT_OUT, MOST_NEIGHBOURS, SIDE};

use crate::render::{Finished, Frame, RenderError, RenderOptions, Stage};
use crate::{Renderer, Setting};
use geometry::Measure;
use leave_out::{Outcome, Trials, coarse, mean};
use serde::Serialize;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::{Formula, Scheme};
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::FewShot;
use viewfuse_scene::photographs::{Album, SourceImages};
use viewfuse_weighting::Weighting;

/// The schemes that are tried, the default first.
pub fn schemes() -> Vec<Scheme> {
    let of = |formula, choice, parameter| Scheme::new(formula, choice, parameter).ok();
    let more = [of(Formula::Error, 0, 0.5), of(Formula::Distance, 2, 0.0), of(Formula::Distance, 3, 0.0)];
    let plain = [Scheme::ERROR, Scheme::MEAN, Scheme::L1, Scheme::of(Formula::Gaussian)];
    plain.into_iter().chain(more.into_iter().flatten()).collect()
}

/// Least gain that is no noise, decibels.
const LEAST_GAIN: f64 = 0.03;
/// The gain must be so many times its standard error.
const GAIN_DEVIATIONS: f64 = 1.0;

/// A scheme and settings that were tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// The scheme.
    pub weighting: String,
    /// The field's scalars that are not at their defaults.
    pub settings: Vec<Setting>,
    /// Mean score of the sources that were left out, decibels.
    pub psnr: f64,
    /// The score of each.
    pub scores: Vec<f64>,
}

/// A source that was left out, with what was chosen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOutSource {
    /// Its name.
    pub source: String,
    /// Its score, decibels.
    pub psnr: f64,
    /// Its gap to the others; see [`Basis`].
    pub gap: f64,
    /// Mean confidence of its pixels; null for fields that do not tell.
    pub confidence: Option<f64>,
}

/// What was chosen for a scene.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The scheme.
    pub weighting: Weighting,
    /// The field's scalars that are not at their defaults.
    pub settings: Vec<Setting>,
    /// All that was tried, in that order.
    pub candidates: Vec<Candidate>,
    /// The sources that were left out; empty if there are too few.
    pub left_out: Vec<LeftOutSource>,
    /// What a target's score is expected from; `None` if nothing could be left out.
    pub basis: Option<Basis>,
    measure: Measure,
    poses: Vec<Pose>,
}

impl Chosen {
    /// A target's gap to the sources.
    pub fn gap(&self, frame: &Frame) -> f64 {
        self.measure.gap(&frame.target.camera.pose, self.poses.iter())
    }

    /// The score to expect of a target's picture; `None` if nothing could be left out.
    pub fn expected(&self, frame: &Frame) -> Option<Expected> {
        self.basis.map(|basis| basis.expected(self.gap(frame), mean(&frame.confidences)))
    }
}

/// Chooses for the sources of a stage. Nothing of the stage changes.
///
/// # Errors
/// [`RenderError`].
pub fn choose(
    stage: &Stage<'_>,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Chosen, RenderError> {
    let default = Weighting::default_scheme();
    let coarse = coarse(options, stage);
    let mut trials = Trials::prepare(stage, &default, renderer, &coarse, progress)?;
    let cameras: Vec<_> = stage.images.images.iter().map(|image| image.camera).collect();
    let mut chosen = Chosen {
        weighting: default,
        settings: Vec::new(),
        candidates: Vec::new(),
        left_out: Vec::new(),
        basis: None,
        measure: Measure::of(&cameras),
        poses: cameras.iter().map(|camera| camera.pose).collect(),
    };
    if trials.is_empty() {
        return Ok(chosen);
    }
    let tunables = stage.tunables();
    let others: usize = tunables.iter().map(|tunable| tunable.others.len()).sum();
    progress.expect(trials.len() * (schemes().len() + others));
    let mut search = Search { trials: &mut trials, candidates: Vec::new(), progress };
    let mut best = search.outcomes(&chosen.weighting, &[])?;
    let first = best.clone();
    for weighting in schemes().into_iter().skip(1).map(Weighting::from) {
        let outcomes = search.outcomes(&weighting, &[])?;
        if is_better(&outcomes, &best, &first) {
            (best, chosen.weighting) = (outcomes, weighting);
        }
    }
    for tunable in tunables {
        let (before, kept) = (best.clone(), chosen.settings.clone());
        for &value in tunable.others {
            let mut settings = kept.clone();
            settings.push(Setting { name: tunable.name, value });
            let outcomes = search.outcomes(&chosen.weighting, &settings)?;
            if is_better(&outcomes, &best, &before) {
                (best, chosen.settings) = (outcomes, settings);
            }
        }
    }
    chosen.candidates = search.candidates;
    let side = coarse.size.map_or(SIDE, |[width, height]| width.max(height));
    chosen.basis = Some(Basis::of(&best, detail::lost_detail(&stage.images.images, side)));
    let name = |source: usize| stage.scene().views[stage.views[source]].name.clone();
    chosen.left_out = best
        .iter()
        .map(|&Outcome { source, psnr, gap, confidence }| LeftOutSource { source: name(source), psnr, gap, confidence })
        .collect();
    Ok(chosen)
}

/// What is tried, and what came of it.
struct Search<'t, 'a> {
    trials: &'t mut Trials<'a>,
    candidates: Vec<Candidate>,
    progress: &'t dyn Progress,
}

impl Search<'_, '_> {
    fn outcomes(&mut self, weighting: &Weighting, settings: &[Setting]) -> Result<Vec<Outcome>, RenderError> {
        let outcomes = self.trials.outcomes(weighting, settings, self.progress)?;
        let scores: Vec<f64> = outcomes.iter().map(|outcome| outcome.psnr).collect();
        let psnr = scores.iter().sum::<f64>() / scores.len().max(1) as f64;
        self.candidates.push(Candidate { weighting: weighting.to_string(), settings: settings.to_vec(), psnr, scores });
        Ok(outcomes)
    }
}

/// Whether a candidate beats the best one so far, and the default by more than the noise.
fn is_better(candidate: &[Outcome], best: &[Outcome], default: &[Outcome]) -> bool {
    let (over_best, _) = gain(candidate, best);
    let (over_default, error) = gain(candidate, default);
    over_best > 0.0 && over_default > LEAST_GAIN.max(GAIN_DEVIATIONS * error)
}

/// Mean gain of one over the other, decibels, and its standard error.
fn gain(of: &[Outcome], over: &[Outcome]) -> (f64, f64) {
    let gains: Vec<f64> = of.iter().zip(over).map(|(a, b)| a.psnr - b.psnr).collect();
    let count = gains.len().max(1) as f64;
    let mean = gains.iter().sum::<f64>() / count;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    (mean, (variance / count).sqrt())
}

/// As [`crate::render::render`], with what is chosen for the scene. Each frame comes with the score to expect.
///
/// # Errors
/// [`RenderError`]; those of `deliver` pass through.
pub fn render<X: From<RenderError>>(
    scene: &Scene,
    job: &FewShot,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    progress: &dyn Progress,
    mut deliver: impl FnMut(&SourceImages, Frame, &Chosen) -> Result<(), X>,
) -> Result<(Finished, Chosen), X> {
    let truths = job.targets.iter().filter_map(|target| target.truth);
    let shown = job.sources.iter().copied().chain(truths);
    let album = Album::open(scene, shown, progress).map_err(RenderError::from)?;
    let mut stage = Stage::prepare(scene, &album, &job.sources, renderer, options, progress)?;
    let chosen = choose(&stage, renderer, options, progress)?;
    stage.tune(&chosen.settings);
    stage.weigh(&chosen.weighting, progress)?;
    for target in &job.targets {
        let frame = stage.frame(&chosen.weighting, target, progress)?;
        deliver(&stage.images, frame, &chosen)?;
    }
    Ok((Finished { costs: stage.costs, record: stage.record() }, chosen))
}
