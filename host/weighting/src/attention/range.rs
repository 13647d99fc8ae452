//! The largest numbers that attention's parameters can give: finite parameters may overflow together, after which a
//! softmax has nothing to tell sources apart by.

use super::AttentionModel;
use viewfuse_core::attention::{EMBEDDING, Linear, POSE_FEATURES};

/// Largest coordinate of a camera that the bounds hold for, in the unit of weightings, in which cameras are 1.3 from
/// what they look at.
const MAX_COORDINATE: f64 = 1.0e4;

/// Logits from which on sums may overflow in `f32`; half of its range, for the roundings.
pub(super) const MAX_LOGIT: f64 = f32::MAX as f64 / 2.0;

/// The largest magnitude of an output of a layer whose inputs are at most `inputs`, and of any sum on the way.
fn outputs<const I: usize, const O: usize>(layer: &Linear<I, O>, inputs: f64) -> f64 {
    let row = |(weights, bias): (&[f32; I], &f32)| {
        weights.iter().map(|weight| f64::from(weight.abs())).sum::<f64>() * inputs + f64::from(bias.abs())
    };
    layer.weight.iter().zip(&layer.bias).map(row).fold(0.0, f64::max)
}

/// A bound on the magnitude of everything that a model computes for a pose, its logits in particular.
pub(super) fn largest_logit(model: &AttentionModel) -> f64 {
    match model {
        AttentionModel::Fourier(embedding) => {
            let first = outputs(&embedding.first, MAX_COORDINATE);
            let second = outputs(&embedding.second, first);
            products(first.max(second), outputs(&embedding.third, second), EMBEDDING)
        }
        AttentionModel::Flat(embedding) => {
            let first = outputs(&embedding.first, MAX_COORDINATE);
            products(first, outputs(&embedding.second, first), EMBEDDING)
        }
        AttentionModel::LearnedCross(layers) => {
            let (query, key) = (outputs(&layers.query, MAX_COORDINATE), outputs(&layers.key, MAX_COORDINATE));
            query.max(key).max(query * key * POSE_FEATURES as f64)
        }
        AttentionModel::PoseSelf(layers) => {
            let [query, key, value] =
                [&layers.query, &layers.key, &layers.value].map(|layer| outputs(layer, MAX_COORDINATE));
            // Weights of values sum to 1.
            let output = outputs(&layers.output, value);
            let scores = query * key * POSE_FEATURES as f64;
            [query, key, value, output, scores, outputs(&layers.logit, output)].into_iter().fold(0.0, f64::max)
        }
    }
}

/// The larger of `inner` and of a dot product of `count` numbers of at most `outer`.
fn products(inner: f64, outer: f64, count: usize) -> f64 {
    inner.max(outer * outer * count as f64)
}
