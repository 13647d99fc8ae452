//! Schemes on held-out views, with the defaults of the command.

use crate::error::Failure;
use crate::given_weights::{GivenWeights, Raised, UntilRaised};
use crate::request::{Pictures, device};
use pyo3::prelude::*;
use std::time::Duration;
use viewfuse::device::choice::AnyDevice;
use viewfuse::evaluate::baseline::Baseline;
use viewfuse::evaluate::metrics::{Metrics, Scorer};
use viewfuse::evaluate::{Evaluator, PSNR, PSNR_CORRECTED, SSIM, Score};
use viewfuse::job::progress::Progress;
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::Selection;
use viewfuse::weighting::{OpenedChoice, WeightingChoice, scheme_names};

/// The score of one scheme at one view.
#[pyclass(name = "Score", module = "viewfuse", frozen, get_all)]
pub(crate) struct PyScore {
    /// The scheme, or the name of a baseline.
    scheme: String,
    /// Whether it is a baseline, which needs no field: copies and warps of the nearest sources.
    is_baseline: bool,
    /// The view's name.
    target: String,
    /// Number of sources.
    source_count: usize,
    /// Peak signal to noise ratio, decibels.
    psnr: f64,
    /// The same after a gain and an offset of each channel were fitted to the photograph.
    corrected_psnr: Option<f64>,
    /// Structural similarity. None if the picture is smaller than 7x7.
    ssim: Option<f64>,
    /// Time for this view with this scheme, seconds.
    seconds: f64,
}

#[pymethods]
impl PyScore {
    fn __repr__(&self) -> String {
        format!("<viewfuse.Score {}, {}, PSNR {:.2} dB>", self.scheme, self.target, self.psnr)
    }
}

impl From<Score> for PyScore {
    fn from(score: Score) -> PyScore {
        let value = |name: &str| score.value(name);
        PyScore {
            is_baseline: Baseline::ALL.iter().any(|baseline| baseline.name() == score.scheme),
            psnr: value(PSNR).unwrap_or(f64::NAN),
            corrected_psnr: value(PSNR_CORRECTED),
            ssim: value(SSIM),
            seconds: Duration::as_secs_f64(&score.time),
            source_count: score.source_count,
            target: score.target,
            scheme: score.scheme,
        }
    }
}

/// One scheme or several.
#[derive(FromPyObject)]
pub(crate) enum GivenSchemes {
    Several(Vec<GivenWeights>),
    One(GivenWeights),
}

/// The arguments of an evaluation.
pub(crate) struct Evaluation {
    pub(crate) selection: Selection,
    pub(crate) weights: Option<GivenSchemes>,
    /// What a function that gives weights raised.
    pub(crate) raised: Raised,
    pub(crate) pictures: Pictures,
}

impl Evaluation {
    /// The scores, target by target: the baselines and then every scheme.
    pub(crate) fn carry_out(&self, scene: &Scene, progress: &dyn Progress) -> Result<Vec<PyScore>, Failure> {
        let progress = &UntilRaised { progress, raised: &self.raised };
        let weightings = self.weightings(scene)?;
        let field = self.pictures.field()?;
        let about = field.about();
        let options = self.pictures.options(&about)?;
        let device = device(&self.pictures.device)?;
        let renderer = field.on(&device);
        let scorer: Box<dyn Scorer + '_> = match &device {
            AnyDevice::Cpu(device) => Box::new(Metrics::plain(device)),
            AnyDevice::Vulkan(device) => Box::new(Metrics::plain(device.as_ref())),
        };
        let (renderer, scorer) = (renderer.as_ref(), scorer.as_ref());
        let evaluator = Evaluator { weightings: &weightings, renderer, options: &options, scorer, progress };
        Ok(evaluator.score_all(scene, &self.selection)?.into_iter().map(PyScore::from).collect())
    }

    /// The given schemes, or every scheme that needs no file.
    fn weightings(&self, scene: &Scene) -> Result<Vec<OpenedChoice>, Failure> {
        let named = |name: &str| Ok::<OpenedChoice, Failure>(name.parse::<WeightingChoice>()?.open()?);
        let choice = |given: &GivenWeights| match given {
            GivenWeights::Named(name) => named(name),
            GivenWeights::Object(object) => {
                Ok(OpenedChoice::Given(GivenWeights::function(object, scene, &self.raised)?))
            }
        };
        match &self.weights {
            None => scheme_names().into_iter().map(named).collect(),
            Some(GivenSchemes::One(given)) => Ok(vec![choice(given)?]),
            Some(GivenSchemes::Several(given)) => given.iter().map(choice).collect(),
        }
    }
}
