//! PSNR and SSIM of two pictures.

use crate::arrays::Picture;
use crate::error::Failure;
use crate::interrupt::left_alone;
use pyo3::prelude::*;
use viewfuse::core::metrics;

/// Two pictures of one size, not empty.
fn pair<'py>(prediction: &Bound<'py, PyAny>, truth: &Bound<'py, PyAny>) -> PyResult<[Picture<'py>; 2]> {
    let pair = [Picture::of(prediction)?, Picture::of(truth)?];
    let [[width, height], [true_width, true_height]] = [pair[0].size(), pair[1].size()];
    if [width, height] != [true_width, true_height] || width * height == 0 {
        let sizes = format!("{width}x{height} and {true_width}x{true_height}");
        return Err(Failure::Input(format!("pictures of one size can be compared, not of {sizes}")).into());
    }
    Ok(pair)
}

/// Copies, which another thread of Python cannot change meanwhile.
fn values(pair: [Picture<'_>; 2]) -> [Vec<u8>; 2] {
    pair.map(|picture| picture.values().into_owned())
}

/// Peak signal to noise ratio of two uint8 pictures in decibels; infinite if they are equal.
#[pyfunction]
pub(crate) fn psnr(py: Python<'_>, prediction: &Bound<'_, PyAny>, truth: &Bound<'_, PyAny>) -> PyResult<f64> {
    let [prediction, truth] = values(pair(prediction, truth)?);
    left_alone(py, move || metrics::psnr(&prediction, &truth))
}

/// Structural similarity of two uint8 pictures (uniform 7x7 window); None if they are smaller than that.
#[pyfunction]
pub(crate) fn ssim(py: Python<'_>, prediction: &Bound<'_, PyAny>, truth: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    let pair = pair(prediction, truth)?;
    let [width, height] = pair[0].size();
    let [prediction, truth] = values(pair);
    left_alone(py, move || metrics::ssim(&prediction, &truth, width, height, 3))
}
