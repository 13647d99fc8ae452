//! The paper's learned weighting: the network is fixed, and only the weighting of its views is trained, with the
//! network's own loss.
//!
//! A network whose weighting can be trained has a file here and a line in [`NETWORKS`].

mod genvs;
mod pixelnerf;

use super::TrainError;
use super::attention::{Attention, Embedding};
use super::draw::{Draw, Purpose};
use super::parameters::{Contents, Parameters};
use super::run::{self, Learner, Outcome, Plan, Task, Validated, count, side};
use super::scenes::{Data, TrainingScene};
use candle_core::{DType, Result, Tensor};
use clap::Args;
use serde::Serialize;
use std::collections::BTreeMap;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_field::rows::row_of;
use viewfuse_nn::checkpoint::Checkpoint;

/// The settings of a run besides its schedule, its scenes and the network.
#[derive(Args, Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct WeightingSettings {
    /// Embedding of poses
    #[arg(long, value_enum, default_value = "fourier")]
    embedding: Embedding,
    /// Side of the pictures, pixels
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = side())]
    side: u32,
    /// Objects of a step, each with one target
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = count())]
    objects: usize,
    /// Rays of each target; with a GeNVS a target is a whole picture
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = count())]
    rays: usize,
}

/// The numbers of sources of a step, one of which is drawn.
const SOURCE_COUNTS: [usize; 4] = [3, 4, 6, 8];
const VALIDATION_SOURCES: usize = 6;
/// A fixed network.
trait Frozen {
    /// The loss of a step from so many sources.
    fn loss(&self, step: &Step<'_>, source_count: usize) -> Result<Tensor>;

    /// The score on scenes from so many sources, by the learned weights or by equal ones.
    fn score(&self, scenes: &[TrainingScene], source_count: usize, weights: ViewWeights<'_>) -> Result<f64>;
}

/// What a step's loss is computed from.
struct Step<'a> {
    scenes: &'a [TrainingScene],
    draw: &'a Draw,
    settings: &'a WeightingSettings,
    weights: ViewWeights<'a>,
    dtype: DType,
}

/// The weights of views.
#[derive(Clone, Copy)]
enum ViewWeights<'a> {
    Learned(&'a Attention),
    Equal,
}

/// Opens a network for pictures of a side.
type Open = fn(&Checkpoint, u32) -> std::result::Result<Box<dyn Frozen>, TrainError>;

/// The networks by the names of their fields.
const NETWORKS: [(&str, Open); 2] = [("pixelnerf", pixelnerf::open), ("genvs", genvs::open)];

struct WeightingLearner {
    attention: Attention,
    network: Box<dyn Frozen>,
    data: Data,
    settings: WeightingSettings,
}

/// Trains the weighting for a network, or continues.
pub(crate) fn train_weighting(
    settings: WeightingSettings,
    network: Option<&Checkpoint>,
    task: &Task<'_>,
) -> std::result::Result<Outcome, TrainError> {
    let Some(checkpoint) = network else { unreachable!("the command line asks for a network") };
    let row = row_of(checkpoint)?;
    let Some((_, open)) = NETWORKS.into_iter().find(|(name, _)| *name == row.name) else {
        let reason = format!("a weighting cannot be trained for a {}", row.title);
        return Err(TrainError::Checkpoint { path: checkpoint.path().to_path_buf(), reason });
    };
    let network = open(checkpoint, settings.side)?;
    let least_views = SOURCE_COUNTS.into_iter().max().unwrap_or(1) + 1;
    let data = Data::open(task.scenes, settings.side, least_views, task.progress)?;
    let attention = Attention::new(settings.embedding, DType::F32, task.schedule.seed)?;
    let learner = WeightingLearner { attention, network, data, settings };
    let plan = Plan { model: "weighting", score_name: "PSNR dB", settings: &learner.settings, from: Some(checkpoint) };
    run::run(&learner, &plan, task)
}

impl ViewWeights<'_> {
    /// Of views with these cameras, `[object][view]`, for a target each; otherwise the equal ones.
    fn or(self, sources: &[Vec<Camera>], targets: &[Pose], equal: impl FnOnce() -> Result<Tensor>) -> Result<Tensor> {
        match self {
            ViewWeights::Learned(attention) => attention.weights(&poses(sources), targets),
            ViewWeights::Equal => equal(),
        }
    }
}

fn poses(cameras: &[Vec<Camera>]) -> Vec<Vec<Pose>> {
    cameras.iter().map(|cameras| cameras.iter().map(|camera| camera.pose).collect()).collect()
}

impl Learner for WeightingLearner {
    fn parameters(&self) -> &Parameters {
        &self.attention.parameters
    }

    fn data(&self) -> &Data {
        &self.data
    }

    fn loss(&self, draw: &Draw) -> Result<Tensor> {
        let source_count = SOURCE_COUNTS[draw.below(Purpose::SourceCount, 0, SOURCE_COUNTS.len())];
        let (dtype, weights) = (self.attention.parameters.dtype(), ViewWeights::Learned(&self.attention));
        let step = Step { scenes: &self.data.training, draw, settings: &self.settings, weights, dtype };
        self.network.loss(&step, source_count)
    }

    fn validate(&self) -> Result<Validated> {
        let score = |weights| self.network.score(&self.data.validation, VALIDATION_SOURCES, weights);
        let (learned, mean) = (score(ViewWeights::Learned(&self.attention))?, score(ViewWeights::Equal)?);
        Ok(Validated { score: learned, remark: format!("{:+.3} dB against equal weights", learned - mean) })
    }

    fn checkpoint(&self) -> Result<Contents> {
        Ok((self.attention.parameters.values()?, BTreeMap::new()))
    }
}
