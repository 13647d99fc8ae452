//! `metrics.safetensors`: scores of pairs of pictures.

use super::{Measure, Quantity, Report, VerifyError};
use safetensors::{Dtype, SafeTensors};
use std::path::Path;
use viewfuse_core::metrics::{psnr, ssim};

/// Both sides compute in `f64`; the order of summation differs.
const TOLERANCE: f64 = 1.0e-9;

/// Compares what is there; returns the names of the tensors that were used.
pub(super) fn verify(path: &Path, file: &SafeTensors<'_>, report: &mut Report) -> Result<Vec<String>, VerifyError> {
    let content = |place: &str, message: String| VerifyError::Content {
        path: path.to_path_buf(),
        place: format!("tensor '{place}'"),
        message,
    };
    let (Ok(predictions), Ok(truths)) = (file.tensor("pred"), file.tensor("truth")) else {
        return Ok(Vec::new());
    };
    let shape = predictions.shape().to_vec();
    if predictions.dtype() != Dtype::U8 || truths.dtype() != Dtype::U8 || shape.len() != 4 || shape[3] != 3 {
        return Err(content(
            "pred",
            format!("must be U8 [pair, row, column, 3], not {:?} {shape:?}", predictions.dtype()),
        ));
    }
    if truths.shape() != shape {
        return Err(content("truth", format!("has shape {:?}, pred {shape:?}", truths.shape())));
    }
    let (pair_count, height, width) = (shape[0], shape[1], shape[2]);
    let pair_length = height * width * 3;
    let pairs =
        || predictions.data().chunks_exact(pair_length.max(1)).zip(truths.data().chunks_exact(pair_length.max(1)));
    let mut covered = vec!["pred".to_owned(), "truth".to_owned()];
    let mut compare = |name: &str, title: &str, ours: &dyn Fn(&[u8], &[u8]) -> f64| {
        let Ok(reference) = file.tensor(name) else { return Ok(()) };
        if reference.dtype() != Dtype::F64 || reference.shape() != [pair_count] {
            return Err(content(name, format!("must be F64 [{pair_count}]")));
        }
        let mut quantity = Quantity::new(title, Measure::Relative, TOLERANCE);
        let reference = reference
            .data()
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]));
        quantity.compare_all(pairs().map(|(prediction, truth)| ours(prediction, truth)), reference, name);
        report.quantities.push(quantity);
        covered.push(name.to_owned());
        Ok(())
    };
    compare("psnr", "PSNR", &|prediction, truth| psnr(prediction, truth))?;
    compare("ssim", "SSIM (uniform 7x7)", &|prediction, truth| {
        ssim(prediction, truth, width, height, 3).unwrap_or(f64::NAN)
    })?;
    Ok(covered)
}
