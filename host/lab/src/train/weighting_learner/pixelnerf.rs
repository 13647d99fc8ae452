//! The loss of a weighting with a PixelNeRF.

use super::{Frozen, Step, ViewWeights, WeightingSettings};
use crate::train::TrainError;
use crate::train::batch::{Batch, BatchSize, SourceDraw, Targets};
use crate::train::pixelnerf::{PixelNerf, SampleCounts};
use crate::train::pixelnerf_learner;
use crate::train::scenes::TrainingScene;
use candle_core::{DType, Result, Tensor};
use viewfuse_core::pose::Pose;
use viewfuse_core::weighting::Scheme;
use viewfuse_nn::checkpoint::Checkpoint;

/// Samples of a ray in both passes.
const SAMPLES: SampleCounts = SampleCounts { coarse: 32, fine: 16 };

pub(super) fn open(checkpoint: &Checkpoint, _side: u32) -> std::result::Result<Box<dyn Frozen>, TrainError> {
    Ok(Box::new(PixelNerf::frozen(checkpoint, DType::F32)?))
}

fn weights(batch: &Batch, weights: ViewWeights<'_>) -> Result<Tensor> {
    let targets: Vec<Pose> = batch.targets.iter().map(|camera| camera.pose).collect();
    weights.or(&batch.sources, &targets, || batch.weights(Scheme::MEAN))
}

impl Frozen for PixelNerf {
    fn loss(&self, step: &Step<'_>, source_count: usize) -> Result<Tensor> {
        let &WeightingSettings { objects, rays, .. } = step.settings;
        let (size, shown) = (BatchSize { objects, rays }, SourceDraw::whole(source_count));
        let batch = Batch::draw(step.scenes, step.draw, size, shown, Targets::One, step.dtype)?;
        let colours = self.render(&batch, &weights(&batch, step.weights)?, step.draw, SAMPLES)?;
        (colours - &batch.truth)?.sqr()?.mean_all()
    }

    fn score(&self, scenes: &[TrainingScene], source_count: usize, by: ViewWeights<'_>) -> Result<f64> {
        pixelnerf_learner::score(self, scenes, source_count, Targets::One, &|batch| weights(batch, by))
    }
}
