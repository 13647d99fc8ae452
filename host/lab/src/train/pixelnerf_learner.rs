//! A small PixelNeRF. With equal weights of the views, as published, unless schemes are given.

use super::TrainError;
use super::augmentation::Augmentation;
use super::batch::{Batch, BatchSize, SourceDraw, Targets};
use super::draw::Draw;
use super::parameters::{Contents, Parameters};
use super::pixelnerf::{PixelNerf, SampleCounts};
use super::run::{self, Learner, Outcome, Schedule, Validated};
use super::scenes::{Data, TrainingScene};
use candle_core::{DType, Result, Tensor};
use serde::Serialize;
use std::path::{Path, PathBuf};
use viewfuse_field::pixelnerf::architecture::Architecture;
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::Checkpoint;

/// The settings of a run besides its schedule and scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PixelNerfSettings {
    /// Width of the point network; the trunk's width follows from it. A network that continues from a file has the
    /// file's.
    pub width: usize,
    /// Levels of the trunk behind its first convolution, 1 to 4; see [`Architecture::with_levels`]. `None`: 3, or those
    /// of the file that a network continues from. More than the file's are added, and change nothing at first.
    pub levels: Option<usize>,
    /// Side of the pictures, which the network is then given when it renders.
    pub side: u32,
    /// Objects of a step.
    pub objects: usize,
    /// Rays of each.
    pub rays: usize,
    /// Samples of a ray in the first pass.
    pub coarse: usize,
    /// Samples that the second pass adds.
    pub fine: usize,
    /// What differs from step to step.
    pub augmentation: Augmentation,
}

/// Levels of a new network's trunk, and the most: those of the published trunk.
const LEVELS: usize = 3;
const MAX_LEVELS: usize = 4;
/// Largest width, side and count of the settings.
const MAX_SETTING: usize = 1024;
/// Most samples of a step times the width: so many numbers a layer has, of 4 bytes.
const MAX_LAYER: usize = 1 << 28;

impl PixelNerfSettings {
    /// Refuses numbers with which nothing is computed, or that no memory holds.
    fn check(&self) -> std::result::Result<(), TrainError> {
        let &PixelNerfSettings { width, levels, side, objects, rays, coarse, fine, ref augmentation } = self;
        let levels = levels.unwrap_or(LEVELS);
        let numbers = [
            ("width", width, 1, "it must be from 1 to 1024"),
            ("side", side as usize, 16, "it must be from 16 to 1024 pixels"),
            ("objects", objects, 1, "it must be from 1 to 1024"),
            ("rays", rays, 1, "it must be from 1 to 1024"),
            ("coarse", coarse, 2, "it must be from 2 to 1024"),
            ("fine", fine, 0, "it must be from 0 to 1024"),
        ];
        if let Some(&(name, value, _, allowed)) =
            numbers.iter().find(|(_, value, least, _)| !(*least..=MAX_SETTING).contains(value))
        {
            return Err(TrainError::Setting { name, value: value as f64, allowed });
        }
        if !(1..=MAX_LEVELS).contains(&levels) {
            return Err(TrainError::Setting {
                name: "levels",
                value: levels as f64,
                allowed: "it must be from 1 to 4",
            });
        }
        let layer = objects * rays * (coarse + fine) * width;
        if layer > MAX_LAYER {
            let allowed = "objects times rays times samples times width must be at most 2^28";
            return Err(TrainError::Setting { name: "objects", value: objects as f64, allowed });
        }
        augmentation.check(side)
    }
}

/// Objects in validation, rays of each, sources, and samples.
const VALIDATION: BatchSize = BatchSize { objects: 24, rays: 192 };
const VALIDATION_SOURCES: usize = 3;
const VALIDATION_SAMPLES: SampleCounts = SampleCounts { coarse: 64, fine: 32 };

struct PixelNerfLearner {
    network: PixelNerf,
    scenes: Vec<TrainingScene>,
    validation: Vec<TrainingScene>,
    settings: PixelNerfSettings,
}

/// Trains a PixelNeRF in `folder`, or continues there: from scratch, or from a trained network.
///
/// # Errors
/// [`TrainError`].
pub fn train_pixelnerf(
    settings: &PixelNerfSettings,
    from: Option<&Checkpoint>,
    schedule: &Schedule,
    [scenes, validation]: [&[PathBuf]; 2],
    folder: &Path,
    progress: &dyn Progress,
) -> std::result::Result<Outcome, TrainError> {
    settings.check()?;
    let most_sources = settings.augmentation.most_sources();
    let data = Data::open([scenes, validation], settings.side, most_sources + 1, progress)?;
    let architecture = Architecture { has_fine: false, pixel_centre: 0.5, ..Architecture::small(settings.width) };
    let mut network = match from {
        Some(checkpoint) => PixelNerf::continued(checkpoint, settings.levels.unwrap_or(1), DType::F32, schedule.seed)?,
        None => PixelNerf::new(architecture.with_levels(settings.levels.unwrap_or(LEVELS)), DType::F32, schedule.seed)?,
    };
    network.architecture.source_side = settings.side;
    let Architecture { width, ref levels, .. } = network.architecture;
    let settings = PixelNerfSettings { width, levels: Some(levels.len()), ..settings.clone() };
    let record = run::settings("pixelnerf", &settings, schedule, &data, from)?;
    let learner = PixelNerfLearner { network, scenes: data.training, validation: data.validation, settings };
    run::run(&learner, schedule, &record, "PSNR dB", folder, progress)
}

/// Ten times the logarithm of one over the mean square.
pub(super) fn decibels(mean_square: &Tensor) -> Result<f64> {
    Ok(-10.0 * f64::from(mean_square.to_dtype(DType::F32)?.to_scalar::<f32>()?).log10())
}

/// Mean PSNR over some rays of scenes, with the weights `weigh` of the views: the same rays and sources every time,
/// for any seed of the run.
pub(super) fn score(
    network: &PixelNerf,
    scenes: &[TrainingScene],
    source_count: usize,
    targets: Targets,
    weigh: &dyn Fn(&Batch) -> Result<Tensor>,
) -> Result<f64> {
    let count = VALIDATION.objects.min(scenes.len());
    let mut sum = 0.0;
    for object in 0..count {
        let draw = Draw { seed: 0, step: u32::MAX - object as u32 };
        let dtype = network.parameters.dtype();
        let drawn = SourceDraw::whole(source_count);
        let batch = Batch::of(scenes, &[object], &draw, VALIDATION.rays, drawn, targets, dtype)?;
        let colours = network.render(&batch, &weigh(&batch)?, &draw, VALIDATION_SAMPLES)?;
        sum += decibels(&(colours - &batch.truth)?.sqr()?.mean_all()?)?;
    }
    Ok(sum / count as f64)
}

impl Learner for PixelNerfLearner {
    fn parameters(&self) -> &Parameters {
        &self.network.parameters
    }

    fn loss(&self, draw: &Draw) -> Result<Tensor> {
        let PixelNerfSettings { objects, rays, coarse, fine, .. } = self.settings;
        let (drawn, scheme) = self.settings.augmentation.drawn(draw);
        let targets = Targets::of(scheme);
        let size = BatchSize { objects, rays };
        let batch = Batch::draw(&self.scenes, draw, size, drawn, targets, self.network.parameters.dtype())?;
        let colours = self.network.render(&batch, &batch.weights(scheme)?, draw, SampleCounts { coarse, fine })?;
        (colours - &batch.truth)?.sqr()?.mean_all()
    }

    fn validate(&self) -> Result<Validated> {
        let scheme = self.settings.augmentation.schemes[0];
        let weigh = |batch: &Batch| batch.weights(scheme);
        let score = score(&self.network, &self.validation, VALIDATION_SOURCES, Targets::of(scheme), &weigh)?;
        Ok(Validated { score, remark: String::new() })
    }

    fn checkpoint(&self) -> Result<Contents> {
        self.network.checkpoint()
    }
}
