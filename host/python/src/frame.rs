//! A rendered view.

use crate::arrays::{Picture, array, intrinsic_matrix};
use crate::error::Failure;
use image::{DynamicImage, RgbImage};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use std::path::PathBuf;
use viewfuse::core::camera::Pinhole;
use viewfuse::field::auto::{Beyond, Expected};
use viewfuse::field::render::{Frame, Truth};
use viewfuse::job::files::check_writable;
use viewfuse::output::png::write_png;
use viewfuse::scene::Scene;

/// A rendered view, as arrays that share no memory with one another.
#[pyclass(name = "Frame", module = "viewfuse", frozen, get_all)]
pub(crate) struct PyFrame {
    /// The target's name.
    name: String,
    /// The weighting scheme, in its text form.
    scheme: String,
    /// Red, green, blue in [0, 1] and opacity, not rounded: float32 [height][width][4].
    colours: Py<PyArray3<f32>>,
    /// The picture: uint8 [height][width][3].
    picture: Py<PyArray3<u8>>,
    /// Depth along the principal axis in the units of the scene's files, 0 where there is no surface: float32
    /// [height][width]. None for fields without depths.
    depths: Option<Py<PyArray2<f32>>>,
    /// How far each pixel can be relied on, in [0, 1]: float32 [height][width]. None for fields that do not tell.
    confidences: Option<Py<PyArray2<f32>>>,
    /// Names of the sources.
    sources: Vec<String>,
    /// The weights that the sources were used with: float32 [source]; they sum to 1.
    weights: Py<PyArray1<f32>>,
    /// Those of the scheme, before sources were dropped: float32 [source].
    weights_before: Py<PyArray1<f32>>,
    /// Camera-to-world matrix, as those of the scene: float64 [4][4].
    pose: Py<PyArray2<f64>>,
    /// The camera's matrix in pixels of this picture: float64 [3][3].
    intrinsics: Py<PyArray2<f64>>,
    /// The photograph at the target: uint8 [height][width][3]. None without one.
    truth: Option<Py<PyArray3<u8>>>,
    /// Where the photograph shows the whole pixel (above 0): uint8 [height][width]. None where it does everywhere.
    seen: Option<Py<PyArray2<u8>>>,
    /// Peak signal to noise ratio against the photograph, decibels. None without one.
    psnr: Option<f64>,
    /// The same after a gain and an offset of each channel were fitted to the photograph: without the price of its
    /// exposure. None without one.
    corrected_psnr: Option<f64>,
    /// Structural similarity with the photograph. None without one, or if it shows no 7x7 pixels together.
    ssim: Option<f64>,
    /// The PSNR to expect and the ends of the interval that holds four of five, decibels. None unless the scheme was
    /// chosen.
    expected: Option<(f64, f64, f64)>,
    /// Why no PSNR can be expected where the scheme was chosen: "far" and how many times as far away as the farthest
    /// source is from the others, or "unseen" and the share of the picture that no source shows. None otherwise.
    beyond: Option<(&'static str, f64)>,
    /// Time for this view alone, seconds.
    seconds: f64,
}

#[pymethods]
impl PyFrame {
    /// Writes the picture as a PNG, whole or not at all: the bytes that the command writes. Missing folders are made.
    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        check_writable(&path).map_err(Failure::from)?;
        let picture = Picture::of(self.picture.bind(py))?;
        let [width, height] = picture.size().map(|side| side as u32);
        let picture = RgbImage::from_raw(width, height, picture.values().into_owned());
        let picture = picture.ok_or_else(|| Failure::Other("the picture has another size".to_owned()))?;
        py.detach(|| write_png(&path, &DynamicImage::ImageRgb8(picture))).map_err(|error| Failure::from(error).into())
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let [width, height] = Picture::of(self.picture.bind(py))?.size();
        let score = self.psnr.map_or_else(String::new, |psnr| format!(", PSNR {psnr:.2} dB"));
        Ok(format!("<viewfuse.Frame {}, {width}x{height}{score}>", self.name))
    }
}

/// What a frame does not say of itself.
pub(crate) struct Finished {
    pub(crate) frame: Frame,
    pub(crate) scheme: String,
    pub(crate) expected: Option<Expected>,
    pub(crate) beyond: Option<Beyond>,
}

/// The arrays take the frame's memory. `sources` are views of the scene.
pub(crate) fn to_python(py: Python<'_>, scene: &Scene, sources: &[usize], finished: Finished) -> PyResult<PyFrame> {
    let Finished { frame, scheme, expected, beyond } = finished;
    let Frame { target, weights, omission, colours, picture, mut depths, confidences, truth, time, .. } = frame;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    if scene.frame.scale != 1.0 {
        depths.iter_mut().for_each(|depth| *depth = scene.frame.file_length(*depth));
    }
    let pixels = |values: Vec<f32>| {
        let is_there = !values.is_empty();
        is_there.then(|| array(py, [height, width], values)).transpose()
    };
    let resized: Option<Pinhole> = target.camera.pinhole.resized(width as u32, height as u32).ok();
    let matrix = intrinsic_matrix(&resized.unwrap_or(target.camera.pinhole));
    let pose = scene.frame.file_from_camera(&target.camera.pose);
    let (psnr, corrected_psnr) = truth.as_ref().map(|truth| (truth.psnr, truth.corrected_psnr)).unzip();
    let ssim = truth.as_ref().and_then(|truth| truth.ssim);
    let (truth, seen) = truth.map_or((None, None), |Truth { picture, seen, .. }| (Some(picture), seen));
    Ok(PyFrame {
        name: target.name,
        scheme,
        colours: array(py, [height, width, 4], colours.into_flattened())?,
        picture: array(py, [height, width, 3], picture.into_raw())?,
        depths: pixels(depths)?,
        confidences: pixels(confidences)?,
        sources: sources.iter().map(|&view| scene.views[view].name.clone()).collect(),
        weights: array(py, [sources.len()], omission.weights.values()[..sources.len()].to_vec())?,
        weights_before: array(py, [sources.len()], weights.values()[..sources.len()].to_vec())?,
        pose: array(py, [4, 4], pose.as_flattened().to_vec())?,
        intrinsics: array(py, [3, 3], matrix.as_flattened().to_vec())?,
        truth: truth.map(|truth| array(py, [height, width, 3], truth.into_raw())).transpose()?,
        seen: seen.map(|seen| array(py, [height, width], seen.into_raw())).transpose()?,
        psnr,
        corrected_psnr,
        ssim,
        expected: expected.map(|Expected { psnr, interval: [low, high], .. }| (psnr, low, high)),
        beyond: beyond.map(|beyond| match beyond {
            Beyond::Far(times) => ("far", times),
            Beyond::Unseen(share) => ("unseen", share.into()),
        }),
        seconds: time.as_secs_f64(),
    })
}
