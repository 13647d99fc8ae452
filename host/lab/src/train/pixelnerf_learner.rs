//! A small PixelNeRF. With equal weights of the views, as published, unless schemes are given.

use super::TrainError;
use super::augmentation::Augmentation;
use super::batch::{Batch, BatchSize, SourceDraw, Targets};
use super::draw::Draw;
use super::parameters::{Contents, Parameters};
use super::pixelnerf::{PixelNerf, SampleCounts};
use super::run::{self, Learner, Outcome, Plan, Task, Validated, count, number, side};
use super::scenes::{Data, TrainingScene};
use candle_core::{DType, Result, Tensor};
use clap::Args;
use serde::Serialize;
use viewfuse_field::pixelnerf::architecture::Architecture;
use viewfuse_nn::checkpoint::Checkpoint;

/// The settings of a run besides its schedule and scenes.
#[derive(Args, Clone, Debug, PartialEq, Serialize)]
pub(crate) struct PixelNerfSettings {
    /// Width of the point network
    // The trunk's width follows from it. A network that continues from a file has the file's.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = count())]
    width: usize,
    /// Levels of the trunk, 1 to 4: with more, a pixel's features depend on more of the photograph. More than those of
    /// the file of --from are added [default: 3, or those of the file]
    // See [`Architecture::with_levels`]; those that are added change nothing at first.
    #[arg(long, value_name = "N", value_parser =
        number(|levels: &usize| (1..=4).contains(levels), "a whole number from 1 to 4 is needed"))]
    levels: Option<usize>,
    /// Side of the pictures, pixels, a multiple of 16
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = side())]
    side: u32,
    /// Objects of a step
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = count())]
    objects: usize,
    /// Rays of each object
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = count())]
    rays: usize,
    /// Samples of a ray in the first pass
    #[arg(long, value_name = "N", default_value_t = 32, value_parser =
        number(|samples: &usize| (2..=1024).contains(samples), "a whole number from 2 to 1024 is needed"))]
    coarse: usize,
    /// Samples that the second pass adds
    #[arg(long, value_name = "N", default_value_t = 16, value_parser =
        number(|samples: &usize| *samples <= 1024, "a whole number from 0 to 1024 is needed"))]
    fine: usize,
    #[arg(skip)]
    pub(crate) augmentation: Augmentation,
}

/// Levels of a new network's trunk: those of the published trunk.
const LEVELS: usize = 3;
/// Mostly three sources, so that the network works with few of them, sometimes one or more, so that it works with any
/// weights. Published: always the same number.
const SOURCES: [usize; 8] = [1, 2, 3, 3, 3, 3, 4, 6];
/// Most samples of a step times the width: so many numbers a layer has, of 4 bytes.
const MAX_LAYER: usize = 1 << 28;

impl PixelNerfSettings {
    /// Refuses numbers that no memory holds.
    fn check(&self) -> std::result::Result<(), TrainError> {
        let &PixelNerfSettings { width, side, objects, rays, coarse, fine, ref augmentation, .. } = self;
        if objects * rays * (coarse + fine) * width > MAX_LAYER {
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
    data: Data,
    settings: PixelNerfSettings,
}

/// Trains a PixelNeRF, or continues: from scratch, or from a trained network.
pub(crate) fn train_pixelnerf(
    mut settings: PixelNerfSettings,
    from: Option<&Checkpoint>,
    task: &Task<'_>,
) -> std::result::Result<Outcome, TrainError> {
    settings.augmentation = settings.augmentation.or(&SOURCES);
    settings.check()?;
    let most_sources = settings.augmentation.most_sources();
    let data = Data::open(task.scenes, settings.side, most_sources + 1, task.progress)?;
    let architecture = Architecture { has_fine: false, pixel_centre: 0.5, ..Architecture::small(settings.width) };
    let (levels, seed) = (settings.levels, task.schedule.seed);
    let mut network = match from {
        Some(checkpoint) => PixelNerf::continued(checkpoint, levels.unwrap_or(1), DType::F32, seed)?,
        None => PixelNerf::new(architecture.with_levels(levels.unwrap_or(LEVELS)), DType::F32, seed)?,
    };
    if let Some(levels) = levels.filter(|levels| *levels < network.architecture.levels.len()) {
        let allowed = "the file's network has more levels, and none are removed";
        return Err(TrainError::Setting { name: "levels", value: levels as f64, allowed });
    }
    network.architecture.source_side = settings.side;
    (settings.width, settings.levels) = (network.architecture.width, Some(network.architecture.levels.len()));
    let learner = PixelNerfLearner { network, data, settings };
    let plan = Plan { model: "pixelnerf", score_name: "PSNR dB", settings: &learner.settings, from };
    run::run(&learner, &plan, task)
}

/// The PSNR of pictures without a difference: not infinite, for the mean of several is to say something of the others,
/// and JSON has no infinity.
const MAX_DECIBELS: f64 = 100.0;

/// Ten times the logarithm of one over the mean square, at most [`MAX_DECIBELS`].
pub(super) fn decibels(mean_square: &Tensor) -> Result<f64> {
    let mean_square = f64::from(mean_square.to_dtype(DType::F32)?.to_scalar::<f32>()?);
    let decibels = -10.0 * mean_square.log10();
    Ok(if decibels > MAX_DECIBELS { MAX_DECIBELS } else { decibels })
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

    fn data(&self) -> &Data {
        &self.data
    }

    fn loss(&self, draw: &Draw) -> Result<Tensor> {
        let PixelNerfSettings { objects, rays, coarse, fine, .. } = self.settings;
        let (drawn, scheme) = self.settings.augmentation.drawn(draw);
        let targets = Targets::of(scheme);
        let size = BatchSize { objects, rays };
        let batch = Batch::draw(&self.data.training, draw, size, drawn, targets, self.network.parameters.dtype())?;
        let colours = self.network.render(&batch, &batch.weights(scheme)?, draw, SampleCounts { coarse, fine })?;
        (colours - &batch.truth)?.sqr()?.mean_all()
    }

    fn validate(&self) -> Result<Validated> {
        let scheme = self.settings.augmentation.schemes[0];
        let weigh = |batch: &Batch| batch.weights(scheme);
        let score = score(&self.network, &self.data.validation, VALIDATION_SOURCES, Targets::of(scheme), &weigh)?;
        Ok(Validated { score, remark: String::new() })
    }

    fn checkpoint(&self) -> Result<Contents> {
        self.network.checkpoint()
    }
}
