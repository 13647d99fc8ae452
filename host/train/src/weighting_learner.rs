//! The paper's learned weighting: the network is fixed, and only the weighting of its views is trained, with the network's
//! own loss.

use super::TrainError;
use super::attention::{Attention, Embedding};
use super::batch::{Batch, BatchSize, SourceDraw, Targets};
use super::draw::{Draw, Purpose};
use super::genvs::{Genvs, ViewCounts, Views};
use super::genvs_learner::{self, MAX_LEVEL_SHARE};
use super::parameters::{Contents, Parameters};
use super::pixelnerf::{PixelNerf, SampleCounts};
use super::pixelnerf_learner;
use super::run::{self, Learner, Outcome, Schedule, Validated};
use super::scenes::{Data, TrainingScene};
use candle_core::{DType, Result, Tensor};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use viewfuse_core::camera::Camera;
use viewfuse_core::depths::CoarseBlock;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::Scheme;
use viewfuse_field::family::Family;
use viewfuse_job::progress::Progress;
use viewfuse_nn::checkpoint::Checkpoint;

/// The settings of a run besides its schedule, its scenes and the network.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WeightingSettings {
    /// The embedding of poses.
    pub embedding: Embedding,
    /// Side of the pictures.
    pub side: u32,
    /// Objects of a step, each with one target.
    pub objects: usize,
    /// Rays of each target; a GeNVS takes whole pictures.
    pub rays: usize,
}

/// The numbers of sources of a step, one of which is drawn.
const SOURCE_COUNTS: [usize; 4] = [3, 4, 6, 8];
/// Sources in validation.
const VALIDATION_SOURCES: usize = 6;
/// Samples of a ray: of a PixelNeRF's passes, and of a GeNVS.
const SAMPLES: SampleCounts = SampleCounts { coarse: 32, fine: 16 };
const GENVS_SAMPLES: u32 = 64;

/// A fixed network.
enum Frozen {
    PixelNerf(PixelNerf),
    Genvs(Genvs),
}

struct WeightingLearner {
    attention: Attention,
    network: Frozen,
    scenes: Vec<TrainingScene>,
    validation: Vec<TrainingScene>,
    settings: WeightingSettings,
}

/// Trains the weighting for a network in `folder`, or continues there.
///
/// # Errors
/// [`TrainError`].
pub fn train_weighting(
    settings: &WeightingSettings,
    checkpoint: &Checkpoint,
    schedule: &Schedule,
    [scenes, validation]: [&[PathBuf]; 2],
    folder: &Path,
    progress: &dyn Progress,
) -> std::result::Result<Outcome, TrainError> {
    let family = Family::of(checkpoint)?;
    let network = if family == Family::PixelNerf {
        Frozen::PixelNerf(PixelNerf::frozen(checkpoint, DType::F32)?)
    } else if family == Family::Genvs {
        Frozen::Genvs(Genvs::frozen(checkpoint, settings.side, DType::F32)?)
    } else {
        let reason = format!("a weighting cannot be trained for a {family}");
        return Err(TrainError::Checkpoint { path: checkpoint.path().to_path_buf(), reason });
    };
    let least_views = SOURCE_COUNTS.into_iter().max().unwrap_or(1) + 1;
    let data = Data::open([scenes, validation], settings.side, least_views, progress)?;
    let attention = Attention::new(settings.embedding, DType::F32, schedule.seed)?;
    let record = run::settings("weighting", settings, schedule, &data, Some(checkpoint))?;
    let learner = WeightingLearner {
        attention,
        network,
        scenes: data.training,
        validation: data.validation,
        settings: *settings,
    };
    run::run(&learner, schedule, &record, "PSNR dB", folder, progress)
}

impl WeightingLearner {
    fn of_batch(&self, batch: &Batch) -> Result<Tensor> {
        let targets: Vec<Pose> = batch.targets.iter().map(|camera| camera.pose).collect();
        self.attention.weights(&poses(&batch.sources), &targets)
    }

    fn of_views(&self, views: &Views) -> Result<Tensor> {
        let targets: Vec<Pose> = views.target_cameras.iter().map(|targets| targets[0].pose).collect();
        self.attention.weights(&poses(&views.sources), &targets)
    }
}

fn poses(cameras: &[Vec<Camera>]) -> Vec<Vec<Pose>> {
    cameras.iter().map(|cameras| cameras.iter().map(|camera| camera.pose).collect()).collect()
}

impl Learner for WeightingLearner {
    fn parameters(&self) -> &Parameters {
        &self.attention.parameters
    }

    fn loss(&self, draw: &Draw) -> Result<Tensor> {
        let WeightingSettings { objects, rays, .. } = self.settings;
        let sources = SOURCE_COUNTS[draw.below(Purpose::SourceCount, 0, SOURCE_COUNTS.len())];
        let dtype = self.attention.parameters.dtype();
        match &self.network {
            Frozen::PixelNerf(network) => {
                let size = BatchSize { objects, rays };
                let batch = Batch::draw(&self.scenes, draw, size, SourceDraw::whole(sources), Targets::One, dtype)?;
                let colours = network.render(&batch, &self.of_batch(&batch)?, draw, SAMPLES)?;
                (colours - &batch.truth)?.sqr()?.mean_all()
            }
            Frozen::Genvs(network) => {
                let views = ViewCounts { sources: SourceDraw::whole(sources), targets: 1 };
                let views = Views::draw(&self.scenes, draw, objects, views, dtype)?;
                let samples =
                    CoarseBlock { seed: [draw.seed as u32, draw.step], sample_count: GENVS_SAMPLES, jitter: 1.0 };
                let weights = self.of_views(&views)?;
                genvs_learner::loss(network, &views, &weights, &samples, MAX_LEVEL_SHARE, draw)
            }
        }
    }

    fn validate(&self) -> Result<Validated> {
        let [own, mean] = match &self.network {
            Frozen::PixelNerf(network) => {
                let score = |weigh: &dyn Fn(&Batch) -> Result<Tensor>| {
                    pixelnerf_learner::score(network, &self.validation, VALIDATION_SOURCES, Targets::One, weigh)
                };
                [score(&|batch| self.of_batch(batch))?, score(&|batch| batch.weights(Scheme::MEAN))?]
            }
            Frozen::Genvs(network) => {
                let views = ViewCounts { sources: SourceDraw::whole(VALIDATION_SOURCES), targets: 1 };
                let score = |weigh: &dyn Fn(&Views) -> Result<Tensor>| -> Result<f64> {
                    Ok(genvs_learner::scores(network, &self.validation, views, GENVS_SAMPLES, weigh)?[0])
                };
                [score(&|views| self.of_views(views))?, score(&|views| views.weights(Scheme::MEAN))?]
            }
        };
        Ok(Validated { score: own, remark: format!("{:+.3} dB against equal weights", own - mean) })
    }

    fn checkpoint(&self) -> Result<Contents> {
        Ok((self.attention.parameters.values()?, BTreeMap::new()))
    }
}
