//! What to render: targets and sources from Python's arguments.

use crate::error::Failure;
use crate::whole::Whole;
use glam::DVec3;
use numpy::ndarray::ArrayViewD;
use numpy::{AllowTypeChange, PyArrayLikeDyn};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use viewfuse::core::camera::Camera;
use viewfuse::core::pose::{Pose, PoseError};
use viewfuse::device::choice::{self, AnyDevice, DeviceChoice, DeviceOptions};
use viewfuse::field::options::Given;
use viewfuse::field::render::{DEFAULT_EARLY_TERMINATION, RenderOptions};
use viewfuse::field::{About, AnyField, rows};
use viewfuse::job::text::listed as listed_names;
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::scene::few_shot::{FewShot, PathChoice, Selection, SelectionFault, Target, view_list};
use viewfuse::scene::photographs::BackgroundChoice;
use viewfuse::scene::{Scene, SceneFrame};

/// The arguments that choose sources and targets, which several methods take as keywords.
pub(crate) struct Request {
    selection: Selection,
    /// Camera-to-world matrices of further targets, in the coordinates of the scene's files, OpenCV axes.
    poses: Vec<[[f64; 4]; 4]>,
}

/// Names of the keywords.
const KEYWORDS: [&str; 8] = ["targets", "sources", "views", "orbit", "between", "spiral", "camera_path", "poses"];

impl Request {
    /// # Errors
    /// `TypeError` for a keyword that is none of these or a value of another type, `ValueError` for two paths.
    pub(crate) fn of(method: &str, keywords: Option<&Bound<'_, PyDict>>) -> PyResult<Request> {
        let mut request = Request { selection: Selection::default(), poses: Vec::new() };
        let mut paths = Vec::new();
        for (name, value) in keywords.into_iter().flatten() {
            let name: String = name.extract()?;
            if !KEYWORDS.contains(&name.as_str()) {
                let text = format!("{method}() got an unexpected keyword argument '{name}'");
                return Err(pyo3::exceptions::PyTypeError::new_err(text));
            }
            if value.is_none() {
                continue;
            }
            match name.as_str() {
                "targets" => request.selection.targets = Some(list(&name, &value)?),
                "sources" => request.selection.sources = Some(list(&name, &value)?),
                "views" => request.selection.view_count = Some(count(&name, &value)?),
                "orbit" => paths.push(PathChoice::Orbit(count(&name, &value)?)),
                "between" => {
                    let (first, last, _): (String, String, Bound<'_, PyAny>) = value.extract()?;
                    paths.push(PathChoice::Between { first, last, count: count(&name, &value.get_item(2)?)? });
                }
                "spiral" => paths.push(PathChoice::Spiral(count(&name, &value)?)),
                "camera_path" => paths.push(PathChoice::File(value.extract::<PathBuf>()?)),
                _ => request.poses = matrices(&value)?,
            }
        }
        if paths.len() > 1 {
            let text = "orbit, between, spiral and camera_path are one choice; two of them were given";
            return Err(Failure::Input(text.to_owned()).into());
        }
        request.selection.path = paths.pop();
        Ok(request)
    }

    /// An array's columns are the sources, and its rows the targets unless one `is_for_all`, in the order of the scene:
    /// a list in another order would mean others.
    ///
    /// # Errors
    /// If a list has another order, or a view twice.
    pub(crate) fn check_order(&self, scene: &Scene, is_for_all: bool) -> Result<(), Failure> {
        let Selection { targets, sources, .. } = &self.selection;
        let rows = if is_for_all { None } else { targets.as_deref() };
        let lists = [("sources", "columns", sources.as_deref()), ("targets", "rows", rows)];
        for (name, parts, list) in lists.into_iter().filter_map(|(name, parts, list)| Some((name, parts, list?))) {
            let items = list.split(',').map(|item| view_list(scene, item));
            let listed: Vec<usize> = items.collect::<Result<Vec<_>, _>>()?.concat();
            let ordered = view_list(scene, list)?;
            if listed != ordered {
                let ordered: Vec<&str> = ordered.iter().map(|&view| scene.views[view].name.as_str()).collect();
                let text = format!(
                    "weights: an array's {parts} are the {name} in the order of the scene, each once ({}), and {name}=\"{list}\" \
                     has another",
                    listed_names(&ordered, 8)
                );
                return Err(Failure::Input(text));
            }
        }
        Ok(())
    }

    /// The sources and targets of a scene.
    ///
    /// # Errors
    /// If a view is not there, or there are too few or too many sources, or a matrix is no pose.
    pub(crate) fn resolve(&self, scene: &Scene, least_sources: usize) -> Result<FewShot, Failure> {
        let Request { selection, poses } = self;
        let mut job = if poses.is_empty() || selection.targets.is_some() || selection.path.is_some() {
            selection.resolve(scene, least_sources)?
        } else {
            let sources = selection.sources_without(scene, &[], least_sources)?;
            FewShot { sources, ..FewShot::default() }
        };
        let pinhole = scene.views[job.sources[0]].camera.pinhole;
        for (index, matrix) in poses.iter().enumerate() {
            let name = format!("pose-{index:03}");
            let pose =
                world_pose(matrix, &scene.frame).map_err(|error| Failure::Input(format!("poses[{index}]: {error}")))?;
            if job.targets.iter().any(|target| target.name == name) {
                return Err(SelectionFault::SameName(name).in_scene(scene).into());
            }
            job.targets.push(Target { name, camera: Camera { pose, pinhole }, truth: None });
        }
        Ok(job)
    }
}

/// How pictures are made: the arguments that renders and evaluations share.
pub(crate) struct Pictures {
    pub(crate) size: Option<(u32, u32)>,
    pub(crate) model: Option<PathBuf>,
    pub(crate) device: String,
    pub(crate) background: String,
    pub(crate) leave_out: f32,
    pub(crate) seed: u64,
}

impl Pictures {
    /// The checkpoint's field; the training-free one without.
    pub(crate) fn field(&self) -> Result<AnyField, Failure> {
        match &self.model {
            None => Ok(AnyField::default()),
            Some(path) => Ok(rows::open(Checkpoint::open(path)?, &Given { seed: self.seed, ..Given::default() })?),
        }
    }

    /// The options for such a field.
    pub(crate) fn options(&self, about: &About) -> Result<RenderOptions, Failure> {
        let (options, share) = (render_options(self.size, &self.background)?, self.leave_out);
        if !(0.0..1.0).contains(&share) {
            return Err(Failure::Input(format!("leave_out: {share} is not at least 0 and less than 1")));
        }
        let early_termination = if about.ends_rays { DEFAULT_EARLY_TERMINATION } else { 0.0 };
        let options = RenderOptions { leave_out: share, early_termination, ..options };
        Ok(match rows::named(about.name) {
            Some(row) => row.bounded(options),
            None => options,
        })
    }
}

/// The options of pictures of a size, over a background.
pub(crate) fn render_options(size: Option<(u32, u32)>, background: &str) -> Result<RenderOptions, Failure> {
    let sides = 1..=16_384;
    if let Some((width, height)) = size.filter(|(width, height)| !sides.contains(width) || !sides.contains(height)) {
        return Err(Failure::Input(format!("size: {width}x{height}; width and height are from 1 to 16384")));
    }
    let background = background.parse::<BackgroundChoice>().map_err(|error| Failure::Input(error.to_string()))?;
    Ok(RenderOptions { size: size.map(Into::into), background, ..RenderOptions::default() })
}

/// Opens the device of this name.
pub(crate) fn device(name: &str) -> Result<AnyDevice, Failure> {
    Ok(choice::open(&name.parse::<DeviceChoice>()?, &DeviceOptions::default())?.device)
}

/// The sources and targets of what renders photographs that are held out.
pub(crate) fn held_out(
    targets: Option<String>,
    sources: Option<String>,
    views: Option<&Bound<'_, PyAny>>,
) -> PyResult<Selection> {
    let view_count = views.map(|views| count("views", views)).transpose()?;
    Ok(Selection { targets, sources, view_count, ..Selection::default() })
}

/// A list of views.
fn list(name: &str, value: &Bound<'_, PyAny>) -> PyResult<String> {
    value.extract().map_err(|_| {
        let kind = value.get_type();
        PyTypeError::new_err(format!("{name}: a list of views is a text such as \"2,5,8\", not {kind}"))
    })
}

/// A number of views or cameras.
fn count(name: &str, value: &Bound<'_, PyAny>) -> PyResult<usize> {
    let Whole(count): Whole<i64> = value.extract()?;
    match usize::try_from(count) {
        Ok(count) if (1..=10_000).contains(&count) => Ok(count),
        _ => Err(Failure::Input(format!("{name}: {count} is not a whole number from 1 to 10000")).into()),
    }
}

/// Several 4x4 matrices; an array of float64 is read where it is.
fn matrices(value: &Bound<'_, PyAny>) -> PyResult<Vec<[[f64; 4]; 4]>> {
    let array: PyArrayLikeDyn<'_, f64, AllowTypeChange> = value.extract()?;
    let view = array.as_array();
    if !matches!(*view.shape(), [count, 4, 4] if count > 0) {
        let text = format!("poses: an array of shape {:?}; it must be N x 4 x 4, N at least 1", view.shape());
        return Err(Failure::Input(text).into());
    }
    let matrix = |m: ArrayViewD<'_, f64>| std::array::from_fn(|row| std::array::from_fn(|column| m[[row, column]]));
    Ok(view.outer_iter().map(matrix).collect())
}

/// A matrix of the scene's files as a pose in the world: as the files' own are read.
fn world_pose(matrix: &[[f64; 4]; 4], frame: &SceneFrame) -> Result<Pose, PoseError> {
    let mut moved = *matrix;
    if *frame != SceneFrame::FILE {
        let centre = frame.world(DVec3::new(matrix[0][3], matrix[1][3], matrix[2][3]));
        (moved[0][3], moved[1][3], moved[2][3]) = (centre.x, centre.y, centre.z);
    }
    Pose::from_opencv(&moved.map(|row| row.map(|value| value as f32)))
}
