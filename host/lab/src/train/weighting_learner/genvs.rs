//! The loss of a weighting with a GeNVS.

use super::{Frozen, Step, ViewWeights};
use crate::train::TrainError;
use crate::train::batch::SourceDraw;
use crate::train::genvs::{Genvs, ObjectViews, ViewCounts};
use crate::train::genvs_learner::{self, MAX_LEVEL_SHARE};
use crate::train::scenes::TrainingScene;
use candle_core::{DType, Result, Tensor};
use viewfuse_core::depths::CoarseBlock;
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::Scheme;
use viewfuse_nn::checkpoint::Checkpoint;

/// Samples of a ray.
const SAMPLES: u32 = 64;

pub(super) fn open(checkpoint: &Checkpoint, side: u32) -> std::result::Result<Box<dyn Frozen>, TrainError> {
    Ok(Box::new(Genvs::frozen(checkpoint, side, DType::F32)?))
}

fn weights(views: &ObjectViews, weights: ViewWeights<'_>) -> Result<Tensor> {
    let targets: Vec<Pose> = views.target_cameras.iter().map(|targets| targets[0].pose).collect();
    weights.or(&views.sources, &targets, || views.weights(Scheme::MEAN))
}

/// One target of each object.
fn counts(source_count: usize) -> ViewCounts {
    ViewCounts { sources: SourceDraw::whole(source_count), targets: 1 }
}

impl Frozen for Genvs {
    fn loss(&self, step: &Step<'_>, source_count: usize) -> Result<Tensor> {
        let views = ObjectViews::draw(step.scenes, step.draw, step.settings.objects, counts(source_count), step.dtype)?;
        let samples = CoarseBlock { seed: [step.draw.seed as u32, step.draw.step], sample_count: SAMPLES, jitter: 1.0 };
        let weights = weights(&views, step.weights)?;
        genvs_learner::loss(self, &views, &weights, &samples, MAX_LEVEL_SHARE, step.draw)
    }

    fn score(&self, scenes: &[TrainingScene], source_count: usize, by: ViewWeights<'_>) -> Result<f64> {
        let weigh = |views: &ObjectViews| weights(views, by);
        Ok(genvs_learner::scores(self, scenes, counts(source_count), SAMPLES, &weigh)?[0])
    }
}
