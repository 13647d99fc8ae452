//! PSNR and SSIM of two pictures.

use crate::arrays::Picture;
use crate::error::Failure;
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

/// Peak signal to noise ratio of two uint8 pictures in decibels; infinite if they are equal.
#[pyfunction]
pub(crate) fn psnr(prediction: &Bound<'_, PyAny>, truth: &Bound<'_, PyAny>) -> PyResult<f64> {
    let [prediction, truth] = pair(prediction, truth)?;
    Ok(metrics::psnr(&prediction.values(), &truth.values()))
}

/// Structural similarity of two uint8 pictures (uniform 7x7 window); None if they are smaller than that.
#[pyfunction]
pub(crate) fn ssim(prediction: &Bound<'_, PyAny>, truth: &Bound<'_, PyAny>) -> PyResult<Option<f64>> {
    let [prediction, truth] = pair(prediction, truth)?;
    let [width, height] = truth.size();
    Ok(metrics::ssim(&prediction.values(), &truth.values(), width, height, 3))
}
