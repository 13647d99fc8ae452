//! Camera weighting by attention: a pose is embedded as a vector, and a softmax of dot products (or a small network
//! over all sources) gives the weights.
//!
//! Source: "Pay Attention to Where You Looked", section 3 (learned weighting), and the three variants of its published
//! code (`cam_weighting.py`). Poses enter in OpenGL axes, and the "view direction" is the matrix's third column, the
//! *backward* axis: both as published, so that published parameters keep their meaning.
//!
//! Layer parameters are row-major `[output][input]` like PyTorch's; every sum starts from the bias and runs over the
//! inputs in order.

pub mod quantised;

use crate::fetch::{Fetch, StartingAt};
use crate::math::{has_finite_bits, max, sin_cos, sqrt, two_product, two_sum};
use crate::pose::Pose;
use crate::sources::Sources;
use crate::weights::Weights;
use glam::Vec3;

/// Frequencies of the Fourier features.
pub const FREQUENCY_COUNT: usize = 6;
/// Factor of the lowest frequency: frequency `k` is `1.5 * 2^k`.
pub const FREQUENCY_FACTOR: f32 = 1.5;
/// Length of a pose's feature vector: centre (3), sine and cosine of six frequencies (36), view direction (3).
pub const POSE_FEATURES: usize = 3 + 6 * FREQUENCY_COUNT + 3;
/// Width of the hidden layers of the paper's embeddings.
pub const HIDDEN: usize = 64;
/// Length of the paper's embeddings, `A`.
pub const EMBEDDING: usize = 128;
/// Heads of the published relative-pose self attention.
pub const HEADS: usize = 3;

/// Features of a camera: its centre `c`, then for `k = 0..6` the sines and the cosines of `1.5 * 2^k c`
/// (`sx sy sz cx cy cz`), then the backward axis. `[POSE_FEATURES]`, world units.
pub fn pose_features(centre: Vec3, backward: Vec3) -> [f32; POSE_FEATURES] {
    let c = [centre.x, centre.y, centre.z];
    let b = [backward.x, backward.y, backward.z];
    let mut features = [0.0; POSE_FEATURES];
    let mut axis = 0;
    while axis < 3 {
        features[axis] = c[axis];
        let mut frequency = FREQUENCY_FACTOR;
        let mut k = 0;
        while k < FREQUENCY_COUNT {
            let (sin, cos) = sin_cos(frequency * c[axis]);
            features[3 + 6 * k + axis] = sin;
            features[6 + 6 * k + axis] = cos;
            frequency *= 2.0;
            k += 1;
        }
        features[3 + 6 * FREQUENCY_COUNT + axis] = b[axis];
        axis += 1;
    }
    features
}

fn features_of(pose: &Pose) -> [f32; POSE_FEATURES] {
    pose_features(pose.centre_world(), -pose.forward_world())
}

/// An affine map `y = W x + b`, weights `[output][input]`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Linear<const I: usize, const O: usize> {
    /// `weight[output][input]`.
    pub weight: [[f32; I]; O],
    /// `bias[output]`; zeros for a layer without one.
    pub bias: [f32; O],
}

impl<const I: usize, const O: usize> Linear<I, O> {
    /// All parameters zero.
    pub const ZERO: Linear<I, O> = Linear { weight: [[0.0; I]; O], bias: [0.0; O] };

    fn flat(&self) -> impl Iterator<Item = f32> {
        self.weight.as_flattened().iter().chain(&self.bias).copied()
    }

    /// Takes the parameters from the front of a list and returns the rest of it.
    fn take_flat<'a>(&mut self, parameters: &'a [f32]) -> &'a [f32] {
        let target = self.weight.as_flattened_mut().iter_mut().chain(&mut self.bias);
        target.zip(parameters).for_each(|(target, parameter)| *target = *parameter);
        parameters.get(I * O + O..).unwrap_or_default()
    }

    /// `bias + weight x`, each sum from the bias through the inputs in order.
    pub fn apply(&self, x: &[f32; I]) -> [f32; O] {
        let mut y = self.bias;
        let mut output = 0;
        while output < O {
            let row = &self.weight[output];
            let mut sum = y[output];
            let mut input = 0;
            while input < I {
                sum += row[input] * x[input];
                input += 1;
            }
            y[output] = sum;
            output += 1;
        }
        y
    }

    /// As [`Linear::apply`], then the larger of the result and 0.
    pub fn apply_relu(&self, x: &[f32; I]) -> [f32; O] {
        let mut y = self.apply(x);
        let mut output = 0;
        while output < O {
            y[output] = max(y[output], 0.0);
            output += 1;
        }
        y
    }
}

/// How the paper's cross attention embeds a pose as [`EMBEDDING`] numbers.
pub trait PoseEmbedding {
    /// The embedding of a pose.
    fn embed(&self, pose: &Pose) -> [f32; EMBEDDING];
}

/// The paper's embedding: Fourier features of the centre and the view direction through three linear layers with ReLU
/// between them (none after the last).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct FourierEmbedding {
    /// Features to hidden.
    pub first: Linear<POSE_FEATURES, HIDDEN>,
    /// Hidden to hidden.
    pub second: Linear<HIDDEN, HIDDEN>,
    /// Hidden to embedding.
    pub third: Linear<HIDDEN, EMBEDDING>,
}

impl FourierEmbedding {
    /// How many parameters there are.
    pub const PARAMETERS: usize = size_of::<FourierEmbedding>() / size_of::<f32>();

    /// From its parameters in order: of each layer the weights, then the biases. Missing ones are 0.
    pub fn from_flat(parameters: &[f32]) -> FourierEmbedding {
        let mut embedding = FourierEmbedding { first: Linear::ZERO, second: Linear::ZERO, third: Linear::ZERO };
        let rest = embedding.first.take_flat(parameters);
        let rest = embedding.second.take_flat(rest);
        embedding.third.take_flat(rest);
        embedding
    }

    /// Its parameters in the order of [`FourierEmbedding::from_flat`].
    pub fn flat(&self) -> impl Iterator<Item = f32> {
        self.first.flat().chain(self.second.flat()).chain(self.third.flat())
    }
}

impl PoseEmbedding for FourierEmbedding {
    fn embed(&self, pose: &Pose) -> [f32; EMBEDDING] {
        self.third.apply(&self.second.apply_relu(&self.first.apply_relu(&features_of(pose))))
    }
}

/// The paper's second embedding: the 16 entries of the pose, row by row, through two linear layers with ReLU between.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct FlatEmbedding {
    /// Pose entries to hidden.
    pub first: Linear<16, HIDDEN>,
    /// Hidden to embedding.
    pub second: Linear<HIDDEN, EMBEDDING>,
}

impl PoseEmbedding for FlatEmbedding {
    fn embed(&self, pose: &Pose) -> [f32; EMBEDDING] {
        let m = pose.to_opengl();
        let mut flat = [0.0; 16];
        let mut entry = 0;
        while entry < 16 {
            flat[entry] = m[entry / 4][entry % 4];
            entry += 1;
        }
        self.second.apply(&self.first.apply_relu(&flat))
    }
}

/// The paper's cross-attention weighting: `softmax(E_t E_s^T / sqrt(A))` over the sources.
pub fn cross_attention<const S: usize>(
    embedding: &impl PoseEmbedding,
    sources: &Sources<S>,
    target: &Pose,
) -> Weights<S> {
    let query = embedding.embed(target);
    let count = sources.count();
    let (mut sums, mut rests) = ([0.0; S], [0.0; S]);
    let mut view = 0;
    while view < count {
        (sums[view as usize], rests[view as usize]) = product(&query, &embedding.embed(sources.pose(view)));
        view += 1;
    }
    softmax_of_products(&sums, &rests, count)
}

/// The same from embeddings that were computed before: of one pose as `queries[0..EMBEDDING]`, of `count` sources as
/// `keys[source][EMBEDDING]`, flat. `count` is limited to `[1, S]`.
pub fn attend<const S: usize>(
    queries: &(impl Fetch<f32> + ?Sized),
    keys: &(impl Fetch<f32> + ?Sized),
    count: u32,
) -> Weights<S> {
    const { assert!(S > 0) };
    let count = count.clamp(1, S as u32);
    let (mut sums, mut rests) = ([0.0; S], [0.0; S]);
    let mut view = 0;
    while view < count as usize {
        (sums[view], rests[view]) = product(queries, &StartingAt { all: keys, first: view * EMBEDDING });
        view += 1;
    }
    softmax_of_products(&sums, &rests, count)
}

/// The dot product of a query and a key, and its rounding error: an error of a logit is a relative error of its weight,
/// and 128 roundings of sums of 50 would cost 1e-5. The sum runs in order.
#[inline]
fn product(query: &(impl Fetch<f32> + ?Sized), key: &(impl Fetch<f32> + ?Sized)) -> (f32, f32) {
    let (mut sum, mut rest) = (0.0, 0.0);
    let mut feature = 0;
    while feature < EMBEDDING {
        let (product, lost) = two_product(query.fetch(feature), key.fetch(feature));
        let (total, carry) = two_sum(sum, product);
        sum = total;
        rest += carry + lost;
        feature += 1;
    }
    // Where products overflow there is no rest.
    (sum, if has_finite_bits(rest) { rest } else { 0.0 })
}

/// `softmax(products / sqrt(A))`. The largest is subtracted before anything is rounded again.
#[inline]
fn softmax_of_products<const S: usize>(sums: &[f32; S], rests: &[f32; S], count: u32) -> Weights<S> {
    // 1 / sqrt(128) = sqrt(2) / 16
    const SCALE: f32 = core::f32::consts::SQRT_2 / 16.0;
    const { assert!(EMBEDDING == 128) };
    let views = (count as usize).min(S);
    let (mut largest, mut largest_rest) = (f32::NEG_INFINITY, 0.0);
    let mut view = 0;
    while view < views {
        if sums[view] > largest {
            largest = sums[view];
            largest_rest = rests[view];
        }
        view += 1;
    }
    let mut logits = [0.0; S];
    view = 0;
    while view < views {
        // Equality first: infinity minus infinity is NaN.
        let apart = if sums[view] == largest { 0.0 } else { sums[view] - largest };
        logits[view] = (apart + (rests[view] - largest_rest)) * SCALE;
        view += 1;
    }
    Weights::from_logits(&logits, count)
}

/// The published cross attention without parameters: softmax of the dot products of the pose features themselves. Raw
/// centres enter the logits, which are not scaled: nearly one-hot for cameras far from the origin.
pub fn published_cross_attention<const S: usize>(sources: &Sources<S>, target: &Pose) -> Weights<S> {
    let query = features_of(target);
    softmax_over(sources, |source| dot(&query, &features_of(source)))
}

/// Parameters of the published learned cross attention.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct LearnedCrossAttention {
    /// Applied to the target's features (no bias).
    pub query: Linear<POSE_FEATURES, POSE_FEATURES>,
    /// Applied to each source's features (no bias).
    pub key: Linear<POSE_FEATURES, POSE_FEATURES>,
}

/// The published learned cross attention: softmax of `(Q f_t) . (K f_s)`, not scaled.
pub fn learned_cross_attention<const S: usize>(
    parameters: &LearnedCrossAttention,
    sources: &Sources<S>,
    target: &Pose,
) -> Weights<S> {
    let query = parameters.query.apply(&features_of(target));
    softmax_over(sources, |source| dot(&query, &parameters.key.apply(&features_of(source))))
}

/// Parameters of the published relative-pose self attention (PyTorch's `MultiheadAttention` with [`HEADS`] heads and a
/// linear map to one logit).
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct PoseSelfAttention {
    /// Rows 0..42 of `in_proj`.
    pub query: Linear<POSE_FEATURES, POSE_FEATURES>,
    /// Rows 42..84 of `in_proj`.
    pub key: Linear<POSE_FEATURES, POSE_FEATURES>,
    /// Rows 84..126 of `in_proj`.
    pub value: Linear<POSE_FEATURES, POSE_FEATURES>,
    /// `out_proj`.
    pub output: Linear<POSE_FEATURES, POSE_FEATURES>,
    /// `weight_calculation_layer`.
    pub logit: Linear<POSE_FEATURES, 1>,
}

/// The published relative-pose self attention: features of the target's pose in each source's frame
/// (`S^-1 T`, OpenGL axes) attend to one another; a linear map gives each source's logit. A single source has weight 1.
pub fn pose_self_attention<const S: usize>(
    parameters: &PoseSelfAttention,
    sources: &Sources<S>,
    target: &Pose,
) -> Weights<S> {
    const HEAD: usize = POSE_FEATURES / HEADS;
    let count = sources.count() as usize;
    let mut queries = [[0.0; POSE_FEATURES]; S];
    let mut keys = [[0.0; POSE_FEATURES]; S];
    let mut values = [[0.0; POSE_FEATURES]; S];
    let mut view = 0;
    while view < count {
        let features = relative_features(sources.pose(view as u32), target);
        queries[view] = parameters.query.apply(&features);
        keys[view] = parameters.key.apply(&features);
        values[view] = parameters.value.apply(&features);
        view += 1;
    }
    let scale = 1.0 / sqrt(HEAD as f32);
    let mut logits = [0.0; S];
    view = 0;
    while view < count {
        let mut attended = [0.0; POSE_FEATURES];
        let mut head = 0;
        while head < HEADS {
            let mut scores = [0.0; S];
            let mut other = 0;
            while other < count {
                let mut sum = 0.0;
                let mut feature = head * HEAD;
                while feature < (head + 1) * HEAD {
                    sum += queries[view][feature] * keys[other][feature];
                    feature += 1;
                }
                scores[other] = sum * scale;
                other += 1;
            }
            let attention = Weights::from_logits(&scores, count as u32);
            let mut feature = head * HEAD;
            while feature < (head + 1) * HEAD {
                let mut sum = 0.0;
                other = 0;
                while other < count {
                    sum += attention.get(other as u32) * values[other][feature];
                    other += 1;
                }
                attended[feature] = sum;
                feature += 1;
            }
            head += 1;
        }
        logits[view] = parameters.logit.apply(&parameters.output.apply(&attended))[0];
        view += 1;
    }
    Weights::from_logits(&logits, count as u32)
}

/// Features of the target's pose in the source camera's frame, OpenGL axes.
fn relative_features(source: &Pose, target: &Pose) -> [f32; POSE_FEATURES] {
    // OpenCV camera axes to OpenGL camera axes: y and z change sign.
    let centre = source.to_camera(target.centre_world());
    let backward = -target.forward_world();
    let backward = Vec3::new(
        source.right_world().dot(backward),
        -source.down_world().dot(backward),
        -source.forward_world().dot(backward),
    );
    pose_features(Vec3::new(centre.x, -centre.y, -centre.z), backward)
}

fn softmax_over<const S: usize>(sources: &Sources<S>, logit: impl Fn(&Pose) -> f32) -> Weights<S> {
    let mut logits = [0.0; S];
    let mut view = 0;
    while view < sources.count() {
        logits[view as usize] = logit(sources.pose(view));
        view += 1;
    }
    Weights::from_logits(&logits, sources.count())
}

fn dot<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    let mut sum = 0.0;
    let mut i = 0;
    while i < N {
        sum += a[i] * b[i];
        i += 1;
    }
    sum
}
