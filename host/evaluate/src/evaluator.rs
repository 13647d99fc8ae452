//! Scores each weighting scheme: views are held out of the sources, rendered, and compared with their photographs.

use crate::baseline::plane::plane_depth;
use crate::baseline::{BLENDED, Baseline, Shot};
use crate::metrics::masked::MaskedTruth;
use crate::metrics::{MetricError, Scorer};
use crate::score_json::{seconds, values};
use image::{GrayImage, RgbImage};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::time::{Duration, Instant};
use viewfuse_core::camera::Camera;
use viewfuse_field::Renderer;
use viewfuse_field::auto::choose;
use viewfuse_field::budget::Kept;
use viewfuse_field::held_out::nearest;
use viewfuse_field::render::{Frame, RenderError, RenderOptions, Stage, open_album};
use viewfuse_field::scores::shows_anything;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::progress::{Part, Progress};
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{Selection, SelectionError, SelectionFault, target_of, view_list};
use viewfuse_scene::photographs::{Album, GroundTruth, PhotographsError, SourceImages};
use viewfuse_weighting::OpenedChoice;

/// Why an evaluation failed.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// The selection of views is invalid.
    #[error(transparent)]
    Selection(#[from] SelectionError),
    /// A target has no photograph to compare with.
    #[error("{scene}: view '{view}' has no photograph to compare with")]
    NoTruth {
        /// The scene's path.
        scene: String,
        /// The view.
        view: String,
    },
    /// All photographs are sources, or there are none.
    #[error("{0}: no photograph is left to compare with: a source is never a target")]
    NothingLeft(String),
    /// Of no target's photograph anything counts.
    #[error(
        "{0}: nothing can be scored: of the photographs of the targets nothing counts, as their masks or alpha \
        channels say"
    )]
    NothingCounts(String),
    /// A render failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A picture could not be scored.
    #[error(transparent)]
    Metric(#[from] MetricError),
}

impl Hinted for EvaluateError {
    fn hint(&self) -> Option<Hint> {
        match self {
            EvaluateError::Selection(error) => error.hint(),
            EvaluateError::Render(error) => error.hint(),
            _ => None,
        }
    }
}

/// Name of the peak signal to noise ratio in decibels, of 8-bit values; infinite for equal pictures. Names of metrics
/// are those of [`Scored`](crate::metrics::Scored).
pub const PSNR: &str = "psnr";
/// Name of the peak signal to noise ratio of corrected colours
/// ([`corrected_psnr_of_seen`](viewfuse_field::scores::corrected_psnr_of_seen)).
pub const PSNR_CORRECTED: &str = "psnr-corrected";
/// Name of the structural similarity; pictures that are too small have none.
pub const SSIM: &str = "ssim";

/// The score of one scheme at one target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Score {
    /// The scheme, or the name of a [`Baseline`].
    pub scheme: String,
    /// The target view.
    pub target: String,
    /// Number of sources.
    pub source_count: usize,
    /// Seconds for encoding and rendering this target with this scheme; encoding that targets share is divided among
    /// them.
    #[serde(rename = "seconds", with = "seconds")]
    pub time: Duration,
    /// Metrics by name, [`PSNR`] first.
    #[serde(with = "values")]
    pub values: Vec<(String, f64)>,
}

impl Score {
    /// A metric by name.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.values.iter().find(|(known, _)| known == name).map(|(_, value)| *value)
    }
}

/// What is evaluated.
#[derive(Clone, Copy)]
pub struct Subject<'a> {
    /// The scene as fields see it.
    pub scene: &'a Scene,
    /// Its photographs.
    pub album: &'a Album<'a>,
    /// The scene with the masks that targets are scored by as well ([`crate::metrics::masked`]); `None` without masked
    /// metrics. Its views are those of `scene`.
    pub masked: Option<&'a Scene>,
}

/// What renders and scores.
pub struct Evaluator<'a> {
    /// The schemes. [`OpenedChoice::Auto`] chooses a scheme and the field's scalars for each set of sources, from these
    /// sources alone.
    pub weightings: &'a [OpenedChoice],
    /// What makes the pictures.
    pub renderer: &'a dyn Renderer,
    /// How.
    pub options: &'a RenderOptions,
    /// What scores them.
    pub scorer: &'a dyn Scorer,
    /// Where progress and warnings are shown.
    pub progress: &'a dyn Progress,
}

/// The time of a set of sources, in times of reading the photographs: for the progress that is shown.
const READINGS_A_GROUP: usize = 20;

/// The masks of targets, by the index of the view.
type Masks = HashMap<usize, Option<MaskedTruth>>;

impl Evaluator<'_> {
    /// Scores the baselines and then every scheme on targets that share their sources, but for targets of whose
    /// photographs nothing counts, which are named in a warning. `seen` gets each rendered frame with its scheme's
    /// name, its values and the sources at working size.
    ///
    /// # Errors
    /// [`EvaluateError`].
    pub fn score(
        &self,
        subject: Subject<'_>,
        sources: &[usize],
        targets: &[usize],
        mut seen: impl FnMut(&str, &Frame, &[(String, f64)], &SourceImages),
    ) -> Result<Vec<Score>, EvaluateError> {
        let Evaluator { weightings, renderer, options, progress, .. } = *self;
        let Subject { scene, album, .. } = subject;
        let score = |scheme: &str, target: usize, values: Vec<(String, f64)>, time: Duration| Score {
            scheme: scheme.to_owned(),
            target: scene.views[target].name.clone(),
            source_count: sources.len(),
            values,
            time,
        };
        let of_a_scheme = 1 + targets.len();
        let stage_count = 1 + weightings.len() * of_a_scheme;
        progress.stage("reading the sources", 0..1, stage_count);
        let mut stage = Stage::prepare(scene, album, sources, renderer, options, progress)?;
        let (mut scores, masks) = self.baseline_scores(&subject, &stage, sources, targets, score)?;
        let targets: Vec<usize> = targets.iter().copied().filter(|target| masks.contains_key(target)).collect();
        if targets.is_empty() {
            return Ok(scores);
        }
        // Views that a field encodes when a target first needs them: all schemes and targets share that.
        let (first, mut shared) = (scores.len(), Duration::ZERO);
        for (index, row) in weightings.iter().enumerate() {
            let name = row.to_string();
            let place = 1 + index * of_a_scheme;
            let start = Instant::now();
            progress.stage(&format!("{name}, encoding the sources"), place..place + 1, stage_count);
            let weighting = &match row {
                OpenedChoice::Given(weighting) => weighting.clone(),
                OpenedChoice::Auto => {
                    let chosen = choose(&stage, renderer, options, progress)?;
                    stage.vary(Some(&chosen.options), chosen.mixture.as_ref(), progress)?;
                    chosen.weighting
                }
            };
            stage.weigh(weighting, progress)?;
            // Choosing is a part of it.
            let encode_share = start.elapsed() / targets.len().max(1) as u32;
            let mut bounded = Vec::new();
            for (index, &target) in targets.iter().enumerate() {
                let (view, place) = (&scene.views[target].name, place + 1 + index);
                progress.stage(&format!("{name}, view {view}"), place..place + 1, stage_count);
                let frame = stage.frame(weighting, &target_of(scene, target), progress)?;
                bounded.extend(frame.kept.clone());
                if let Some(truth) = &frame.truth {
                    let time = encode_share + frame.time.saturating_sub(frame.encode);
                    shared += frame.encode;
                    let mask = masks.get(&target).and_then(Option::as_ref);
                    let values = self.values(&frame.picture, &truth.picture, truth.seen.as_ref(), mask)?;
                    seen(&name, &frame, &values, &stage.images);
                    scores.push(score(&name, target, values, time));
                }
            }
            kept_in_words(&bounded).iter().for_each(|words| progress.note(&format!("{name}: {words}")));
            stage.vary(options.field.as_ref(), options.mixture.as_ref(), progress)?;
        }
        let share = shared / (scores.len() - first).max(1) as u32;
        scores[first..].iter_mut().for_each(|score: &mut Score| score.time += share);
        Ok(scores)
    }

    /// Scores the baselines, and reads the masks of the targets: there is an entry of each that can be scored.
    fn baseline_scores(
        &self,
        subject: &Subject<'_>,
        stage: &Stage<'_>,
        sources: &[usize],
        targets: &[usize],
        score: impl Fn(&str, usize, Vec<(String, f64)>, Duration) -> Score,
    ) -> Result<(Vec<Score>, Masks), EvaluateError> {
        let Subject { scene, .. } = *subject;
        let (mut scores, mut masks, mut shots) = (Vec::new(), HashMap::new(), HashMap::new());
        for &target in targets {
            self.progress.check().map_err(PhotographsError::from).map_err(RenderError::from)?;
            let ((camera, truth), mask) = (shown_at(*subject, stage, target)?, self.mask(*subject, stage, target)?);
            if !shows_anything(truth.seen.as_ref()) {
                self.progress.warn(&format!(
                    "'{}' is not scored: of its photograph nothing counts, as its mask or its alpha channel says",
                    scene.views[target].name
                ));
                continue;
            }
            let pose = &scene.views[target].camera.pose;
            let distance = |source: usize| scene.views[source].camera.pose.distance(pose);
            let nearest = nearest(sources.iter().copied(), distance, BLENDED);
            for &source in &nearest {
                if let Entry::Vacant(place) = shots.entry(source) {
                    let (camera, GroundTruth { picture, .. }) = shown_at(*subject, stage, source)?;
                    place.insert(Shot { camera, picture });
                }
            }
            let nearest: Vec<&Shot> = nearest.iter().filter_map(|source| shots.get(source)).collect();
            let depth = depth_of(scene, target);
            for baseline in Baseline::ALL {
                let start = Instant::now();
                let picture = baseline.picture(&nearest, &camera, depth);
                let time = start.elapsed();
                let values = self.values(&picture, &truth.picture, truth.seen.as_ref(), mask.as_ref())?;
                scores.push(score(baseline.name(), target, values, time));
            }
            masks.insert(target, mask);
        }
        Ok((scores, masks))
    }

    /// Every metric of a picture, the masked ones last.
    fn values(
        &self,
        prediction: &RgbImage,
        truth: &RgbImage,
        seen: Option<&GrayImage>,
        mask: Option<&MaskedTruth>,
    ) -> Result<Vec<(String, f64)>, MetricError> {
        let scored = self.scorer.score(prediction, truth, seen)?;
        let mut values: Vec<(String, f64)> =
            scored.into_iter().map(|scored| (scored.name.to_owned(), scored.value)).collect();
        values.extend(mask.into_iter().flat_map(|mask| mask.score(prediction)));
        Ok(values)
    }

    /// The truth of a target with its mask, if masked metrics are requested and it has a mask.
    fn mask(
        &self,
        subject: Subject<'_>,
        stage: &Stage<'_>,
        target: usize,
    ) -> Result<Option<MaskedTruth>, EvaluateError> {
        let Some(masked) = subject.masked else { return Ok(None) };
        let album = open_album(masked, [target], self.renderer, self.options, self.progress)?;
        let size = stage.size_at(&subject.scene.views[target].camera)?;
        let over = |level: f32| album.truth(target, size, Some([level; 3])).map_err(RenderError::from);
        Ok(MaskedTruth::of(over(1.0)?, &over(0.0)?))
    }

    /// Scores every scheme on a scene. Without `--sources`, each target is rendered from all other views (leave one
    /// out) and the targets are all views; with them, the targets are all other views.
    ///
    /// # Errors
    /// [`EvaluateError`].
    pub fn score_all(&self, scene: &Scene, selection: &Selection) -> Result<Vec<Score>, EvaluateError> {
        let groups = source_groups(scene, selection, self.renderer.about().least_sources)?;
        let used = groups.iter().flat_map(|(sources, targets)| sources.iter().chain(targets).copied());
        // Reading takes far less than what follows.
        let parts = 1 + READINGS_A_GROUP * groups.len();
        self.progress.stage("reading photographs", 0..1, parts);
        let album = open_album(scene, used, self.renderer, self.options, self.progress)?;
        let mut scores = Vec::new();
        for (index, (sources, targets)) in groups.iter().enumerate() {
            let subject = Subject { scene, album: &album, masked: None };
            let place = 1 + READINGS_A_GROUP * index;
            let progress = &Part::begin(self.progress, "", place..place + READINGS_A_GROUP, parts);
            let part = Evaluator { progress, ..*self };
            scores.extend(part.score(subject, sources, targets, |_, _, _, _| {})?);
        }
        if scores.is_empty() {
            return Err(EvaluateError::NothingCounts(scene.path.display().to_string()));
        }
        Ok(scores)
    }
}

/// How pictures keep a bound: how many do, and with which efforts; `None` without a bound.
fn kept_in_words(pictures: &[Kept]) -> Option<String> {
    let kept = pictures.iter().filter(|picture| picture.is_kept).count();
    let mut efforts: Vec<(&str, usize)> = Vec::new();
    for Kept { effort, .. } in pictures {
        match efforts.iter_mut().find(|(known, _)| known == effort) {
            Some((_, count)) => *count += 1,
            None => efforts.push((effort, 1)),
        }
    }
    let efforts: Vec<String> = efforts.iter().map(|(effort, count)| format!("{count} with {effort}")).collect();
    let words = || format!("the bound is kept by {kept} of {} pictures: {}", pictures.len(), efforts.join("; "));
    (!pictures.is_empty()).then(words)
}

/// Checks that [`Evaluator::score_all`] can choose the sources and targets of a scene.
///
/// # Errors
/// [`EvaluateError`], as that gives it.
pub fn check_selection(scene: &Scene, selection: &Selection, least_sources: usize) -> Result<(), EvaluateError> {
    source_groups(scene, selection, least_sources).map(drop)
}

/// Sets of sources, each with the targets that are rendered from it.
type SourceGroups = Vec<(Vec<usize>, Vec<usize>)>;

fn source_groups(scene: &Scene, selection: &Selection, least_sources: usize) -> Result<SourceGroups, EvaluateError> {
    let photographed = || (0..scene.views.len()).filter(|&view| scene.views[view].image.is_some());
    let requested = match &selection.targets {
        Some(list) => Some(view_list(scene, list)?),
        None => None,
    };
    if let Some(&view) = requested.iter().flatten().find(|&&view| scene.views[view].image.is_none()) {
        let view = scene.views[view].name.clone();
        return Err(EvaluateError::NoTruth { scene: scene.path.display().to_string(), view });
    }
    let no_targets = || -> EvaluateError {
        match &selection.targets {
            Some(_) => SelectionFault::NoTargets.in_scene(scene).into(),
            None => EvaluateError::NothingLeft(scene.path.display().to_string()),
        }
    };
    if selection.sources.is_some() {
        let excluded = requested.clone().unwrap_or_default();
        let sources = selection.sources_without(scene, &excluded, least_sources)?;
        let targets = requested.unwrap_or_else(|| photographed().filter(|view| !sources.contains(view)).collect());
        return if targets.is_empty() { Err(no_targets()) } else { Ok(vec![(sources, targets)]) };
    }
    let targets = requested.unwrap_or_else(|| photographed().collect());
    if targets.is_empty() {
        return Err(no_targets());
    }
    targets
        .into_iter()
        .map(|target| Ok((selection.sources_without(scene, &[target], least_sources)?, vec![target])))
        .collect()
}

/// A view's photograph at working size over the run's background, and the camera of these pixels.
fn shown_at(
    Subject { scene, album, .. }: Subject<'_>,
    stage: &Stage<'_>,
    view: usize,
) -> Result<(Camera, GroundTruth), EvaluateError> {
    let camera = stage.at_working_size(&scene.views[view].camera)?;
    let size = [camera.pinhole.width(), camera.pinhole.height()];
    Ok((camera, album.truth(view, size, stage.background()).map_err(RenderError::from)?))
}

/// The depth of the plane that a target's baselines are warped by.
fn depth_of(scene: &Scene, target: usize) -> f64 {
    let cameras: Vec<Camera> = scene.views.iter().map(|view| view.camera).collect();
    let points = scene.points.iter().map(|point| point.position_world);
    plane_depth(&cameras[target], points, scene.views[target].near_far, &cameras)
}
