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

/// Compares the file's quantities.
pub(super) fn verify<D: Device>(file: &File<'_>, device: &D, report: &mut Report) -> Result<(), VerifyError> {
    if file.has("pred") && file.has("truth") {
        Pairs::read(file)?.verify(device, report)?;
    }
    FRECHET.iter().filter(|(name, _)| file.has(name)).try_for_each(|(name, title)| frechet(file, name, title, report))
}

/// A build without the feature `fid` computes no distances of sets.
#[cfg(not(feature = "fid"))]
fn frechet(_file: &File<'_>, _name: &str, title: &str, report: &mut Report) -> Result<(), VerifyError> {
    report.not_covered.push(format!("{title} (in builds with the feature `fid`)"));
    Ok(())
}

/// The distance of the sets `NAME_x` and `NAME_y`.
#[cfg(feature = "fid")]
fn frechet(file: &File<'_>, name: &str, title: &str, report: &mut Report) -> Result<(), VerifyError> {
    let names = ["x", "y"].map(|set| format!("{name}_{set}"));
    let set = |name: &str| {
        let view = file.view(name, Dtype::F64)?;
        let &[_, dimension] = view.shape() else {
            return Err(file.wrong(name, format!("has the shape {:?} instead of [point, number]", view.shape())));
        };
        Features::new(dimension, file.doubles(name)?).map_err(|error| file.wrong(name, error.to_string()))
    };
    let ours = frechet_distance(&set(&names[0])?, &set(&names[1])?);
    let ours = ours.map_err(|error| file.wrong(&names[0], error.to_string()))?;
    let mut quantity = Quantity::new(title, Measure::Relative, NETWORK_TOLERANCE);
    quantity.compare_all([ours], file.doubles(name)?, name);
    report.quantities.push(quantity);
    Ok(())
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
            let sizes = match *view.shape() {
                [count, height, width, 3] if view.dtype() == Dtype::U8 && count * height * width > 0 => {
                    Some([height, width])
                }
                _ => None,
            };
            let [height, width] = sizes.ok_or_else(|| {
                let (dtype, shape) = (view.dtype(), view.shape());
                wrong(format!("must be U8 [pair, row, column, 3], not {dtype:?} {shape:?}"))
            })?;
            file.cover(name);
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

    fn verify<D: Device>(&self, device: &D, report: &mut Report) -> Result<(), VerifyError> {
        let uniform = |p: &RgbImage, t: &RgbImage| ssim(p, t, t.width() as usize, t.height() as usize, 3);
        let plain: [(&str, &str, &Score<'_>); 3] = [
            ("psnr", "PSNR", &|p, t| Ok(psnr(p, t))),
            ("ssim", "SSIM (uniform 7x7)", &|p, t| Ok(uniform(p, t).unwrap_or(f64::NAN))),
            ("ssim_gaussian", "SSIM (Gaussian)", &|p, t| Ok(ssim_gaussian(p, t).unwrap_or(f64::NAN))),
        ];
        for (name, title, score) in plain {
            self.compare(name, Quantity::new(title, Measure::Relative, TOLERANCE), score, report)?;
        }
        for kind in LpipsTrunk::ALL {
            let name = kind.metric().replace('-', "_");
            if !self.file.has(&name) {
                continue;
            }
            let heads = self.prefixed(LPIPS_PREFIX);
            let lpips = Lpips::new(device, kind, &by_formula(&kind.steps(), ""), &heads);
            let lpips = lpips.map_err(|error| self.failed(&name, &error))?;
            let score: &Score<'_> = &|p, t| lpips.distance(device, p, t).map_err(|error| self.failed(&name, &error));
            let quantity = Quantity::new(format!("LPIPS ({kind})"), Measure::Relative, NETWORK_TOLERANCE);
            self.compare(&name, quantity, score, report)?;
        }
        if self.file.has("dists") {
            let weights = self.prefixed("dists_");
            let trunk = by_formula(&vgg16(Pooling::L2), "vgg16.");
            let dists = Dists::new(device, &trunk, &weights).map_err(|error| self.failed("dists", &error))?;
            let score: &Score<'_> = &|p, t| dists.distance(device, p, t).map_err(|error| self.failed("dists", &error));
            let quantity = Quantity::new("DISTS", Measure::Absolute, DISTS_STEPS);
            self.compare("dists", quantity, score, report)?;
        }
        Ok(())
    }

    /// Compares the score of every pair with the reference, if the file has one.
    fn compare(
        &self,
        name: &str,
        mut quantity: Quantity,
        score: &Score<'_>,
        report: &mut Report,
    ) -> Result<(), VerifyError> {
        if !self.file.has(name) {
            return Ok(());
        }
        let reference = self.file.doubles(name)?;
        if reference.len() != self.pairs.len() {
            return Err(self.file.wrong(name, format!("must be F64 [{}]", self.pairs.len())));
        }
        let ours: Vec<f64> = self.pairs.iter().map(|[p, t]| score(p, t)).collect::<Result<_, _>>()?;
        quantity.compare_all(ours, reference, name);
        report.quantities.push(quantity);
        Ok(())
    }

    /// The file's tensors of `f32` of this prefix as a checkpoint without it, flat heads in the shape that they are
    /// published with.
    fn prefixed(&self, prefix: &str) -> Checkpoint {
        let mut heads = Vec::new();
        for (name, view) in self.file.tensors.iter() {
            let Some(head) = name.strip_prefix(prefix).filter(|_| view.dtype() == Dtype::F32) else { continue };
            let shape = if view.shape().len() == 1 { vec![1, view.shape()[0], 1, 1] } else { view.shape().to_vec() };
            let values = view.data().as_chunks::<4>().0.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
            heads.push((TensorShape { name: head.to_owned(), shape }, values));
            self.file.cover(name);
        }
        Checkpoint::in_memory(&self.file.path.display().to_string(), heads, BTreeMap::new())
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
