//! The paper's cross-attention weighting as a graph: poses are embedded, and a softmax of products gives the weights.
//! The same as [`viewfuse_core::attention::cross_attention`], with the same parameters.

use super::TrainError;
use super::parameters::{Parameters, fan_in, random};
use candle_core::{D, DType, Device, Result, Tensor};
use clap::ValueEnum;
use serde::Serialize;
use viewfuse_core::attention::{EMBEDDING, HIDDEN, POSE_FEATURES, pose_features};
use viewfuse_core::pose::Pose;
use viewfuse_nn::checkpoint::TensorShape;

/// The embedding of poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Embedding {
    // Fourier features of the centre and the view direction, three layers.
    Fourier,
    // The 16 entries of the pose, two layers.
    Flat,
}

/// Factor of the last layer's initial deviation: all weights start nearly equal.
const LAST_GAIN: f32 = 0.3;

impl Embedding {
    /// Names of the layers with their inputs and outputs.
    fn layers(self) -> Vec<(&'static str, usize, usize)> {
        match self {
            Embedding::Fourier => {
                vec![("paper.0", POSE_FEATURES, HIDDEN), ("paper.2", HIDDEN, HIDDEN), ("paper.4", HIDDEN, EMBEDDING)]
            }
            Embedding::Flat => vec![("paper_flat.0", 16, HIDDEN), ("paper_flat.2", HIDDEN, EMBEDDING)],
        }
    }

    /// The input of the first layer.
    fn features(self, pose: &Pose) -> Vec<f32> {
        match self {
            Embedding::Fourier => pose_features(pose.centre_world(), -pose.forward_world()).to_vec(),
            Embedding::Flat => pose.to_opengl().as_flattened().to_vec(),
        }
    }
}

/// The weighting with its parameters.
#[derive(Clone, Debug)]
pub(crate) struct Attention {
    pub(crate) embedding: Embedding,
    pub(crate) parameters: Parameters,
}

impl Attention {
    /// The initial parameters.
    pub(crate) fn new(embedding: Embedding, dtype: DType, seed: u64) -> std::result::Result<Attention, TrainError> {
        let layers = embedding.layers();
        let last = layers.last().map_or("", |(name, ..)| *name);
        let tensors: Vec<TensorShape> = layers
            .iter()
            .flat_map(|&(name, inner, outer)| {
                let tensor = |leaf: &str, shape| TensorShape { name: format!("{name}.{leaf}"), shape };
                [tensor("weight", vec![outer, inner]), tensor("bias", vec![outer])]
            })
            .collect();
        let parameters = Parameters::new(&tensors, dtype, |tensor| {
            if tensor.shape.len() == 1 {
                return Ok(vec![0.0; tensor.shape[0]]);
            }
            let gain = if tensor.name.starts_with(last) { LAST_GAIN } else { 1.0 };
            Ok(random(tensor, seed, gain * (2.0 / fan_in(tensor) as f32).sqrt()))
        })?;
        Ok(Attention { embedding, parameters })
    }

    /// Embeddings `[pose][EMBEDDING]`.
    fn embed<'a>(&self, poses: impl Iterator<Item = &'a Pose>) -> Result<Tensor> {
        let rows: Vec<Vec<f32>> = poses.map(|pose| self.embedding.features(pose)).collect();
        let count = rows.len();
        let mut flow = Tensor::from_vec(rows.concat(), (count, ()), &Device::Cpu)?.to_dtype(self.parameters.dtype())?;
        for (index, (name, ..)) in self.embedding.layers().into_iter().enumerate() {
            if index > 0 {
                flow = flow.relu()?;
            }
            let [weight, bias] = ["weight", "bias"].map(|leaf| self.parameters.get(&format!("{name}.{leaf}")));
            flow = flow.matmul(&weight?.t()?)?.broadcast_add(bias?)?;
        }
        Ok(flow)
    }

    /// Weights `[object][view]` of `sources[object][view]` for `targets[object]`.
    pub(crate) fn weights(&self, sources: &[Vec<Pose>], targets: &[Pose]) -> Result<Tensor> {
        let (objects, views) = (sources.len(), sources[0].len());
        let keys = self.embed(sources.iter().flatten())?.reshape((objects, views, EMBEDDING))?;
        let queries = self.embed(targets.iter())?.reshape((objects, EMBEDDING, 1))?;
        let logits = (keys.matmul(&queries)?.squeeze(2)? / (EMBEDDING as f64).sqrt())?;
        let powers = logits.broadcast_sub(&logits.max_keepdim(D::Minus1)?.detach())?.exp()?;
        powers.broadcast_div(&powers.sum_keepdim(D::Minus1)?)
    }
}
