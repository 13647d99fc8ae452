//! The paper's attention in `f64`: embeddings of poses, and the softmax of their products, with bounds on the error of
//! `f32`.

use super::bounded::{Bounded, DIVISION, ROUNDING};
use viewfuse_core::attention::{EMBEDDING, FREQUENCY_COUNT, FREQUENCY_FACTOR, FourierEmbedding, Linear};
use viewfuse_core::pose::PoseBlock;

/// The absolute error of a weight by underflow of the exponential, which a device may flush to 0.
const NEGLIGIBLE: f64 = 4.0e-38;

/// The embedding of a pose, `[EMBEDDING]`. Coordinates of the centre must be below 170, so that no sine has an argument
/// above 8192.
pub fn embed(embedding: &FourierEmbedding, pose: &PoseBlock) -> Vec<Bounded> {
    let features = features(pose);
    let hidden = relu(apply(&embedding.first, &features));
    apply(&embedding.third, &relu(apply(&embedding.second, &hidden)))
}

/// Centre, sines and cosines, backward axis.
fn features(pose: &PoseBlock) -> Vec<Bounded> {
    let centre = [pose.right[3], pose.down[3], pose.forward[3]].map(Bounded::from);
    let mut features = centre.to_vec();
    for k in 0..FREQUENCY_COUNT {
        let angles = centre.map(|c| Bounded::from(FREQUENCY_FACTOR * (1 << k) as f32) * c);
        features.extend(angles.map(Bounded::sine));
        features.extend(angles.map(Bounded::cosine));
    }
    features.extend([0, 1, 2].map(|axis| Bounded::from(-pose.forward[axis])));
    features
}

fn apply<const I: usize, const O: usize>(layer: &Linear<I, O>, x: &[Bounded]) -> Vec<Bounded> {
    let terms = |row: &[f32; I], bias: f32| {
        row.iter().zip(x).fold(Bounded::from(bias), |sum, (weight, x)| sum + Bounded::from(*weight) * *x)
    };
    layer.weight.iter().zip(&layer.bias).map(|(row, bias)| terms(row, *bias)).collect()
}

fn relu(values: Vec<Bounded>) -> Vec<Bounded> {
    values.into_iter().map(|value| value.greater(Bounded::ZERO)).collect()
}

/// The weights of the keys, `keys[source][EMBEDDING]`, for a query.
///
/// An error of a logit is a relative error of its weight; the errors of all logits, weighted, enter through the sum.
/// Products are summed with their rounding errors and compared with the largest, so that what is rounded is small.
pub fn attend(query: &[f32], keys: &[f32]) -> Vec<Bounded> {
    let scale = 1.0 / (EMBEDDING as f64).sqrt();
    // Sums with their errors leave errors of second order: of 128 products, each of 128 partial sums. That takes a device
    // that rounds additions and products to the nearest number.
    let second_order = (EMBEDDING * EMBEDDING) as f64 * ROUNDING * ROUNDING;
    let product = |key: &[f32]| {
        let terms = || query.iter().zip(key).map(|(q, k)| f64::from(*q) * f64::from(*k));
        let size: f64 = terms().map(f64::abs).sum();
        Bounded { value: terms().sum::<f64>() * scale, error: second_order * size * scale }
    };
    let logits: Vec<Bounded> = keys.chunks_exact(EMBEDDING).map(product).collect();
    let largest = logits.iter().fold(Bounded { value: f64::NEG_INFINITY, error: 0.0 }, |largest, logit| {
        if logit.value > largest.value { *logit } else { largest }
    });
    let scores: Vec<f64> = logits.iter().map(|logit| (logit.value - largest.value).exp()).collect();
    let sum: f64 = scores.iter().sum();
    // The difference from the largest is rounded five times: two differences, their sum, the scale (which is rounded
    // itself), and once more in the softmax; then there are the exponential, and the quotient by the largest score.
    let error = |logit: &Bounded| {
        let apart = (logit.value - largest.value).abs();
        logit.error + largest.error + 3.0 * ROUNDING * apart + 2.0 * ROUNDING + DIVISION
    };
    let errors: Vec<f64> = logits.iter().map(error).collect();
    let mean: f64 = errors.iter().zip(&scores).map(|(error, score)| error * score / sum).sum();
    // Additions, the reciprocal of the sum, and the product with it.
    let last = (scores.len() + 1) as f64 * ROUNDING + DIVISION;
    let weight = |(score, error): (&f64, &f64)| {
        let value = score / sum;
        Bounded { value, error: value * ((error + mean).exp_m1() + last) + NEGLIGIBLE }
    };
    scores.iter().zip(&errors).map(weight).collect()
}
