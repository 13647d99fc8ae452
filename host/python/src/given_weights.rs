//! Weights of the caller's own: an array, or a function of the cameras.

use crate::error::Failure;
use crate::request::Request;
use numpy::{AllowTypeChange, PyArray2, PyArray3, PyArrayLikeDyn};
use pyo3::prelude::*;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use viewfuse::core::camera::Camera;
use viewfuse::core::pose::Pose;
use viewfuse::job::progress::Progress;
use viewfuse::scene::few_shot::FewShot;
use viewfuse::scene::unit::RigUnit;
use viewfuse::scene::{Scene, SceneFrame};
use viewfuse::weighting::sources::{MAX_SOURCES, SourcePoses, SourceWeights};
use viewfuse::weighting::{Weigh, Weighting, WeightingChoice};

use crate::arrays::array;

/// What a caller gives as weights.
#[derive(FromPyObject)]
pub(crate) enum GivenWeights {
    /// The name of a scheme, or `auto`.
    Named(String),
    /// A function, or an array.
    Object(Py<PyAny>),
}

/// What a function raised, or what was wrong with its result: the first time.
pub(crate) type Raised = Arc<Mutex<Option<PyErr>>>;

/// Takes what was raised.
pub(crate) fn raised(raised: &Raised) -> PyResult<()> {
    raised.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
}

/// The progress of work that ends when a function has raised something.
pub(crate) struct UntilRaised<'a> {
    pub(crate) progress: &'a dyn Progress,
    pub(crate) raised: &'a Raised,
}

impl Progress for UntilRaised<'_> {
    fn stage(&self, name: &str, place: Range<usize>, of: usize) {
        self.progress.stage(name, place, of);
    }

    fn expect(&self, pieces: usize) {
        self.progress.expect(pieces);
    }

    fn step(&self) {
        self.progress.step();
    }

    fn status(&self, words: &str) {
        self.progress.status(words);
    }

    fn warn(&self, warning: &str) {
        self.progress.warn(warning);
    }

    fn note(&self, news: &str) {
        self.progress.note(news);
    }

    fn is_cancelled(&self) -> bool {
        self.progress.is_cancelled() || self.raised.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }
}

impl GivenWeights {
    /// The weighting of a job; `None` for the best of the scene.
    ///
    /// # Errors
    /// If a scheme is not known, an array has another shape or unusable numbers, or a function fails for the first
    /// target.
    pub(crate) fn weighting(
        &self,
        scene: &Scene,
        job: &FewShot,
        request: &Request,
        errors: &Raised,
    ) -> Result<Option<Weighting>, Failure> {
        let object = match self {
            GivenWeights::Named(name) => {
                return Ok(match name.parse::<WeightingChoice>()? {
                    WeightingChoice::Given(spec) => Some(spec.open()?),
                    WeightingChoice::Auto => None,
                });
            }
            GivenWeights::Object(object) => object,
        };
        // Poses come in the unit of weightings.
        let unit = RigUnit::of_scene(scene);
        let targets = job.targets.iter().map(|target| unit.pose(&target.camera.pose)).collect();
        let weighting = Python::attach(|py| {
            if object.bind(py).is_callable() {
                return Ok::<Weighting, Failure>(custom(py, object, scene, errors));
            }
            let array = Array::of(object.bind(py), targets, job.sources.len())?;
            request.check_order(scene, array.is_for_all)?;
            Ok(Weighting::custom(array))
        })?;
        // What a function returns for the first target says whether it can be used, before any work.
        let cameras: Vec<Camera> = job.source_cameras(scene);
        let poses: Vec<Pose> = cameras.iter().map(|camera| unit.pose(&camera.pose)).collect();
        if let (Ok(sources), Some(first)) = (SourcePoses::new(&poses), job.targets.first()) {
            weighting.weigh(&sources, &unit.pose(&first.camera.pose));
        }
        Ok(Some(weighting))
    }

    /// The weighting that a function is, for any sources and targets of a scene.
    ///
    /// # Errors
    /// If it is no function, or fails for the first photograph from the others.
    pub(crate) fn function(object: &Py<PyAny>, scene: &Scene, errors: &Raised) -> Result<Weighting, Failure> {
        let weighting = Python::attach(|py| match object.bind(py).is_callable() {
            true => Ok(custom(py, object, scene, errors)),
            false => Err(Failure::Input("weights: a scheme's name or a function, or a list of these".to_owned())),
        })?;
        let unit = RigUnit::of_scene(scene);
        let photographed = scene.views.iter().filter(|view| view.image.is_some());
        let poses: Vec<Pose> = photographed.map(|view| unit.pose(&view.camera.pose)).take(MAX_SOURCES).collect();
        if let Some((first, others)) = poses.split_first()
            && let Ok(sources) = SourcePoses::new(others)
        {
            weighting.weigh(&sources, first);
        }
        match errors.lock().unwrap_or_else(PoisonError::into_inner).take() {
            // Python's own error, as it is.
            Some(error) => Err(Failure::Raised(error)),
            None => Ok(weighting),
        }
    }
}

/// The weighting of a function, which keeps its first error.
fn custom(py: Python<'_>, object: &Py<PyAny>, scene: &Scene, errors: &Raised) -> Weighting {
    let (function, errors) = (object.clone_ref(py), Arc::clone(errors));
    Weighting::custom(Function { function, unit: RigUnit::of_scene(scene), frame: scene.frame, errors })
}

/// Numbers as weights: as many as there are sources, finite, none below 0, one above.
fn weights_of(numbers: &[f64], count: usize) -> Result<SourceWeights, String> {
    if numbers.len() != count {
        return Err(format!("{} numbers for {count} sources", numbers.len()));
    }
    let largest = numbers.iter().copied().fold(0.0, f64::max);
    if !numbers.iter().all(|number| number.is_finite() && *number >= 0.0) || largest == 0.0 {
        return Err("weights are finite numbers of at least 0, one of them above 0".to_owned());
    }
    // Divided first: what is far from 1 would be no f32.
    let mut scores = [0.0; MAX_SOURCES];
    scores.iter_mut().zip(numbers).for_each(|(score, number)| *score = (number / largest) as f32);
    Ok(SourceWeights::from_scores(&scores, count as u32))
}

/// Weights by target, as an array has them. Where the sources' own depths are sought, which the array does not speak
/// of, the default scheme decides which neighbours count.
struct Array {
    /// One row.
    is_for_all: bool,
    rows: Vec<(Pose, SourceWeights)>,
}

impl Array {
    fn of(given: &Bound<'_, PyAny>, targets: Vec<Pose>, source_count: usize) -> Result<Array, Failure> {
        let wrong = |what: String| Failure::Input(format!("weights: {what}"));
        let array: PyArrayLikeDyn<'_, f64, AllowTypeChange> =
            given.extract().map_err(|_| wrong("a scheme's name, an array of numbers or a function".to_owned()))?;
        let view = array.as_array();
        let shape = view.shape().to_vec();
        let is_for_all = shape == [source_count];
        if !is_for_all && shape != [targets.len(), source_count] {
            let count = targets.len();
            let text = format!("an array of shape {shape:?}; it must be [{source_count}] or [{count}, {source_count}]");
            return Err(wrong(text));
        }
        let numbers: Vec<f64> = view.iter().copied().collect();
        let row = |(index, target): (usize, Pose)| {
            let start = if is_for_all { 0 } else { index * source_count };
            let weights = weights_of(&numbers[start..start + source_count], source_count);
            Ok((target, weights.map_err(|what| wrong(format!("of target {index}: {what}")))?))
        };
        let rows: Vec<(Pose, SourceWeights)> =
            targets.into_iter().enumerate().map(row).collect::<Result<_, Failure>>()?;
        // A row is found by its pose.
        for (index, (pose, weights)) in rows.iter().enumerate() {
            if let Some(first) = rows[..index].iter().position(|(other, before)| other == pose && before != weights) {
                let text = format!("targets {first} and {index} have one pose, and other rows: render them one by one");
                return Err(wrong(text));
            }
        }
        Ok(Array { is_for_all, rows })
    }
}

impl Weigh for Array {
    fn name(&self) -> String {
        "array".to_owned()
    }

    fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights {
        let row = self.rows.iter().find(|(pose, weights)| pose == target && weights.count() == sources.count());
        row.map_or_else(|| Weighting::default_scheme().weigh(sources, target), |(_, weights)| *weights)
    }
}

/// A function of the sources' camera-to-world matrices, float64 [source][4][4], and the target's, float64 [4][4], in
/// the coordinates of the scene's files. It is called for each target, and for each source with the others.
struct Function {
    function: Py<PyAny>,
    unit: RigUnit,
    frame: SceneFrame,
    errors: Raised,
}

impl Function {
    fn call(&self, py: Python<'_>, sources: &SourcePoses, target: &Pose) -> PyResult<SourceWeights> {
        let matrix = |pose: &Pose| {
            let mut block = pose.block();
            let axes = [&mut block.right, &mut block.down, &mut block.forward];
            axes.into_iter().for_each(|axis| axis[3] *= self.unit.length());
            self.frame.file_from_camera(&block.pose())
        };
        let count = sources.count() as usize;
        let matrices: Vec<[[f64; 4]; 4]> = (0..sources.count()).map(|view| matrix(sources.pose(view))).collect();
        let sources: Py<PyArray3<f64>> = array(py, [count, 4, 4], matrices.into_flattened().into_flattened())?;
        let target: Py<PyArray2<f64>> = array(py, [4, 4], matrix(target).as_flattened().to_vec())?;
        let returned = self.function.bind(py).call1((sources, target))?;
        let array: PyArrayLikeDyn<'_, f64, AllowTypeChange> = returned.extract()?;
        let numbers: Vec<f64> = array.as_array().iter().copied().collect();
        let wrong = |what: String| Failure::Input(format!("weights: what the function returned: {what}"));
        Ok(weights_of(&numbers, count).map_err(wrong)?)
    }
}

impl Weigh for Function {
    fn name(&self) -> String {
        Python::attach(|py| self.function.getattr(py, "__name__").and_then(|name| name.extract(py)))
            .unwrap_or_else(|_| "function".to_owned())
    }

    fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights {
        let mut errors = self.errors.lock().unwrap_or_else(PoisonError::into_inner);
        if errors.is_none() {
            drop(errors);
            // Not while the lock is held: another thread may hold Python's.
            match Python::attach(|py| self.call(py, sources, target)) {
                Ok(weights) => return weights,
                Err(error) => {
                    errors = self.errors.lock().unwrap_or_else(PoisonError::into_inner);
                    errors.get_or_insert(error);
                }
            }
        }
        SourceWeights::mean(sources.count())
    }
}
