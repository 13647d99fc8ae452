//! How good is each weighting scheme: views are left out of the sources, rendered, and compared with their photographs.

use crate::metrics::{MetricError, Scorer};
use image::RgbImage;
use std::time::{Duration, Instant};
use viewfuse_field::Renderer;
use viewfuse_field::render::{Frame, RenderError, RenderOptions, Stage};
use viewfuse_job::progress::Progress;
use viewfuse_scene::Scene;
use viewfuse_scene::few_shot::{Selection, SelectionError, target_of, view_list};
use viewfuse_scene::photographs::{Album, SourceImages};
use viewfuse_weighting::Weighting;

/// Name of the row that copies the nearest source instead of rendering.
pub const NEAREST_COPY: &str = "nearest copy";

/// Why an evaluation failed.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// The choice of views is no job.
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
    /// A render failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A picture could not be scored.
    #[error(transparent)]
    Metric(#[from] MetricError),
}

/// Name of the peak signal to noise ratio in decibels, of 8-bit values; infinite for equal pictures. Names of metrics are
/// those of [`Scored`](crate::metrics::Scored).
pub const PSNR: &str = "psnr";
/// Name of the structural similarity; pictures that are too small have none.
pub const SSIM: &str = "ssim";

/// The score of one scheme at one target.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// The scheme, or [`NEAREST_COPY`].
    pub scheme: String,
    /// The target view.
    pub target: String,
    /// How many sources there were.
    pub source_count: usize,
    /// Metrics by name, [`PSNR`] first.
    pub values: Vec<(String, f64)>,
    /// Encoding and rendering for this target and scheme; encoding that targets share is divided among them.
    pub time: Duration,
}

impl Score {
    /// A metric by name.
    pub fn value(&self, name: &str) -> Option<f64> {
        self.values.iter().find(|(own, _)| own == name).map(|(_, value)| *value)
    }
}

/// What renders and scores.
pub struct Evaluator<'a> {
    /// The schemes.
    pub weightings: &'a [Weighting],
    /// What makes the pictures.
    pub renderer: &'a dyn Renderer,
    /// How.
    pub options: &'a RenderOptions,
    /// What scores them.
    pub scorer: &'a dyn Scorer,
    /// Where progress and warnings are shown.
    pub progress: &'a dyn Progress,
}

impl Evaluator<'_> {
    /// Scores every scheme on targets that share their sources, after copying the nearest source. `seen` gets each rendered
    /// frame with its scheme, its values and the sources at working size.
    ///
    /// # Errors
    /// [`EvaluateError`].
    pub fn score(
        &self,
        scene: &Scene,
        album: &Album<'_>,
        sources: &[usize],
        targets: &[usize],
        mut seen: impl FnMut(&Weighting, &Frame, &[(String, f64)], &SourceImages),
    ) -> Result<Vec<Score>, EvaluateError> {
        let Evaluator { weightings, renderer, options, scorer, progress } = *self;
        let values = |prediction: &RgbImage, truth: &RgbImage| -> Result<Vec<(String, f64)>, MetricError> {
            let scored = scorer.score(prediction, truth)?;
            Ok(scored.into_iter().map(|scored| (scored.name.to_owned(), scored.value)).collect())
        };
        let score = |scheme: &str, target: usize, values: Vec<(String, f64)>, time: Duration| Score {
            scheme: scheme.to_owned(),
            target: scene.views[target].name.clone(),
            source_count: sources.len(),
            values,
            time,
        };
        let mut stage = Stage::prepare(scene, album, sources, renderer, options, progress)?;
        let mut scores = Vec::new();
        for &target in targets {
            let nearest = nearest_source(scene, sources, target);
            let size = stage.picture_size(target)?;
            let (prediction, truth) = (stage.truth_at(nearest, size)?, stage.truth_at(target, size)?);
            scores.push(score(NEAREST_COPY, target, values(&prediction, &truth)?, Duration::ZERO));
        }
        // Views that a field encodes when a target first needs them: all schemes and targets share that.
        let (first, mut shared) = (scores.len(), Duration::ZERO);
        for weighting in weightings {
            let start = Instant::now();
            stage.weigh(weighting, progress)?;
            let encode_share = start.elapsed() / targets.len().max(1) as u32;
            for &target in targets {
                let frame = stage.frame(weighting, &target_of(scene, target), progress)?;
                if let Some(truth) = &frame.truth {
                    let time = encode_share + frame.time.saturating_sub(frame.encode);
                    shared += frame.encode;
                    let values = values(&frame.picture, &truth.picture)?;
                    seen(weighting, &frame, &values, &stage.images);
                    scores.push(score(&weighting.to_string(), target, values, time));
                }
            }
        }
        let share = shared / (scores.len() - first).max(1) as u32;
        scores[first..].iter_mut().for_each(|score: &mut Score| score.time += share);
        Ok(scores)
    }

    /// Scores every scheme on a scene. Without `--sources`, each target is rendered from all other views (leave one out)
    /// and the targets are all views; with them, the targets are all other views.
    ///
    /// # Errors
    /// [`EvaluateError`].
    pub fn score_all(&self, scene: &Scene, selection: &Selection) -> Result<Vec<Score>, EvaluateError> {
        let groups = source_groups(scene, selection, self.renderer.about().least_sources)?;
        let used = groups.iter().flat_map(|(sources, targets)| sources.iter().chain(targets).copied());
        let album = Album::open(scene, used, self.progress).map_err(RenderError::from)?;
        let mut scores = Vec::new();
        for (sources, targets) in &groups {
            scores.extend(self.score(scene, &album, sources, targets, |_, _, _, _| {})?);
        }
        Ok(scores)
    }
}

/// Sets of sources, each with the targets that are rendered from it.
type SourceGroups = Vec<(Vec<usize>, Vec<usize>)>;

fn source_groups(scene: &Scene, selection: &Selection, least_sources: usize) -> Result<SourceGroups, EvaluateError> {
    let photographed = || (0..scene.views.len()).filter(|&view| scene.views[view].image.is_some());
    let asked = match &selection.targets {
        Some(list) => Some(view_list(scene, list)?),
        None => None,
    };
    if let Some(&view) = asked.iter().flatten().find(|&&view| scene.views[view].image.is_none()) {
        let view = scene.views[view].name.clone();
        return Err(EvaluateError::NoTruth { scene: scene.path.display().to_string(), view });
    }
    if selection.sources.is_some() {
        let excluded = asked.clone().unwrap_or_default();
        let sources = selection.sources_without(scene, &excluded, least_sources)?;
        let targets = asked.unwrap_or_else(|| photographed().filter(|view| !sources.contains(view)).collect());
        if targets.is_empty() {
            return Err(SelectionError::NoTargets { scene: scene.path.display().to_string() }.into());
        }
        return Ok(vec![(sources, targets)]);
    }
    let targets = asked.unwrap_or_else(|| photographed().collect());
    if targets.is_empty() {
        return Err(SelectionError::NoTargets { scene: scene.path.display().to_string() }.into());
    }
    targets
        .into_iter()
        .map(|target| Ok((selection.sources_without(scene, &[target], least_sources)?, vec![target])))
        .collect()
}

/// The source whose centre is nearest to the target's.
fn nearest_source(scene: &Scene, sources: &[usize], target: usize) -> usize {
    let distance = |view: usize| scene.views[view].camera.pose.distance(&scene.views[target].camera.pose);
    sources.iter().copied().min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(target)
}

/// Mean scores of a scheme over targets.
#[derive(Clone, Debug, PartialEq)]
pub struct Mean {
    /// The scheme.
    pub scheme: String,
    /// Mean PSNR in decibels.
    pub psnr: f64,
    /// Mean SSIM over the targets that have one.
    pub ssim: Option<f64>,
    /// Means of the other metrics over the targets that have them, by name.
    pub further: Vec<(String, f64)>,
    /// Mean time.
    pub seconds: f64,
    /// Over how many targets.
    pub target_count: usize,
}

/// Means over targets of every scheme, in the order in which the schemes appear.
pub fn means(scores: &[Score]) -> Vec<Mean> {
    let mut schemes: Vec<&str> = Vec::new();
    for score in scores {
        if !schemes.contains(&score.scheme.as_str()) {
            schemes.push(&score.scheme);
        }
    }
    schemes
        .into_iter()
        .map(|scheme| {
            let own: Vec<&Score> = scores.iter().filter(|score| score.scheme == scheme).collect();
            let count = own.len() as f64;
            let mean_of = |name: &str| {
                let values: Vec<f64> = own.iter().filter_map(|score| score.value(name)).collect();
                (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
            };
            let mut names: Vec<&str> = Vec::new();
            for (name, _) in own.iter().flat_map(|score| &score.values) {
                if ![PSNR, SSIM].contains(&name.as_str()) && !names.contains(&name.as_str()) {
                    names.push(name);
                }
            }
            Mean {
                scheme: scheme.to_owned(),
                psnr: mean_of(PSNR).unwrap_or(f64::NAN),
                ssim: mean_of(SSIM),
                further: names.into_iter().filter_map(|name| Some((name.to_owned(), mean_of(name)?))).collect(),
                seconds: own.iter().map(|score| score.time.as_secs_f64()).sum::<f64>() / count,
                target_count: own.len(),
            }
        })
        .collect()
}
