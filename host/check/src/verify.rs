//! Comparison of this build with files of reference values from the official implementations.
//!
//! A file is recognised by its content; quantities that this version does not compute are listed, not silently
//! skipped. Every comparison is `!(error <= tolerance)`: NaN fails.

mod attention;
mod file;
mod genvs;
mod metrics;
mod pixelnerf;
mod weighting;

use file::File;
use safetensors::SafeTensors;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use viewfuse_device::Device;
use viewfuse_device::cpu::Cpu;
use viewfuse_job::files::read_at_most;
use viewfuse_job::progress::Progress;

/// Why a file could not be compared at all.
#[derive(Debug, thiserror::Error)]
pub enum VerifyError {
    /// The file could not be read.
    #[error("{}: cannot be read: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        cause: std::io::Error,
    },
    /// The file is neither JSON nor safetensors.
    #[error("{}: neither JSON ({json}) nor safetensors ({safetensors})", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The JSON reader's error.
        json: serde_json::Error,
        /// The safetensors reader's error.
        safetensors: safetensors::SafeTensorError,
    },
    /// The JSON does not have the form of a reference file.
    #[error("{}: {place}: {message}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The case, method or tensor.
        place: String,
        /// The problem.
        message: String,
    },
    /// The file has no known reference values.
    #[error("{}: holds no reference values that this version knows", path.display())]
    Unknown {
        /// The file.
        path: PathBuf,
    },
}

/// How a difference is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// `|a - e|`.
    Absolute,
    /// `|a - e| / |e|`; where `e` is 0, `a` must be.
    Relative,
}

/// The result for one quantity of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// The compared quantities.
    pub name: String,
    /// Compared numbers.
    pub count: usize,
    /// The largest difference; NaN if one is NaN.
    pub worst: f64,
    /// The kind of difference.
    pub measure: Measure,
    /// The tolerance.
    pub tolerance: f64,
    /// The place of the largest difference.
    pub place: String,
}

impl Quantity {
    /// No numbers compared yet.
    fn new(name: impl Into<String>, measure: Measure, tolerance: f64) -> Quantity {
        Quantity { name: name.into(), count: 0, worst: 0.0, measure, tolerance, place: String::new() }
    }

    /// Compares a number of ours with the reference.
    fn compare(&mut self, ours: f64, reference: f64, place: impl FnOnce() -> String) {
        // Equal infinities (the PSNR of equal pictures) differ by nothing.
        let difference = if ours == reference { 0.0 } else { (ours - reference).abs() };
        let error = match self.measure {
            Measure::Absolute => difference,
            Measure::Relative if difference == 0.0 => 0.0,
            Measure::Relative => difference / reference.abs(),
        };
        self.count += 1;
        // NaN stays NaN, with its first place.
        if !self.worst.is_nan() && !(error <= self.worst) {
            self.worst = error;
            self.place = place();
        }
    }

    /// Compares two lists, the place being an index. A list that is shorter than the other counts as NaN there.
    fn compare_all(
        &mut self,
        ours: impl IntoIterator<Item = f64>,
        reference: impl IntoIterator<Item = f64>,
        place: &str,
    ) {
        let (mut ours, mut reference) = (ours.into_iter(), reference.into_iter());
        for index in 0.. {
            let (a, e) = match (ours.next(), reference.next()) {
                (None, None) => break,
                (a, e) => (a.unwrap_or(f64::NAN), e.unwrap_or(f64::NAN)),
            };
            self.compare(a, e, || format!("{place}[{index}]"));
        }
    }

    /// Whether the quantity was compared and every difference is within the tolerance, which is finite: one that is a
    /// share of an infinite reference says nothing.
    pub fn passes(&self) -> bool {
        self.count > 0 && self.worst <= self.tolerance && self.tolerance.is_finite()
    }
}

/// The result for a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// The file.
    pub path: PathBuf,
    /// The compared quantities.
    pub quantities: Vec<Quantity>,
    /// Reference values that this version does not compute.
    pub not_covered: Vec<String>,
}

impl Report {
    /// Whether every quantity passes.
    pub fn passes(&self) -> bool {
        self.quantities.iter().all(Quantity::passes)
    }
}

/// Most bytes of a file of reference values.
const LONGEST_FILE: u64 = 4 << 30;

/// Compares a field with a file; nothing if the file has another content.
type Part<D> = fn(&File<'_>, &D, &mut Report, &dyn Progress) -> Result<(), VerifyError>;

/// The parts of the learned fields, by the names of their rows.
fn parts<D: Device>() -> [(&'static str, Part<D>); 2] {
    [("pixelnerf", pixelnerf::verify), ("genvs", genvs::verify)]
}

/// The learned fields whose reference values can be compared, by the names of their rows.
pub fn fields() -> Vec<&'static str> {
    parts::<Cpu>().map(|(name, _)| name).to_vec()
}

/// Compares this build with a file; kernels run on the given device.
///
/// # Errors
/// [`VerifyError`] if the file cannot be compared at all. An exceeded tolerance is not an error but part of the
/// report.
pub fn verify<D: Device>(path: &Path, device: &D, progress: &dyn Progress) -> Result<Report, VerifyError> {
    let bytes =
        read_at_most(path, LONGEST_FILE).map_err(|cause| VerifyError::Io { path: path.to_path_buf(), cause })?;
    let report = match SafeTensors::deserialize(&bytes) {
        Ok(tensors) => {
            let mut report = Report { path: path.to_path_buf(), quantities: Vec::new(), not_covered: Vec::new() };
            // The header was read once already.
            let metadata = SafeTensors::read_metadata(&bytes).ok().and_then(|(_, header)| header.metadata().clone());
            let metadata = metadata.unwrap_or_default();
            let file = File { path, tensors: &tensors, metadata, covered: RefCell::default() };
            attention::verify(&file, &mut report)?;
            metrics::verify(&file, device, &mut report)?;
            for (_, verify) in parts::<D>() {
                verify(&file, device, &mut report, progress)?;
            }
            let covered = file.covered.into_inner();
            report.not_covered =
                tensors.names().into_iter().filter(|name| !covered.contains(*name)).map(str::to_owned).collect();
            report.not_covered.sort_unstable();
            report
        }
        Err(safetensors) => match serde_json::from_slice(&bytes) {
            Ok(json) => weighting::verify(path, &json)?,
            Err(json) => return Err(VerifyError::Format { path: path.to_path_buf(), json, safetensors }),
        },
    };
    if report.quantities.is_empty() {
        return Err(VerifyError::Unknown { path: path.to_path_buf() });
    }
    Ok(report)
}
