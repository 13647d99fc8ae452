//! Learned attention with parameters of 8 bits: made from those of 32 bits, bounded, and written as Rust for firmware.
//!
//! A row of weights becomes whole numbers from -127 to 127 times one scale, the largest weight's part of 127.
//! Everything is computed in `f64`.
//!
//! The bound: the network with the rounded weights is evaluated in `f64` beside the exact one; that is the larger part
//! of the change. What remains is how far a processor's numbers may be from that: with inputs known to `e`, a layer's
//! outputs are known to
//!
//! ```text
//! |y' - y| <= |W'| (e + step / 2) + rounding,     step = max (|x| + e) / 32767
//! ```
//!
//! A ReLU does not make this larger. The same for keys, products and offsets bounds each logit, and so each weight of
//! the softmax.

use viewfuse_core::attention::quantised::{
    FOUR, MAX_LEVEL, MIN_INPUT, QuantisedAttention, QuantisedLinear, feature_error,
};
use viewfuse_core::attention::{EMBEDDING, FourierEmbedding, HIDDEN, pose_features};
use viewfuse_core::pose::Pose;
use viewfuse_core::sources::Sources;

/// The largest weight of 8 bits.
const MAX_WEIGHT: f64 = 127.0;
/// Sums of magnitudes from which on one of `f32` may overflow before it is added up.
const MAX_SIZE: f64 = 1.0e36;
/// Roundings of an output in `f32`: four of them, each of half a unit in the last place, and their products.
const ROUNDING: f64 = 5.0 / 16_777_216.0;

/// An affine map in `f64`, row by row.
struct Layer {
    rows: Vec<Vec<f64>>,
    bias: Vec<f64>,
}

impl Layer {
    fn of(rows: &[impl AsRef<[f32]>], bias: &[f32]) -> Layer {
        let wide = |numbers: &[f32]| numbers.iter().map(|number| f64::from(*number)).collect::<Vec<f64>>();
        Layer { rows: rows.iter().map(|row| wide(row.as_ref())).collect(), bias: wide(bias) }
    }

    /// What the folded last layer is: `G` and `g` of [`viewfuse_core::attention::quantised`].
    fn folded(embedding: &FourierEmbedding) -> [Layer; 2] {
        let third = Layer::of(&embedding.third.weight, &embedding.third.bias);
        let scale = 1.0 / (EMBEDDING as f64).sqrt();
        let column = |input: usize| third.rows.iter().map(move |row| row[input]);
        let with = |a: usize, other: &mut dyn Iterator<Item = f64>| {
            column(a).zip(other).map(|(a, b)| a * b).sum::<f64>() * scale
        };
        let gram = |a: usize| (0..HIDDEN).map(|b| with(a, &mut column(b))).collect();
        let offset = (0..HIDDEN).map(|a| with(a, &mut third.bias.iter().copied())).collect();
        [
            Layer { rows: (0..HIDDEN).map(gram).collect(), bias: vec![0.0; HIDDEN] },
            Layer { rows: vec![offset], bias: vec![0.0] },
        ]
    }

    fn quantised<const P: usize, const N: usize, const B: usize>(&self) -> QuantisedLinear<P, N, B> {
        let mut layer = QuantisedLinear::ZERO;
        for (output, (row, bias)) in self.rows.iter().zip(&self.bias).enumerate().take(FOUR * B) {
            let (block, place) = (output / FOUR, output % FOUR);
            let (scale, levels) = levels(row);
            layer.scale[block][place] = scale;
            layer.bias[block][place] = *bias as f32;
            for (input, level) in levels.into_iter().enumerate().take(2 * P * N) {
                layer.weight[block][input / (2 * P)][input / 2 % P][input % 2][place] = level;
            }
        }
        layer
    }

    /// The outputs of exact inputs.
    fn apply(&self, inputs: &[f64]) -> Vec<f64> {
        let row = |(row, bias): (&Vec<f64>, &f64)| bias + row.iter().zip(inputs).map(|(w, x)| w * x).sum::<f64>();
        self.rows.iter().zip(&self.bias).map(row).collect()
    }

    /// The outputs with other weights, by output and input, and how far those of a processor may be from them.
    fn known(&self, used: impl Fn(usize, usize) -> f64, inputs: &[Known]) -> Vec<Known> {
        let inputs = as_levels(inputs);
        let row = |(output, bias): (usize, &f64)| {
            let (mut value, mut error, mut size) = (*bias, 0.0, bias.abs());
            for (input, x) in inputs.iter().enumerate() {
                let used = used(output, input);
                value += used * x.value;
                error += used.abs() * x.error;
                size += used.abs() * (x.value.abs() + x.error);
            }
            Known { value, error: error + ROUNDING * size }
        };
        self.bias.iter().enumerate().map(row).collect()
    }
}

/// The scale of a row, and its weights as whole multiples of it.
fn levels(row: &[f64]) -> (f32, Vec<i8>) {
    let largest = row.iter().fold(0.0_f64, |largest, weight| largest.max(weight.abs()));
    let scale = (largest / MAX_WEIGHT) as f32;
    let level = |weight: &f64| if scale > 0.0 { (weight / f64::from(scale)).round() } else { 0.0 };
    (scale, row.iter().map(|weight| level(weight).clamp(-MAX_WEIGHT, MAX_WEIGHT) as i8).collect())
}

/// The weights that a layer uses, by output and input.
fn used<const P: usize, const N: usize, const B: usize>(
    layer: &QuantisedLinear<P, N, B>,
) -> impl Fn(usize, usize) -> f64 {
    |output, input| {
        let (block, place) = (output / FOUR, output % FOUR);
        f64::from(layer.scale[block][place])
            * f64::from(layer.weight[block][input / (2 * P)][input / 2 % P][input % 2][place])
    }
}

/// A number, and how far the one that is used instead may be from it.
#[derive(Clone, Copy)]
struct Known {
    value: f64,
    error: f64,
}

impl Known {
    fn rectified(self) -> Known {
        // Where both are certainly negative, both are 0.
        let error = if self.value + self.error <= 0.0 { 0.0 } else { self.error };
        Known { value: self.value.max(0.0), error }
    }
}

/// The same numbers as whole multiples of one step. What is exactly 0 stays so.
fn as_levels(numbers: &[Known]) -> Vec<Known> {
    let largest = numbers.iter().fold(0.0_f64, |largest, x| largest.max(x.value.abs() + x.error));
    let step = largest / f64::from(MAX_LEVEL);
    let least = if largest <= f64::from(MIN_INPUT) { f64::from(MIN_INPUT) } else { 0.0 };
    let level = |x: &Known| match x.value == 0.0 && x.error == 0.0 {
        true => *x,
        false => Known { value: x.value, error: x.error + (0.5 + 1.0e-3) * step + least },
    };
    numbers.iter().map(level).collect()
}

/// The parameters of a Fourier embedding with 8 bits a weight.
pub fn quantised(embedding: &FourierEmbedding) -> QuantisedAttention {
    let [key, offset] = Layer::folded(embedding);
    let (offset_scale, levels) = levels(&offset.rows[0]);
    let mut offset = [0; HIDDEN];
    offset.copy_from_slice(&levels);
    QuantisedAttention {
        first: Layer::of(&embedding.first.weight, &embedding.first.bias).quantised(),
        second: Layer::of(&embedding.second.weight, &embedding.second.bias).quantised(),
        key: key.quantised(),
        offset,
        offset_scale,
    }
}

/// How far the weights of a call with 8 bits may be from the exact ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// The most that a logit changes, apart from what is the same for all of them.
    pub logit: f64,
    /// The most that a weight changes.
    pub weight: f64,
}

/// A network's three layers and the offset in `f64`.
struct Network {
    first: Layer,
    second: Layer,
    key: Layer,
    offset: Layer,
}

impl Network {
    fn of(embedding: &FourierEmbedding) -> Network {
        let [key, offset] = Layer::folded(embedding);
        Network {
            first: Layer::of(&embedding.first.weight, &embedding.first.bias),
            second: Layer::of(&embedding.second.weight, &embedding.second.bias),
            key,
            offset,
        }
    }

    fn hidden(&self, features: &[f64]) -> Vec<f64> {
        let rectified = |x: Vec<f64>| x.into_iter().map(|x| x.max(0.0)).collect::<Vec<f64>>();
        rectified(self.second.apply(&rectified(self.first.apply(features))))
    }

    fn known_hidden(&self, quantised: &QuantisedAttention, features: &[f64]) -> Vec<Known> {
        let feature =
            |(feature, value): (usize, &f64)| Known { value: *value, error: f64::from(feature_error(feature)) };
        let features: Vec<Known> = features.iter().enumerate().map(feature).collect();
        let rectified = |x: Vec<Known>| x.into_iter().map(Known::rectified).collect::<Vec<Known>>();
        let first = rectified(self.first.known(used(&quantised.first), &features));
        rectified(self.second.known(used(&quantised.second), &first))
    }
}

/// Bounds the change of the weights of these sources for this target, from the parameters and the poses alone, but for
/// the roundings of the network that is not quantised. Where cameras are so far away that `f32` may overflow on the way
/// (from some 1e18 units on), nothing is known: the bound is infinite for a logit, and 1 for a weight.
pub fn change_bound<const S: usize>(
    embedding: &FourierEmbedding,
    quantised: &QuantisedAttention,
    sources: &Sources<S>,
    target: &Pose,
) -> Change {
    let network = Network::of(embedding);
    let features = |pose: &Pose| pose_features(pose.centre_world(), -pose.forward_world()).map(f64::from);
    let exact_target = network.hidden(&features(target));
    let known_target = as_levels(&network.known_hidden(quantised, &features(target)));
    let offset_weight = |_, input: usize| f64::from(quantised.offset_scale) * f64::from(quantised.offset[input]);
    let (mut exact, mut known) = (Vec::new(), Vec::new());
    for view in 0..sources.count() {
        let features = features(sources.pose(view));
        let hidden = network.hidden(&features);
        let keys = network.key.apply(&hidden);
        let offset = network.offset.apply(&hidden)[0];
        exact.push(offset + exact_target.iter().zip(&keys).map(|(x, key)| x * key).sum::<f64>());
        let hidden = network.known_hidden(quantised, &features);
        let keys = as_levels(&network.key.known(used(&quantised.key), &hidden));
        let mut logit = network.offset.known(offset_weight, &hidden)[0];
        let mut size = logit.value.abs();
        for (x, key) in known_target.iter().zip(&keys) {
            logit.value += x.value * key.value;
            logit.error += x.value.abs() * key.error + (key.value.abs() + key.error) * x.error;
            size += (x.value.abs() + x.error) * (key.value.abs() + key.error);
        }
        if !(size < MAX_SIZE) {
            return Change { logit: f64::INFINITY, weight: 1.0 };
        }
        known.push(Known { value: logit.value, error: logit.error + ROUNDING * size });
    }
    let logit = exact.iter().zip(&known).map(|(exact, known)| (known.value - exact).abs() + known.error);
    Change {
        logit: logit.fold(0.0, f64::max),
        weight: (0..exact.len()).map(|view| weight_change(&exact, &known, view)).fold(0.0, f64::max),
    }
}

/// The most that one weight of a softmax changes: its logit at one end of what is known, all others at the other end.
fn weight_change(exact: &[f64], known: &[Known], view: usize) -> f64 {
    let weight = |logits: &[f64]| {
        let largest = logits.iter().fold(f64::NEG_INFINITY, |largest, logit| largest.max(*logit));
        (logits[view] - largest).exp() / logits.iter().map(|logit| (logit - largest).exp()).sum::<f64>()
    };
    let before = weight(exact);
    let at = |sign: f64| {
        let shifted = |(other, logit): (usize, &Known)| {
            logit.value + if other == view { sign * logit.error } else { -sign * logit.error }
        };
        weight(&known.iter().enumerate().map(shifted).collect::<Vec<f64>>())
    };
    (at(1.0) - before).abs().max((at(-1.0) - before).abs())
}

/// Rust's source of the parameters: a constant named `ATTENTION`, for a firmware that depends on `viewfuse-core`.
/// `origin` names where they are from, in a comment.
pub fn rust_source(parameters: &QuantisedAttention, origin: &str) -> String {
    let QuantisedAttention { first, second, key, offset, offset_scale } = parameters;
    let layers = [layer("first", first), layer("second", second), layer("key", key)];
    format!(
        "// The attention weighting of {origin} with 8 bits a weight, written by viewfuse {version}.\n\
         use viewfuse_core::attention::quantised::{{QuantisedAttention, QuantisedLinear}};\n\n\
         /// Learned attention: a constant, which stays in flash memory.\n\
         #[rustfmt::skip]\n\
         pub static ATTENTION: QuantisedAttention = QuantisedAttention {{\n{layers}    offset: {offset:?},\n    \
         offset_scale: {offset_scale:?},\n}};\n",
        // What would end the comment.
        origin = origin.replace(char::is_control, " "),
        version = env!("CARGO_PKG_VERSION"),
        layers = layers.concat(),
    )
}

fn layer<const P: usize, const N: usize, const B: usize>(name: &str, layer: &QuantisedLinear<P, N, B>) -> String {
    let rows: String = layer.weight.iter().map(|row| format!("            {row:?},\n")).collect();
    format!(
        "    {name}: QuantisedLinear {{\n        weight: [\n{rows}        ],\n        scale: {:?},\n        bias: \
            {:?},\n    }},\n",
        layer.scale, layer.bias
    )
}
