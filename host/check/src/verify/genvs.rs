//! GeNVS with deterministic initialisation: volumes, points, feature images, the denoiser, a sampled picture, noise
//! levels. The official network at full size, or, where the file's metadata say `member` = `small`, the small member of
//! the family.

use super::file::{File, compared, full};
use super::{Measure, Quantity, Report, VerifyError};
use crate::half::from_half;
use safetensors::Dtype;
use viewfuse_core::camera::Camera;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_core::sources::Sources;
use viewfuse_device::Device;
use viewfuse_field::genvs::reference::Reference;
use viewfuse_field::genvs::sampling::{Plan, Steps};
use viewfuse_field::genvs::{Architecture, COLOUR_CHANNELS, Genvs, GenvsOptions, Omissions, test_networks};
use viewfuse_job::progress::Progress;
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::{MAX_SOURCES, SourceWeights};

/// Near and far bounds of the file's rays, in units of the distance of an image plane at the focal length.
const NEAR_FAR: [f32; 2] = [0.8, 1.8];
/// The weighting whose whole feature image is in the file, and its name here.
const WHOLE: &str = "error_alpha1_half";
/// Weightings of feature images: the file's names, and those here.
const WEIGHTINGS: [(&str, &str); 2] =
    [("baseline_mean", "mean"), ("error_weighing_alpha=1.0", "error:alpha=1,angle=full")];

/// Compares everything in the file.
pub(super) fn verify<D: Device>(
    file: &File<'_>,
    device: &D,
    report: &mut Report,
    progress: &dyn Progress,
) -> Result<(), VerifyError> {
    if !file.has("volume_value") || !file.has("denoise_sigma") {
        return Ok(());
    }
    let architecture = match file.metadata("member") {
        None => Architecture::published(),
        Some("small") => Architecture::small(),
        Some(other) => return Err(file.wrong("metadata", format!("'member' is '{other}'; there is 'small'"))),
    };
    let failed = |message: String| file.wrong("genvs", message);
    let options = GenvsOptions { omissions: Omissions::NONE, plan: Plan::published(0), ..GenvsOptions::default() };
    let field =
        Genvs::new(test_networks::deterministic(&architecture), options).map_err(|error| failed(error.to_string()))?;
    let sources = file.sources("focal_normalized", |height| height as f32 / 2.0)?;
    let side = architecture.image_side;
    if sources.images.iter().any(|image| image.texels.len() != side * side) {
        return Err(file.wrong("images", format!("are not {side}x{side}")));
    }
    let mut reference = Reference::new(&field, device, &sources, progress).map_err(|error| failed(full(&error)))?;
    let mut comparison = Comparison { file, reference: &mut reference, side };
    comparison.volumes(report)?;
    comparison.points(report)?;
    comparison.features(&sources.images.iter().map(|image| image.camera).collect::<Vec<_>>(), report)?;
    comparison.denoiser(report)?;
    comparison.sample(report)?;
    levels(file, report)
}

/// Noise levels of schedules.
fn levels(file: &File<'_>, report: &mut Report) -> Result<(), VerifyError> {
    let mut names = file.tensors.names();
    names.retain(|name| name.starts_with("sigma_steps."));
    names.sort_unstable();
    for name in names {
        let expected = file.doubles(name)?;
        let count = expected.len() as u32;
        let ours = (0..count).map(|index| f64::from(NoiseSchedule::published().level(index, count)));
        let mut quantity = Quantity::new(format!("GeNVS {count} noise levels"), Measure::Relative, 1.0e-6);
        quantity.compare_all(ours, expected.iter().copied(), name);
        report.quantities.push(quantity);
    }
    Ok(())
}

/// A device's network and the file.
struct Comparison<'a, 'b, D: Device> {
    file: &'a File<'a>,
    reference: &'a mut Reference<'b, D>,
    /// Side of the images.
    side: usize,
}

impl<D: Device> Comparison<'_, '_, D> {
    fn failed(&self, error: &viewfuse_field::FieldError) -> VerifyError {
        self.file.wrong("genvs", full(error))
    }

    /// `values[at(index)]` for the indices of a tensor.
    fn picked(&self, name: &str, values: &[f32], at: impl Fn(usize) -> usize) -> Result<Vec<f32>, VerifyError> {
        let indices = self.file.indices(name)?;
        let value = |index: usize| values.get(at(index)).copied();
        let values: Option<Vec<f32>> = indices.into_iter().map(value).collect();
        values.ok_or_else(|| self.file.wrong(name, "holds an index that is too large"))
    }

    /// The index in (row, column, channel) of number `index` in the file's (channel, row, column).
    fn place(&self, index: usize, channels: usize) -> usize {
        let pixels = self.side * self.side;
        index % pixels * channels + index / pixels
    }

    /// Converts the file's (channel, row, column) to (row, column, channel).
    fn by_pixel(&self, values: &[f32], channels: usize) -> Vec<f32> {
        let pixels = self.side * self.side;
        (0..values.len()).map(|at| values[at % channels * pixels + at / channels]).collect()
    }

    fn volumes(&mut self, report: &mut Report) -> Result<(), VerifyError> {
        let encoder = &self.reference.architecture().encoder;
        let (features, depths, pixels) = (encoder.feature_count, encoder.volume_depth, self.side * self.side);
        let view_len = features * depths * pixels;
        let indices = self.file.indices("volume_index")?;
        let mut ours = vec![f32::NAN; indices.len()];
        let views = indices.iter().map(|index| index / view_len).max().unwrap_or(0);
        if views >= self.reference.view_count() {
            return Err(self.file.wrong("volume_index", "holds an index that is too large"));
        }
        // A volume at a time: they are large.
        for view in 0..=views {
            let volume = self.reference.volume(view).map_err(|error| self.failed(&error))?;
            for (value, index) in ours.iter_mut().zip(&indices).filter(|(_, index)| **index / view_len == view) {
                // Theirs is (view, feature, depth, row, column).
                let (channel, pixel) = (index % view_len / pixels, index % pixels);
                let (feature, depth) = (channel / depths, channel % depths);
                *value = volume[(pixel * depths + depth) * features + feature];
            }
        }
        let expected = self.file.many("volume_value", indices.len())?;
        report.quantities.push(compared("GeNVS volumes".to_owned(), &ours, &expected, 1.0e-4, true));
        Ok(())
    }

    fn points(&self, report: &mut Report) -> Result<(), VerifyError> {
        let ours = self.reference.points(&self.file.floats("mlp_in")?).map_err(|error| self.failed(&error))?;
        let expected = self.file.many("mlp_out", ours.len())?;
        report.quantities.push(compared("GeNVS densities and features".to_owned(), &ours, &expected, 1.0e-5, false));
        Ok(())
    }

    fn features(&mut self, sources: &[Camera], report: &mut Report) -> Result<(), VerifyError> {
        let rows = self.file.rows::<16>("tgt_pose")?;
        let pose = self.file.pose("tgt_pose", &rows[0])?;
        let poses: Vec<_> = sources.iter().map(|camera| camera.pose).collect();
        let poses =
            Sources::<MAX_SOURCES>::new(&poses).map_err(|error| self.file.wrong("src_poses", error.to_string()))?;
        let target = Camera { pose, pinhole: sources[0].pinhole };
        let plane = 2.0 * target.pinhole.focal()[1] / self.side as f32;
        let features = self.reference.architecture().encoder.feature_count;
        let mut is_known = false;
        for (theirs, ours) in WEIGHTINGS {
            let name = format!("feature_image_value.{theirs}");
            if !self.file.has(&name) {
                continue;
            }
            let weighting = Weighting::open(ours).map_err(|_| self.file.wrong(&name, "is no weighting of ours"))?;
            let weights: SourceWeights = weighting.weigh(&poses, &target.pose);
            let weights: Vec<f32> = (0..weights.count()).map(|view| weights.get(view)).collect();
            let near_far = NEAR_FAR.map(|end| end * plane);
            let image = self
                .reference
                .features(&weights, &target.block(0), near_far, NEAR_FAR[1] - NEAR_FAR[0])
                .map_err(|error| self.failed(&error))?;
            let picked = self.picked("feature_image_index", &image, |index| self.place(index, features))?;
            let expected = self.file.many(&name, picked.len())?;
            report.quantities.push(compared(format!("GeNVS feature image, {ours}"), &picked, &expected, 1.0e-4, false));
            is_known = true;
        }
        match is_known {
            false => {
                Err(self.file.wrong("feature_image_index", "has no feature_image_value of a weighting that we know"))
            }
            true => Ok(()),
        }
    }

    /// The condition of the file's denoiser runs.
    fn condition(&self) -> Result<Vec<f32>, VerifyError> {
        let name = format!("feature_image_full.{WHOLE}");
        let view = self.file.view(&name, Dtype::F16)?;
        let values: Vec<f32> =
            view.data().as_chunks::<2>().0.iter().map(|bytes| from_half(u16::from_le_bytes(*bytes)) as f32).collect();
        let features = self.reference.architecture().encoder.feature_count;
        if values.len() != features * self.side * self.side {
            return Err(self.file.wrong(&name, format!("is not {features}x{0}x{0}", self.side)));
        }
        Ok(self.by_pixel(&values, features))
    }

    fn latents(&self) -> Result<Vec<f32>, VerifyError> {
        let latents = self.file.many("latents", COLOUR_CHANNELS * self.side * self.side)?;
        Ok(self.by_pixel(&latents, COLOUR_CHANNELS))
    }

    fn denoiser(&self, report: &mut Report) -> Result<(), VerifyError> {
        let (condition, latents) = (self.condition()?, self.latents()?);
        let given = self.file.tensors.names();
        let levels = self.file.floats("denoise_sigma")?;
        if levels.is_empty() {
            return Err(self.file.wrong("denoise_sigma", "is empty"));
        }
        for level in levels {
            // The names have the levels as numbers of their own.
            let is_of_level = |name: &&&str| {
                let number = name.strip_prefix("denoise_value.").and_then(|number| number.parse::<f32>().ok());
                number.is_some_and(|number| (number - level).abs() <= 1.0e-6 * level)
            };
            let name = given
                .iter()
                .find(is_of_level)
                .ok_or_else(|| self.file.wrong("denoise_sigma", format!("{level} has no denoise_value")))?;
            let noisy: Vec<f32> = latents.iter().map(|latent| latent * level).collect();
            let denoised = self
                .reference
                .denoised(&noisy, &condition, [self.side as u32; 2], level)
                .map_err(|error| self.failed(&error))?;
            let picked = self.picked("denoise_index", &denoised, |index| self.place(index, COLOUR_CHANNELS))?;
            let expected = self.file.many(name, picked.len())?;
            let what = format!("GeNVS denoised at level {level}");
            report.quantities.push(compared(what, &picked, &expected, 1.0e-3, false));
        }
        Ok(())
    }

    fn sample(&self, report: &mut Report) -> Result<(), VerifyError> {
        let count = |name: &str| name.strip_prefix("sample_")?.strip_suffix("_steps")?.parse::<u32>().ok();
        for name in self.file.tensors.names() {
            let Some(level_count) = count(name) else { continue };
            let steps = Steps::Fixed { sampler: Sampler::Heun, level_count };
            let plan = Plan { steps, ..Plan::published(0) };
            let picture = self
                .reference
                .sampled(&self.latents()?, &self.condition()?, [self.side as u32; 2], &plan)
                .map_err(|error| self.failed(&error))?;
            let expected: Vec<f32> = self.file.doubles(name)?.into_iter().map(|value| value as f32).collect();
            if expected.len() != picture.len() {
                return Err(self.file.wrong(name, format!("has not {} numbers", picture.len())));
            }
            let expected = self.by_pixel(&expected, COLOUR_CHANNELS);
            let what = format!("GeNVS picture, {level_count} steps of heun");
            report.quantities.push(compared(what, &picture, &expected, 5.0e-3, true));
        }
        Ok(())
    }
}
