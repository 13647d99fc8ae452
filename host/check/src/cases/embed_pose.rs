//! [`Kernel::EmbedPose`]: the paper's embedding with deterministic initialisation.

use super::*;
use crate::attention_oracle::embed;
use viewfuse_core::attention::{HIDDEN, POSE_FEATURES};
use viewfuse_nn::initialisation;

/// The parameters as their names determine them.
fn embedding() -> Vec<f32> {
    let layers = [("0", HIDDEN, POSE_FEATURES), ("2", HIDDEN, HIDDEN), ("4", EMBEDDING, HIDDEN)];
    let layer = |(name, outputs, inputs): (&str, usize, usize)| {
        let weights = initialisation::tensor(&format!("paper.{name}.weight"), &[outputs, inputs]);
        [weights, initialisation::tensor(&format!("paper.{name}.bias"), &[outputs])].concat()
    };
    layers.map(layer).concat()
}

impl Case for EmbedPose {
    const SEED_COUNT: u64 = 3;
    const HAS_REAL_PARAMETERS: bool = false;
    const LIMITS: Limits = Limits { tolerance: 5.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "sines of arguments that are rounded at up to 48 times a centre, then sums over 42, 64 and \
        64 inputs, every rounding counted as if none cancelled";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] =
        &[("embedding", |own| own.embedding[3] *= 1.01), ("poses", |own| own.poses[0].right[3] *= 1.01)];

    fn inputs(seed: u64, size: u32) -> Vec<EmbedPose> {
        let random = &mut random(1, seed, size);
        let scale = [0.3, 1.0, 2.0][seed as usize % 3];
        vec![EmbedPose {
            pose_count: size,
            embedding: embedding(),
            poses: (0..size).map(|_| random.pose(scale).block()).collect(),
            embedded: Output::Zeros(size as usize * EMBEDDING),
        }]
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let embedding = FourierEmbedding::from_flat(&self.embedding);
        let rows = map(self.poses.len(), 1, |pose| embed(&embedding, &self.poses[pose]));
        decided(rows.into_iter().flatten(), 0)
    }
}
