//! `metrics.safetensors`: scores of pairs of pictures, the networks with deterministic initialisation, and Frechet
//! distances of sets.

use super::file::File;
use super::{Measure, Quantity, Report, VerifyError};
use image::RgbImage;
use safetensors::Dtype;
use std::collections::BTreeMap;
use viewfuse_core::metrics::{psnr, ssim};
use viewfuse_device::Device;
use viewfuse_evaluate::metrics::MetricError;
use viewfuse_evaluate::metrics::dists::Dists;
#[cfg(feature = "fid")]
use viewfuse_evaluate::metrics::features::Features;
#[cfg(feature = "fid")]
use viewfuse_evaluate::metrics::frechet::frechet_distance;
use viewfuse_evaluate::metrics::lpips::{Lpips, LpipsTrunk};
use viewfuse_evaluate::metrics::similarity::ssim_gaussian;
use viewfuse_evaluate::metrics::trunk::{Convolution, Pooling, Step, tensors, vgg16};
use viewfuse_nn::checkpoint::{Checkpoint, TensorShape};
use viewfuse_nn::initialisation;

/// Both sides compute in `f64`; the order of summation differs.
const TOLERANCE: f64 = 1.0e-9;
/// Networks compute in `f32`.
const NETWORK_TOLERANCE: f64 = 1.0e-4;
/// The reference's DISTS is 1 less a sum in `f32`: steps of `2^-24` around 1, and the sum's own rounding, in place of a
/// share of the score.
const DISTS_STEPS: f64 = 4.0 / (1 << 24) as f64;
/// The prefix of the file's LPIPS heads, which is followed by the published names.
const LPIPS_PREFIX: &str = "lpips_";
/// Sets of points.
const FRECHET: [(&str, &str); 2] =
    [("frechet", "Frechet distance"), ("frechet_lowrank", "Frechet distance, few points")];

/// Compares the file's quantities; returns the names of the used tensors.
pub(super) fn verify<D: Device>(file: &File<'_>, device: &D, report: &mut Report) -> Result<Vec<String>, VerifyError> {
    let tensors = file.tensors;
    let mut covered = Vec::new();
    if tensors.tensor("pred").is_ok() && tensors.tensor("truth").is_ok() {
        covered.extend(Pairs::read(file)?.verify(device, report)?);
    }
    for (name, title) in FRECHET {
        if tensors.tensor(name).is_ok() {
            covered.extend(frechet(file, name, title, report)?);
        }
    }
    Ok(covered)
}

/// The numbers of a tensor.
fn doubles(file: &File<'_>, name: &str) -> Result<Vec<f64>, VerifyError> {
    let view = file.view(name, Dtype::F64)?;
    Ok(view.data().as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
}

/// A build without the feature `fid` computes no distances of sets.
#[cfg(not(feature = "fid"))]
fn frechet(file: &File<'_>, name: &str, _title: &str, _report: &mut Report) -> Result<Vec<String>, VerifyError> {
    let reason = "is a Frechet distance, which needs a build with the feature `fid`";
    Err(file.wrong(name, reason.to_owned()))
}

/// The distance of the sets `NAME_x` and `NAME_y`.
#[cfg(feature = "fid")]
fn frechet(file: &File<'_>, name: &str, title: &str, report: &mut Report) -> Result<Vec<String>, VerifyError> {
    let names = ["x", "y"].map(|set| format!("{name}_{set}"));
    let set = |name: &str| {
        let view = file.view(name, Dtype::F64)?;
        let &[_, dimension] = view.shape() else {
            return Err(file.wrong(name, format!("has the shape {:?} instead of [point, number]", view.shape())));
        };
        Features::new(dimension, doubles(file, name)?).map_err(|error| file.wrong(name, error.to_string()))
    };
    let ours = frechet_distance(&set(&names[0])?, &set(&names[1])?);
    let ours = ours.map_err(|error| file.wrong(&names[0], error.to_string()))?;
    let mut quantity = Quantity::new(title, Measure::Relative, NETWORK_TOLERANCE);
    quantity.compare_all([ours], doubles(file, name)?, name);
    report.quantities.push(quantity);
    Ok(names.into_iter().chain([name.to_owned()]).collect())
}

/// The pairs of pictures.
struct Pairs<'a> {
    file: &'a File<'a>,
    pairs: Vec<[RgbImage; 2]>,
}

impl<'a> Pairs<'a> {
    fn read(file: &'a File<'a>) -> Result<Pairs<'a>, VerifyError> {
        let pictures = |name: &str| {
            let wrong = |message: String| file.wrong(&format!("tensor '{name}'"), message);
            let view = file.tensors.tensor(name).map_err(|error| wrong(error.to_string()))?;
            let &[count, height, width, 3] = view.shape() else {
                return Err(wrong(format!(
                    "must be U8 [pair, row, column, 3], not {:?} {:?}",
                    view.dtype(),
                    view.shape()
                )));
            };
            if view.dtype() != Dtype::U8 || count * height * width == 0 {
                return Err(wrong(format!(
                    "must be U8 [pair, row, column, 3], not {:?} {:?}",
                    view.dtype(),
                    view.shape()
                )));
            }
            let picture = |levels: &[u8]| RgbImage::from_raw(width as u32, height as u32, levels.to_vec());
            let pictures: Option<Vec<RgbImage>> = view.data().chunks_exact(height * width * 3).map(picture).collect();
            pictures.ok_or_else(|| wrong("is too large".to_owned()))
        };
        let (predictions, truths) = (pictures("pred")?, pictures("truth")?);
        let size = |pictures: &[RgbImage]| (pictures.len(), pictures.first().map(RgbImage::dimensions));
        if size(&predictions) != size(&truths) {
            return Err(file.wrong("tensor 'truth'", "has another shape than pred"));
        }
        Ok(Pairs { file, pairs: predictions.into_iter().zip(truths).map(|(p, t)| [p, t]).collect() })
    }

    fn verify<D: Device>(&self, device: &D, report: &mut Report) -> Result<Vec<String>, VerifyError> {
        let mut covered: Vec<String> = ["pred", "truth"].map(str::to_owned).to_vec();
        let uniform = |p: &RgbImage, t: &RgbImage| ssim(p, t, t.width() as usize, t.height() as usize, 3);
        let plain: [(&str, &str, &Score<'_>); 3] = [
            ("psnr", "PSNR", &|p, t| Ok(psnr(p, t))),
            ("ssim", "SSIM (uniform 7x7)", &|p, t| Ok(uniform(p, t).unwrap_or(f64::NAN))),
            ("ssim_gaussian", "SSIM (Gaussian)", &|p, t| Ok(ssim_gaussian(p, t).unwrap_or(f64::NAN))),
        ];
        for (name, title, score) in plain {
            covered.extend(self.compare(name, Quantity::new(title, Measure::Relative, TOLERANCE), score, report)?);
        }
        for kind in LpipsTrunk::ALL {
            let name = kind.metric().replace('-', "_");
            if self.file.tensors.tensor(&name).is_err() {
                continue;
            }
            let (heads, names) = self.prefixed(LPIPS_PREFIX);
            let lpips = Lpips::new(device, kind, &by_formula(&kind.steps(), ""), &heads);
            let lpips = lpips.map_err(|error| self.failed(&name, &error))?;
            let score: &Score<'_> = &|p, t| lpips.distance(device, p, t).map_err(|error| self.failed(&name, &error));
            let quantity = Quantity::new(format!("LPIPS ({kind})"), Measure::Relative, NETWORK_TOLERANCE);
            covered.extend(self.compare(&name, quantity, score, report)?);
            covered.extend(names);
        }
        if self.file.tensors.tensor("dists").is_ok() {
            let (weights, names) = self.prefixed("dists_");
            let trunk = by_formula(&vgg16(Pooling::L2), "vgg16.");
            let dists = Dists::new(device, &trunk, &weights).map_err(|error| self.failed("dists", &error))?;
            let score: &Score<'_> = &|p, t| dists.distance(device, p, t).map_err(|error| self.failed("dists", &error));
            let quantity = Quantity::new("DISTS", Measure::Absolute, DISTS_STEPS);
            covered.extend(self.compare("dists", quantity, score, report)?);
            covered.extend(names);
        }
        Ok(covered)
    }

    /// Compares the score of every pair with the reference, if the file has one.
    fn compare(
        &self,
        name: &str,
        mut quantity: Quantity,
        score: &Score<'_>,
        report: &mut Report,
    ) -> Result<Option<String>, VerifyError> {
        if self.file.tensors.tensor(name).is_err() {
            return Ok(None);
        }
        let reference = doubles(self.file, name)?;
        if reference.len() != self.pairs.len() {
            return Err(self.file.wrong(name, format!("must be F64 [{}]", self.pairs.len())));
        }
        let ours: Vec<f64> = self.pairs.iter().map(|[p, t]| score(p, t)).collect::<Result<_, _>>()?;
        quantity.compare_all(ours, reference, name);
        report.quantities.push(quantity);
        Ok(Some(name.to_owned()))
    }

    /// The file's tensors of `f32` of this prefix as a checkpoint without it, flat heads in the shape that they are
    /// published with; and all their names.
    fn prefixed(&self, prefix: &str) -> (Checkpoint, Vec<String>) {
        let mut names = Vec::new();
        let mut heads = Vec::new();
        for (name, view) in self.file.tensors.iter() {
            let Some(own) = name.strip_prefix(prefix).filter(|_| view.dtype() == Dtype::F32) else { continue };
            let shape = if view.shape().len() == 1 { vec![1, view.shape()[0], 1, 1] } else { view.shape().to_vec() };
            let values = view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            heads.push((TensorShape { name: own.to_owned(), shape }, values));
            names.push(name.to_owned());
        }
        (Checkpoint::in_memory(&self.file.path.display().to_string(), heads, BTreeMap::new()), names)
    }

    fn failed(&self, name: &str, error: &MetricError) -> VerifyError {
        let cause = std::error::Error::source(error).map_or(String::new(), |cause| format!(": {cause}"));
        self.file.wrong(name, format!("{error}{cause}"))
    }
}

/// A score of a prediction and a truth.
type Score<'a> = dyn Fn(&RgbImage, &RgbImage) -> Result<f64, VerifyError> + 'a;

/// A trunk's parameters by deterministic initialisation, their names behind a prefix.
fn by_formula(steps: &[Step<Convolution>], prefix: &'static str) -> Checkpoint {
    let values = move |tensor: &TensorShape| initialisation::tensor(&format!("{prefix}{}", tensor.name), &tensor.shape);
    Checkpoint::computed("formula", tensors(steps, 3).0, BTreeMap::new(), values)
}
