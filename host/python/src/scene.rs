//! A scene.

use crate::arrays::{array, intrinsic_matrix};
use crate::error::Failure;
use crate::evaluate::{Evaluation, GivenSchemes, PyScore};
use crate::frame::{PyFrame, to_python};
use crate::given_weights::{GivenWeights, Raised, raised};
use crate::interrupt::{interruptible, watched};
use crate::optimise::{Optimisation, PyGaussians};
use crate::render::Order;
use crate::request::{Pictures, Request, held_out};
use crate::weights::{PyWeights, Schemes, weigh};
use crate::whole::Whole;
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;
use viewfuse::scene::few_shot::view_list;
use viewfuse::scene::{MaskChoice, Scene};

/// A scene: posed photographs, of which the poses and the headers of the photographs have been read and checked.
///
/// Matrices are in the coordinates of the scene's files, with OpenCV axes: x to the right of the image, y down, z
/// forward.
#[pyclass(name = "Scene", module = "viewfuse", frozen)]
pub(crate) struct PyScene {
    scene: Scene,
}

#[pymethods]
impl PyScene {
    /// Opens a folder, or a file that describes one, in any of the layouts. `masks` says what masks and alpha channels
    /// say: "object" (where it is), "ignore" (which pixels do not count), "none" (they are not used) or "auto".
    #[new]
    #[pyo3(signature = (path, masks = "auto"))]
    pub(crate) fn open(py: Python<'_>, path: PathBuf, masks: &str) -> PyResult<PyScene> {
        let masks = masks.parse::<MaskChoice>().map_err(Failure::from)?;
        let scene = interruptible(py, |_| Ok(Scene::open_masked(path, masks)?))?;
        Ok(PyScene { scene })
    }

    /// The folder or file.
    #[getter]
    fn path(&self) -> PathBuf {
        self.scene.path.clone()
    }

    /// The layout's name.
    #[getter]
    fn layout(&self) -> &'static str {
        self.scene.layout
    }

    /// Warnings of reading, a line each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.scene.warnings.iter().cloned().chain(self.scene.pose_warnings()).collect()
    }

    /// The views' names: first those with photographs, then target poses without.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.scene.views.iter().map(|view| view.name.clone()).collect()
    }

    /// Whether each view has a photograph: bool [view].
    #[getter]
    fn has_photograph(&self, py: Python<'_>) -> PyResult<Py<PyArray1<bool>>> {
        let values = self.scene.views.iter().map(|view| view.image.is_some()).collect();
        array(py, [self.scene.views.len()], values)
    }

    /// Width and height of each view in pixels: int64 [view][2].
    #[getter]
    fn sizes(&self, py: Python<'_>) -> PyResult<Py<PyArray2<i64>>> {
        let pinholes = self.scene.views.iter().map(|view| &view.camera.pinhole);
        let values = pinholes.flat_map(|pinhole| [pinhole.width(), pinhole.height()].map(i64::from)).collect();
        array(py, [self.scene.views.len(), 2], values)
    }

    /// Camera-to-world matrices: float64 [view][4][4].
    #[getter]
    fn poses(&self, py: Python<'_>) -> PyResult<Py<PyArray3<f64>>> {
        let matrices = self.scene.views.iter().map(|view| self.scene.frame.file_from_camera(&view.camera.pose));
        let matrices: Vec<[[f64; 4]; 4]> = matrices.collect();
        array(py, [matrices.len(), 4, 4], matrices.into_flattened().into_flattened())
    }

    /// Camera matrices in pixels: float64 [view][3][3]. The origin is the outer corner of the top left pixel.
    #[getter]
    fn intrinsics(&self, py: Python<'_>) -> PyResult<Py<PyArray3<f64>>> {
        let matrices: Vec<_> = self.scene.views.iter().map(|view| intrinsic_matrix(&view.camera.pinhole)).collect();
        array(py, [matrices.len(), 3, 3], matrices.into_flattened().into_flattened())
    }

    /// Decodes the photograph of one view, undistorted, with its object mask as alpha: uint8 [height][width][4].
    fn photograph(&self, py: Python<'_>, view: &str) -> PyResult<Py<PyArray3<u8>>> {
        let pixels = interruptible(py, |_| {
            let chosen = view_list(&self.scene, view)?;
            match chosen.as_slice() {
                &[view] => Ok(self.scene.photograph(view)?.pixels),
                chosen => Err(Failure::Input(format!("'{view}' names {} views; one was asked for", chosen.len()))),
            }
        })?;
        let (width, height) = (pixels.width() as usize, pixels.height() as usize);
        array(py, [height, width, 4], pixels.into_raw())
    }

    /// Weighs the sources for targets under a scheme or several; without any, under every one that needs no file.
    #[pyo3(signature = (schemes=None, **selection))]
    fn weights(
        &self,
        py: Python<'_>,
        schemes: Option<Schemes>,
        selection: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<PyWeights> {
        let request = Request::of("weights", selection)?;
        weigh(py, &self.scene, schemes, &request)
    }

    /// Renders targets; all frames stay in memory. Ctrl-C ends it. In a notebook a bar shows the progress, where tqdm
    /// is installed.
    #[pyo3(signature = (weights=None, *, size=None, model=None, device="auto", background="auto", leave_out=0.01,
        seed=Whole(0), progress=None, **selection))]
    #[allow(clippy::too_many_arguments)]
    fn render(
        &self,
        py: Python<'_>,
        weights: Option<GivenWeights>,
        size: Option<(Whole<u32>, Whole<u32>)>,
        model: Option<PathBuf>,
        device: &str,
        background: &str,
        leave_out: f32,
        seed: Whole<u64>,
        progress: Option<&Bound<'_, PyAny>>,
        selection: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Vec<PyFrame>> {
        let request = Request::of("render", selection)?;
        let (device, background) = (device.to_owned(), background.to_owned());
        let (size, seed) = (size_of(size), seed.0);
        let pictures = Pictures { size, model, device, background, leave_out, seed };
        let order = Order { request, weights, raised: Raised::default(), pictures };
        let rendered = watched(py, progress, |progress| order.carry_out(&self.scene, progress));
        raised(&order.raised)?;
        let (sources, frames) = rendered?;
        frames.into_iter().map(|frame| to_python(py, &self.scene, &sources, frame)).collect()
    }

    /// Scores schemes on held-out photographs: each target from all other views, or, with sources, all other
    /// views from these. The baselines come first. Ctrl-C ends it.
    #[pyo3(signature = (weights=None, *, targets=None, sources=None, views=None, size=None, model=None, device="auto",
        background="auto", leave_out=0.01, seed=Whole(0), progress=None))]
    #[allow(clippy::too_many_arguments)]
    fn evaluate(
        &self,
        py: Python<'_>,
        weights: Option<GivenSchemes>,
        targets: Option<String>,
        sources: Option<String>,
        views: Option<&Bound<'_, PyAny>>,
        size: Option<(Whole<u32>, Whole<u32>)>,
        model: Option<PathBuf>,
        device: &str,
        background: &str,
        leave_out: f32,
        seed: Whole<u64>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<PyScore>> {
        let selection = held_out(targets, sources, views)?;
        let (device, background) = (device.to_owned(), background.to_owned());
        let (size, seed) = (size_of(size), seed.0);
        let pictures = Pictures { size, model, device, background, leave_out, seed };
        let evaluation = Evaluation { selection, weights, raised: Raised::default(), pictures };
        let scores = watched(py, progress, |progress| evaluation.carry_out(&self.scene, progress));
        raised(&evaluation.raised)?;
        scores
    }

    /// Optimises Gaussians for the photographs, and writes them: as .ply, smaller as .spz or .splat, or as an .html
    /// page. Ctrl-C ends it, and what there is so far is written.
    #[pyo3(signature = (output, *, weights=None, left_out=None, towards=None, quality="fast", sources=None, views=None,
        count=None, iterations=None, resume=None, antialias=false, size=None, device="auto", background="auto", seed=Whole(0),
        progress=None))]
    #[allow(clippy::too_many_arguments)]
    fn optimise(
        &self,
        py: Python<'_>,
        output: PathBuf,
        weights: Option<String>,
        left_out: Option<String>,
        towards: Option<String>,
        quality: &str,
        sources: Option<String>,
        views: Option<&Bound<'_, PyAny>>,
        count: Option<Whole<u32>>,
        iterations: Option<Whole<u32>>,
        resume: Option<PathBuf>,
        antialias: bool,
        size: Option<(Whole<u32>, Whole<u32>)>,
        device: &str,
        background: &str,
        seed: Whole<u64>,
        progress: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyGaussians> {
        let selection = held_out(None, sources, views)?;
        let (device, background, quality) = (device.to_owned(), background.to_owned(), quality.to_owned());
        let optimisation = Optimisation {
            output,
            selection,
            weights,
            left_out,
            towards,
            quality,
            count: count.map(|count| count.0),
            iterations: iterations.map(|iterations| iterations.0),
            resume,
            antialias,
            size: size_of(size),
            device,
            background,
            seed: seed.0,
        };
        watched(py, progress, |progress| optimisation.carry_out(&self.scene, progress))
    }

    fn __len__(&self) -> usize {
        self.scene.views.len()
    }

    fn __repr__(&self) -> String {
        let Scene { path, layout, views, .. } = &self.scene;
        format!("<viewfuse.Scene {}, {layout}, {} views>", path.display(), views.len())
    }
}

/// Opens a scene: a folder, or a file that describes one, in any of the layouts. The same as `Scene(path, masks)`.
#[pyfunction]
#[pyo3(signature = (path, masks = "auto"))]
pub(crate) fn open(py: Python<'_>, path: PathBuf, masks: &str) -> PyResult<PyScene> {
    PyScene::open(py, path, masks)
}

fn size_of(size: Option<(Whole<u32>, Whole<u32>)>) -> Option<(u32, u32)> {
    size.map(|(width, height)| (width.0, height.0))
}
