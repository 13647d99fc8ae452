//! Chooses the weighting scheme and the field's options for a scene, and estimates the expected score, from the sources
//! alone: some of them are held out, one at a time, and rendered coarsely from the others.
//!
//! ```text
//! held_out      sources rendered from the others
//! kept          their pictures, kept between runs
//! regions       the mixture of pictures under several settings
//! gain          whether a candidate is better than another on the held-out sources
//! calibration   the errors that pixels of a confidence have
//! detail        the detail that coarse pictures lack
//! expectation   from these scores to a target's
//! pair          what two sources are good for
//! ```
//!
//! The choice is a coordinate search: the scheme first, then each step of the field's candidates. All candidates are
//! rendered from one encoding, under the first scheme. A candidate replaces the current choice only if its gain exceeds
//! the noise; of an object with silhouettes, a scheme also where a held-out source is nearest to the others, and
//! if no mixture under the first scheme gains. At last, pictures under several settings are mixed by region, where that
//! is not worse. With too few sources to hold one out, everything stays at its default.

mod calibration;
mod detail;
mod expectation;
mod gain;
mod held_out;
mod kept;
mod pair;
mod regions;

pub use calibration::{Calibration, Group};
pub use expectation::{Basis, Beyond, Expected, PixelErrors, TERMS};
pub use held_out::HOLD_OUT;
pub use pair::{Measured, Pair};

use crate::budget::Estimate;
use crate::held_out::nearest;
use crate::mixture::NearTargets;
use crate::render::{Finished, Frame, RenderError, RenderOptions, RenderRun, Stage, render_chosen};
use crate::standing::Measure;
pub use crate::standing::Standing;
use crate::{AnyOptions, Mixture, Renderer, Setting, Variant};
use expectation::decibels;
use gain::{fewest_to_lose, is_better, is_better_near, is_lost, is_worth_mixing, mean_score, median_gain};
use held_out::{HeldOutSources, Outcome, coarse, coarse_side};
use regions::Mixed;
use serde::Serialize;
use std::ops::Range;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::{Formula, Scheme};
use viewfuse_job::progress::Progress;
use viewfuse_scene::photographs::SourceImages;
use viewfuse_weighting::Weighting;

/// The schemes that are tried. The first is the baseline of the others: on held-out sources, the inverse square of the
/// distance was best on average.
pub fn schemes() -> Vec<Scheme> {
    let scheme = |formula, choice, parameter| Scheme::new(formula, choice, parameter).ok();
    let first = [scheme(Formula::Distance, 2, 0.0), scheme(Formula::Distance, 3, 0.0), scheme(Formula::Error, 0, 0.5)];
    let plain = [Scheme::ERROR, Scheme::MEAN, Scheme::L1, Scheme::of(Formula::Gaussian)];
    first.into_iter().flatten().chain(plain).collect()
}

/// The scheme that is taken where none is tried: the first one.
pub fn usual() -> Weighting {
    schemes().into_iter().next().map_or_else(Weighting::default_scheme, Weighting::from)
}

/// The number of the scheme, from 0, that stands for those after it: where it loses to the first one by more than half
/// of [`MIN_GAIN`] in the median, they are not tried (`host/results/speed.md`).
const LEADER: usize = 2;

/// Least significant gain, decibels (`host/results/training_free.md`, "What auto chooses and expects"); see also
/// [`is_better`].
const MIN_GAIN: f64 = 0.1;

/// A mixture is taken unless its score on held-out sources is lower than that of the best single picture by more than
/// this, decibels (`host/results/front_to_back.md`, "Mixtures by region").
const MAX_LOSS: f64 = 0.05;
/// Decibels by which pictures of held-out sources are better than copies of the nearest ones at the least, where poses
/// are right: nine scenes gain 5.6 to 12.4; with poses that were mirrored, inverted, of other quaternions
/// or of the next photograph -1.7 to 1.9.
const MIN_GAIN_ON_COPIES: f64 = 2.5;
/// The name in the settings of [`Candidate::options`] of the number of pictures that are mixed.
const MIXED: &str = "mixed pictures";

/// A scheme and settings that were tried.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// The scheme.
    pub weighting: String,
    /// The field's options, in a record their scalars that are not at their defaults.
    #[serde(rename = "settings")]
    pub options: AnyOptions,
    /// What is mixed, in a few words; null for one picture.
    pub mixture: Option<String>,
    /// Mean score of the held-out sources, decibels; null if it was given up before the last of them.
    pub psnr: Option<f64>,
    /// The score of each; of the first ones alone where so many of these do not gain that the median cannot.
    pub scores: Vec<f64>,
}

/// A held-out source, with what was chosen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOutSource {
    /// Its name.
    pub source: String,
    /// Its score, decibels.
    pub psnr: f64,
    /// The score of a copy of the nearest other source.
    pub copy_psnr: f64,
    /// Its geometry among the others.
    pub standing: Standing,
    /// Mean confidence of its pixels; null for fields that do not estimate it.
    pub confidence: Option<f64>,
}

/// What was chosen for a scene.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// The scheme.
    pub weighting: Weighting,
    /// The field's options.
    pub options: AnyOptions,
    /// Pictures under other settings that are mixed in place of one under these; `None` if that is worse.
    pub mixture: Option<Mixture>,
    /// All candidates, in the order in which they were tried.
    pub candidates: Vec<Candidate>,
    /// The held-out sources; empty if there are too few.
    pub held_out: Vec<HeldOutSource>,
    /// The data for a target's expected score; `None` if nothing could be held out.
    pub basis: Option<Basis>,
    /// The errors that pixels of a confidence have; `None` if nothing could be held out, and for fields without
    /// confidences.
    pub calibration: Option<Calibration>,
    /// What two sources are good for of which none could be held out; `None` otherwise, and where nothing was measured.
    pub pair: Option<Pair>,
    measure: Measure,
    poses: Vec<Pose>,
}

impl Chosen {
    /// The geometry of a target among the sources.
    pub fn standing(&self, frame: &Frame) -> Standing {
        self.measure.standing(&frame.target.camera.pose, self.poses.iter())
    }

    /// A warning if the held-out sources are hardly better than copies of the nearest other ones.
    fn copy_warning(&self) -> Option<String> {
        let count = self.held_out.len().max(1) as f64;
        let mean = |value: fn(&HeldOutSource) -> f64| self.held_out.iter().map(value).sum::<f64>() / count;
        let (psnr, copy) = (mean(|source| source.psnr), mean(|source| source.copy_psnr));
        let conclusion = match psnr - copy {
            ..0.0 => {
                "pictures may be worse than a copy; take photographs nearer to one another, and check the camera poses"
            }
            ..MIN_GAIN_ON_COPIES => {
                "the camera poses are not those of these photographs (mirrored, inverted, of another order), or the \
                 photographs are too far from one another, or many of them are there twice"
            }
            _ => return None,
        };
        Some(format!(
            "sources that were held out and rendered from the others have a PSNR of {psnr:.1} dB, copies of the nearest \
             photographs {copy:.1} dB: {conclusion}"
        ))
    }

    /// The expected score of a picture in the middle between two neighbouring sources: the mean over all sources, each
    /// with the one nearest to it. `None` if nothing could be held out.
    pub fn expected_between(&self) -> Option<Expected> {
        let basis = self.basis?;
        let middles: Vec<Pose> = (0..self.poses.len()).filter_map(|source| self.middle(source)).collect();
        let standings = middles.iter().map(|pose| self.measure.standing(pose, self.poses.iter()));
        let all: Vec<Expected> = standings.map(|standing| basis.expected(standing, basis.calibrated, None)).collect();
        let mean = |value: &dyn Fn(&Expected) -> f64| all.iter().map(value).sum::<f64>() / all.len() as f64;
        let interval = [0, 1].map(|end| mean(&|between: &Expected| between.interval[end]));
        (!all.is_empty()).then(|| Expected { psnr: mean(&|between| between.psnr), interval, pixels: None })
    }

    /// The pose half-way between a source and the one nearest to it.
    fn middle(&self, source: usize) -> Option<Pose> {
        let pose = &self.poses[source];
        let others = (0..self.poses.len()).filter(|other| *other != source);
        let neighbour = nearest(others, |other| self.poses[other].distance(pose), 1);
        let other = &self.poses[*neighbour.first()?];
        let centre = 0.5 * (pose.centre_world() + other.centre_world());
        let ahead = pose.forward_world() + other.forward_world();
        Pose::look_at(centre, centre + ahead, -(pose.down_world() + other.down_world())).ok()
    }

    /// The score of a picture by the calibration of its confidences, decibels; `None` without one.
    pub fn calibrated(&self, frame: &Frame) -> Option<f64> {
        self.calibration.as_ref()?.mean_square(frame.confidences.iter().copied()).map(decibels)
    }

    /// Why no score is expected of a target's picture although sources were held out; `None` if one is.
    pub fn beyond(&self, frame: &Frame) -> Option<Beyond> {
        self.basis?.beyond(self.standing(frame), frame.seen)
    }

    /// The expected score of a target's picture; `None` if nothing could be held out, [`beyond`](Self::beyond) what is
    /// known, and of a picture that a bound keeps from being exact with an error that nobody knows: held-out sources
    /// were rendered exactly.
    pub fn expected(&self, frame: &Frame) -> Option<Expected> {
        if self.beyond(frame).is_some() {
            return None;
        }
        let error = frame.kept.as_ref().map_or(Some(Estimate::EXACT), |kept| kept.error)?;
        let calibrated = self.calibrated(frame);
        let expected = self.basis?.expected(self.standing(frame), calibrated, frame.seen).with_error(&error);
        let scale = |calibrated: f64| 10.0_f64.powf((calibrated - expected.psnr) / 20.0) as f32;
        let pixels = calibrated.map(|calibrated| PixelErrors { scale: scale(calibrated) });
        Some(Expected { pixels, ..expected })
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
    choose_of(schemes(), true, stage, renderer, options, progress)
}

/// As [`choose`] without a choice: the baseline alone is tried. For the scores of the held-out sources, in a
/// part of the time.
///
/// # Errors
/// [`RenderError`].
pub fn estimate(
    stage: &Stage<'_>,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Chosen, RenderError> {
    choose_of(schemes().into_iter().take(1).collect(), false, stage, renderer, options, progress)
}

fn choose_of(
    schemes: Vec<Scheme>,
    varies: bool,
    stage: &Stage<'_>,
    renderer: &dyn Renderer,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Chosen, RenderError> {
    let mut schemes = schemes.into_iter().map(Weighting::from);
    let first = schemes.next().unwrap_or_else(Weighting::default_scheme);
    let coarse = coarse(options, stage);
    let mut held_out = HeldOutSources::prepare(stage, &first, renderer, &coarse, progress)?;
    let cameras: Vec<_> = stage.images.images.iter().map(|image| image.camera).collect();
    let mut chosen = Chosen {
        weighting: Weighting::default_scheme(),
        options: renderer.options(),
        mixture: None,
        candidates: Vec::new(),
        held_out: Vec::new(),
        basis: None,
        calibration: None,
        pair: None,
        measure: Measure::of(&cameras),
        poses: cameras.iter().map(|camera| camera.pose).collect(),
    };
    if held_out.is_empty() {
        chosen.pair = Pair::of(renderer.about().name, &cameras, stage.images.has_silhouettes);
        return Ok(chosen);
    }
    chosen.weighting = first;
    let candidates = |chosen: &AnyOptions, step: usize| {
        if varies { stage.session.prepared.candidates(chosen, step) } else { Vec::new() }
    };
    let others: usize = (0..).map(|step| candidates(&chosen.options, step).len()).take_while(|count| *count > 0).sum();
    progress.expect(held_out.len() * (1 + schemes.len() + others));
    let mut search = Search { held_out: &mut held_out, candidates: Vec::new(), progress };
    let mut best = search.outcomes(&chosen.weighting, &chosen.options, &[])?;
    let has_silhouettes = stage.images.has_silhouettes;
    let mixtures = |chosen: &AnyOptions| if varies { stage.session.prepared.mixtures(chosen) } else { Vec::new() };
    // What another scheme gains on an object's held-out sources may be lost on its targets, which are nearer to their
    // sources, and a mixture gains more than a scheme does: others are tried only where no mixture gains.
    let mut mixed = None;
    if has_silhouettes {
        let (weighting, options) = (&chosen.weighting, &chosen.options);
        mixed = search.mixed(weighting, options, mixtures(options), &best, has_silhouettes)?;
    }
    if mixed.is_none() {
        let better = search.scheme(schemes, &chosen.options, &best, has_silhouettes)?;
        let is_tried = has_silhouettes && better.is_none();
        if let Some((outcomes, weighting)) = better {
            (best, chosen.weighting) = (outcomes, weighting);
        }
        for step in 0.. {
            let (before, others) = (best.clone(), candidates(&chosen.options, step));
            if others.is_empty() {
                break;
            }
            let all = search.outcomes_of(&chosen.weighting, &others, &before)?;
            for (options, outcomes) in others.into_iter().zip(all) {
                if is_better(&outcomes, &best, &before) {
                    (best, chosen.options) = (outcomes, options);
                }
            }
        }
        if !is_tried {
            let (weighting, options) = (&chosen.weighting, &chosen.options);
            mixed = search.mixed(weighting, options, mixtures(options), &best, has_silhouettes)?;
        }
    }
    if let Some(Mixed { mixture, outcomes, last_at_nearest, .. }) = mixed {
        // Gaussians that are too soft near the sources: a share of the hull's picture stays there.
        let is_soft = has_silhouettes && best[search.held_out.nearest()].psnr > last_at_nearest;
        let near = is_soft.then(|| NearTargets::of(chosen.measure, chosen.poses.clone()));
        (best, chosen.mixture) = (outcomes, Some(Mixture { near, ..mixture }));
    }
    chosen.candidates = search.candidates;
    chosen.calibration = Calibration::of(best.iter().flat_map(|outcome| outcome.samples.iter().copied()).collect());
    let detail = detail::lost_detail(&stage.images.images, coarse_side(&coarse));
    chosen.basis = Some(Basis::of(&best, chosen.calibration.as_ref(), detail, has_silhouettes));
    chosen.held_out = scored(&best, &held_out);
    held_out.keep(progress);
    if let (Some(warning), Some(of)) = (chosen.copy_warning(), stage.scene()) {
        progress.warn(&format!("{}: {warning}", of.scene.path.display()));
    }
    Ok(chosen)
}

/// The held-out sources with their results.
fn scored(outcomes: &[Outcome], held_out: &HeldOutSources<'_>) -> Vec<HeldOutSource> {
    let scored = |(&Outcome { psnr, standing, confidence, copy, .. }, source): (&Outcome, &str)| HeldOutSource {
        source: source.to_owned(),
        psnr,
        copy_psnr: copy,
        standing,
        confidence,
    };
    outcomes.iter().zip(held_out.names()).map(scored).collect()
}

/// The candidates and their results.
struct Search<'s, 'a> {
    held_out: &'s mut HeldOutSources<'a>,
    candidates: Vec<Candidate>,
    progress: &'s dyn Progress,
}

impl Search<'_, '_> {
    /// The results of a candidate on the held-out sources: [`Search::outcomes_of`].
    fn outcomes(
        &mut self,
        weighting: &Weighting,
        options: &AnyOptions,
        replaced: &[Outcome],
    ) -> Result<Vec<Outcome>, RenderError> {
        Ok(self.outcomes_of(weighting, std::slice::from_ref(options), replaced)?.remove(0))
    }

    /// The results of candidates on the held-out sources, of each up to the one that decides that it is not better than
    /// what all of them would replace: see [`is_lost`].
    fn outcomes_of(
        &mut self,
        weighting: &Weighting,
        options: &[AnyOptions],
        replaced: &[Outcome],
    ) -> Result<Vec<Vec<Outcome>>, RenderError> {
        let count = self.held_out.len();
        let mut all = vec![Vec::new(); options.len()];
        loop {
            // The fewest that can decide against each of them; all are waited for together.
            let next = |(number, outcomes): (usize, &Vec<Outcome>)| {
                let is_decided = outcomes.len() == count || is_lost(outcomes, replaced);
                let more = if replaced.is_empty() { count } else { fewest_to_lose(outcomes, replaced) };
                (!is_decided).then(|| (number, outcomes.len()..count.min(outcomes.len() + more)))
            };
            let next: Vec<(usize, Range<usize>)> = all.iter().enumerate().filter_map(next).collect();
            if next.is_empty() {
                break;
            }
            let asked: Vec<_> = next.iter().map(|(number, which)| (which.clone(), &options[*number])).collect();
            let outcomes = self.held_out.outcomes(weighting, &asked, self.progress)?;
            next.iter().zip(outcomes).for_each(|((number, _), more)| all[*number].extend(more));
        }
        for (options, outcomes) in options.iter().zip(&all) {
            (outcomes.len()..count).for_each(|_| self.progress.step());
            let scores: Vec<f64> = outcomes.iter().map(|outcome| outcome.psnr).collect();
            let psnr = (outcomes.len() == count).then(|| mean_score(outcomes));
            let (weighting, options) = (weighting.to_string(), options.clone());
            self.candidates.push(Candidate { weighting, options, mixture: None, psnr, scores });
        }
        Ok(all)
    }

    /// The scheme that is better than the first one, with its results, if one is.
    fn scheme(
        &mut self,
        schemes: impl Iterator<Item = Weighting>,
        options: &AnyOptions,
        first: &[Outcome],
        has_silhouettes: bool,
    ) -> Result<Option<(Vec<Outcome>, Weighting)>, RenderError> {
        let mut best: Option<(Vec<Outcome>, Weighting)> = None;
        let mut has_lost = false;
        for (number, weighting) in (1..).zip(schemes) {
            if has_lost {
                (0..self.held_out.len()).for_each(|_| self.progress.step());
                continue;
            }
            let outcomes = self.outcomes(&weighting, options, first)?;
            has_lost = number == LEADER && median_gain(&outcomes, first) < -0.5 * MIN_GAIN;
            let before = best.as_ref().map_or(first, |(outcomes, _)| outcomes);
            let is_for_targets = !has_silhouettes || is_better_near(&outcomes, first);
            if is_better(&outcomes, before, first) && is_for_targets {
                best = Some((outcomes, weighting));
            }
        }
        Ok(best)
    }

    /// The best of these mixtures, if it is worth mixing in place of one picture.
    fn mixed(
        &mut self,
        weighting: &Weighting,
        chosen: &AnyOptions,
        mixtures: Vec<Variant<Vec<AnyOptions>>>,
        single: &[Outcome],
        has_silhouettes: bool,
    ) -> Result<Option<Mixed>, RenderError> {
        let mut mixed = regions::mixed(self.held_out, weighting, mixtures, single, self.progress)?;
        for Mixed { label, mixture, outcomes, .. } in &mixed {
            let options = chosen.also_stating(Setting { name: MIXED, value: mixture.parts.len() as f32 });
            let scores = outcomes.iter().map(|outcome| outcome.psnr).collect();
            let (weighting, mixture, psnr) = (weighting.to_string(), Some(label.clone()), Some(mean_score(outcomes)));
            self.candidates.push(Candidate { weighting, options, mixture, psnr, scores });
        }
        Ok(mixed.pop().filter(|best| is_worth_mixing(&best.outcomes, single, has_silhouettes)))
    }
}

/// As [`crate::render::render`]; without a weighting, under what is chosen for the scene, which `deliver` gets with
/// each frame: it knows the frame's expected score.
///
/// # Errors
/// [`RenderError`]; those of `deliver` pass through.
pub fn render<X: From<RenderError>>(
    run: &RenderRun<'_>,
    weighting: Option<&Weighting>,
    mut deliver: impl FnMut(&SourceImages, Frame, Option<&Chosen>) -> Result<(), X>,
) -> Result<(Finished, Option<Chosen>), X> {
    let choose = |stage: &mut Stage<'_>| {
        if let Some(given) = weighting {
            return Ok((given.clone(), None));
        }
        let chosen = choose(stage, run.renderer, run.options, run.progress)?;
        stage.vary(Some(&chosen.options), chosen.mixture.as_ref(), run.progress)?;
        Ok((chosen.weighting.clone(), Some(chosen)))
    };
    render_chosen(run, choose, |images: &SourceImages, frame: Frame, chosen: &Option<Chosen>| {
        deliver(images, frame, chosen.as_ref())
    })
}
