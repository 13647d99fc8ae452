//! The paper's cross attention with parameters of 8 bits, for firmware: 12.6 kB instead of 60 kB, and whole numbers in
//! its sums.
//!
//! The last layer of the embedding, `E = W h + b`, has no ReLU behind it, so the product of two embeddings is a product
//! of the hidden numbers `h`. With `A` the length of an embedding, `G = W^T W / sqrt(A)` and `g = W^T b / sqrt(A)`:
//!
//! ```text
//! E_t . E_s / sqrt(A)  =  h_t . G h_s  +  g . h_s  +  (g . h_t + b . b / sqrt(A))
//! ```
//!
//! The softmax over the sources does not see what is the same for all of them, the bracket. `G h_s` is a source's key
//! and `g . h_s` its offset: both are computed once, and a further target costs two layers and a product with each key.
//!
//! Weights of a layer are whole numbers of 8 bits times a scale a row (symmetric), layers' inputs are whole numbers of
//! 16 bits times one scale, sums are exact in 32 bits (keys' products in 64). All targets give the same bits, those
//! without an FPU as well. `viewfuse-weighting` makes the parameters from an attention file and bounds how much the
//! weights change.

use super::{FREQUENCY_COUNT, FREQUENCY_FACTOR, HIDDEN, POSE_FEATURES, pose_features};
use crate::math::{abs, sin_cos};
use crate::pose::Pose;
use crate::sources::Sources;
use crate::weights::Weights;

/// Outputs are taken by fours.
pub const FOUR: usize = 4;
/// Cameras with coordinates of at most this: the angles are those for which sines and cosines are known.
pub const DOUBLED_WITHIN: f32 = 160.0;
/// Fours of a hidden layer's outputs.
pub const HIDDEN_FOURS: usize = HIDDEN / FOUR;
/// A pose's features are so many steps of so many pairs.
pub const FEATURE_STEPS: usize = 3;
/// As [`FEATURE_STEPS`].
pub const FEATURE_PAIRS: usize = POSE_FEATURES / 2 / FEATURE_STEPS;
/// Hidden numbers are so many steps of so many pairs.
pub const HIDDEN_STEPS: usize = 4;
/// As [`HIDDEN_STEPS`].
pub const HIDDEN_PAIRS: usize = HIDDEN / 2 / HIDDEN_STEPS;
/// The largest whole number that a layer's input becomes.
pub const MAX_LEVEL: f32 = 32_767.0;
/// Inputs that are all smaller count as 0: the quotient would not be finite.
pub const MIN_INPUT: f32 = 1.0e-30;

/// The features of [`super::pose_features`]. Where the angles are small enough, the sines and cosines of a double angle
/// follow from those before; [`feature_error`] bounds by how much they differ.
#[inline(never)]
fn features(pose: &Pose) -> [f32; POSE_FEATURES] {
    let (centre, backward) = (pose.centre_world(), -pose.forward_world());
    let c = [centre.x, centre.y, centre.z];
    if !(abs(c[0]) <= DOUBLED_WITHIN && abs(c[1]) <= DOUBLED_WITHIN && abs(c[2]) <= DOUBLED_WITHIN) {
        return pose_features(centre, backward);
    }
    let b = [backward.x, backward.y, backward.z];
    let mut features = [0.0; POSE_FEATURES];
    let mut axis = 0;
    while axis < 3 {
        features[axis] = c[axis];
        let (mut sin, mut cos) = sin_cos(FREQUENCY_FACTOR * c[axis]);
        let mut k = 0;
        while k < FREQUENCY_COUNT {
            features[3 + 6 * k + axis] = sin;
            features[6 + 6 * k + axis] = cos;
            (sin, cos) = (2.0 * sin * cos, 1.0 - 2.0 * sin * sin);
            k += 1;
        }
        features[3 + 6 * FREQUENCY_COUNT + axis] = b[axis];
        axis += 1;
    }
    features
}

/// How far a feature may be from that of [`super::pose_features`]: with an error `e` of sine and cosine each, those of
/// the double angle are known to `2 sqrt(2) e` and the roundings.
pub fn feature_error(feature: usize) -> f32 {
    let is_angle = (3..3 + 6 * FREQUENCY_COUNT).contains(&feature);
    // Both ways of computing are known to 9e-8 at the first frequency.
    let mut error = 1.8e-7;
    let mut k = 3;
    while is_angle && k + 6 <= feature {
        error = 2.83 * error + 2.0e-7;
        k += 6;
    }
    if is_angle && feature >= 9 { error } else { 0.0 }
}

/// An affine map with weights of 8 bits from `2 P N` inputs, which are taken in `N` steps of `P` pairs, to `4 B`
/// outputs: `y[o] = bias[o] + scale[o] * sum over i of weight[o][i] x[i]`. The weights of four outputs stand together,
/// so that the four read an input once.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct QuantisedLinear<const P: usize, const N: usize, const B: usize> {
    /// From -127 to 127: `weight[output / 4][step][pair][input % 2][output % 4]`.
    pub weight: [[[[[i8; FOUR]; 2]; P]; N]; B],
    /// What a weight of 1 stands for, `scale[output / 4][output % 4]`.
    pub scale: [[f32; FOUR]; B],
    /// `bias[output / 4][output % 4]`; zeros for a layer without one.
    pub bias: [[f32; FOUR]; B],
}

/// Numbers as whole multiples of one scale, 16 bits each.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Levels<const P: usize, const N: usize> {
    /// Two in a word, the first in the lower half: a processor with products of halves reads both at once.
    pairs: [[u32; P]; N],
    scale: f32,
}

/// The two numbers of a word.
#[inline(always)]
fn halves(pair: u32) -> (i32, i32) {
    (pair as i16 as i32, pair as i32 >> 16)
}

impl<const P: usize, const N: usize> Levels<P, N> {
    const ZERO: Levels<P, N> = Levels { pairs: [[0; P]; N], scale: 0.0 };

    /// Becomes the nearest levels of `2 P N` numbers, the `largest` of which becomes [`MAX_LEVEL`].
    #[inline(never)]
    fn fill(&mut self, numbers: &[f32], largest: f32) {
        // 1.5 * 2^23: adding it rounds to a whole number, which the last bits are.
        const WHOLE: f32 = 12_582_912.0;
        let is_small = !(largest > MIN_INPUT);
        let factor = if is_small { 0.0 } else { MAX_LEVEL / largest };
        self.scale = if is_small { 0.0 } else { largest * (1.0 / MAX_LEVEL) };
        let level = |number: f32| (number * factor + WHOLE).to_bits().wrapping_sub(WHOLE.to_bits());
        for (pair, two) in self.pairs.as_flattened_mut().iter_mut().zip(numbers.chunks_exact(2)) {
            *pair = (level(two[0]) & 0xffff) | (level(two[1]) << 16);
        }
    }
}

/// Adds the products of two inputs.
#[inline(always)]
fn add_two(sums: &mut [i32; FOUR], [first, second]: &[[i8; FOUR]; 2], pair: u32) {
    let (x, y) = halves(pair);
    sums[0] += first[0] as i32 * x + second[0] as i32 * y;
    sums[1] += first[1] as i32 * x + second[1] as i32 * y;
    sums[2] += first[2] as i32 * x + second[2] as i32 * y;
    sums[3] += first[3] as i32 * x + second[3] as i32 * y;
}

impl<const P: usize, const N: usize, const B: usize> QuantisedLinear<P, N, B> {
    /// All parameters zero.
    pub const ZERO: QuantisedLinear<P, N, B> =
        QuantisedLinear { weight: [[[[[0; FOUR]; 2]; P]; N]; B], scale: [[0.0; FOUR]; B], bias: [[0.0; FOUR]; B] };

    /// Stores the outputs, or the larger of each and 0, and returns the largest absolute value of what was stored.
    ///
    /// Worst case: `8 P N B` products of whole numbers, whatever the inputs are; their sums are exact.
    #[inline(never)]
    fn apply<const RECTIFIED: bool>(&self, inputs: &Levels<P, N>, outputs: &mut [[f32; FOUR]; B]) -> f32 {
        // 512 products of 8 and 16 bits fit into 31.
        const { assert!(P <= 8 && 2 * P * N <= 512) };
        // As bits: numbers that are not negative are in the order of their bits.
        let mut largest = 0;
        let mut block = 0;
        while block < B {
            let mut sums = [0; FOUR];
            for (w, pairs) in self.weight[block].iter().zip(&inputs.pairs) {
                // Said one by one: a loop would be kept where code is small.
                if P > 0 {
                    add_two(&mut sums, &w[0], pairs[0]);
                }
                if P > 1 {
                    add_two(&mut sums, &w[1], pairs[1]);
                }
                if P > 2 {
                    add_two(&mut sums, &w[2], pairs[2]);
                }
                if P > 3 {
                    add_two(&mut sums, &w[3], pairs[3]);
                }
                if P > 4 {
                    add_two(&mut sums, &w[4], pairs[4]);
                }
                if P > 5 {
                    add_two(&mut sums, &w[5], pairs[5]);
                }
                if P > 6 {
                    add_two(&mut sums, &w[6], pairs[6]);
                }
                if P > 7 {
                    add_two(&mut sums, &w[7], pairs[7]);
                }
            }
            let (scale, bias) = (&self.scale[block], &self.bias[block]);
            let mut output = |row: usize| {
                let bits = (bias[row] + scale[row] * inputs.scale * sums[row] as f32).to_bits();
                let bits = if RECTIFIED && bits >> 31 == 1 { 0 } else { bits };
                largest = largest.max(bits & 0x7fff_ffff);
                f32::from_bits(bits)
            };
            outputs[block] = [output(0), output(1), output(2), output(3)];
            block += 1;
        }
        f32::from_bits(largest)
    }
}

/// Parameters of the paper's cross attention on Fourier features, the last layer folded into products of hidden
/// numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct QuantisedAttention {
    /// Features to hidden.
    pub first: QuantisedLinear<FEATURE_PAIRS, FEATURE_STEPS, HIDDEN_FOURS>,
    /// Hidden to hidden.
    pub second: QuantisedLinear<HIDDEN_PAIRS, HIDDEN_STEPS, HIDDEN_FOURS>,
    /// `G`: hidden numbers of a source to its key. Without a bias.
    pub key: QuantisedLinear<HIDDEN_PAIRS, HIDDEN_STEPS, HIDDEN_FOURS>,
    /// `g`: hidden numbers of a source to its offset, from -127 to 127.
    pub offset: [i8; HIDDEN],
    /// What an offset's weight of 1 stands for.
    pub offset_scale: f32,
}

impl QuantisedAttention {
    /// All parameters zero: equal weights.
    pub const ZERO: QuantisedAttention = QuantisedAttention {
        first: QuantisedLinear::ZERO,
        second: QuantisedLinear::ZERO,
        key: QuantisedLinear::ZERO,
        offset: [0; HIDDEN],
        offset_scale: 0.0,
    };

    /// The hidden numbers of a pose, none of them negative.
    ///
    /// Worst case: 18 sines and cosines (3 for cameras within [`DOUBLED_WITHIN`]), 6,784 products of whole numbers.
    fn hidden(&self, pose: &Pose, hidden: &mut Levels<HIDDEN_PAIRS, HIDDEN_STEPS>) {
        let features = features(pose);
        let mut largest = 0;
        for feature in &features {
            largest = largest.max(feature.to_bits() & 0x7fff_ffff);
        }
        let mut inputs = Levels::<FEATURE_PAIRS, FEATURE_STEPS>::ZERO;
        inputs.fill(&features, f32::from_bits(largest));
        let mut outputs = [[0.0; FOUR]; HIDDEN_FOURS];
        let largest = self.first.apply::<true>(&inputs, &mut outputs);
        hidden.fill(outputs.as_flattened(), largest);
        let largest = self.second.apply::<true>(hidden, &mut outputs);
        hidden.fill(outputs.as_flattened(), largest);
    }
}

/// What the sources are to every target: computed once, whatever the targets. 16 bits a number.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SourceKeys<const S: usize> {
    keys: [Levels<HIDDEN_PAIRS, HIDDEN_STEPS>; S],
    offsets: [f32; S],
    count: u32,
}

impl<const S: usize> SourceKeys<S> {
    /// The keys of all sources.
    ///
    /// Worst case: as many sources as there are, each 10,944 products of whole numbers, 18 sines and cosines.
    pub fn new(parameters: &QuantisedAttention, sources: &Sources<S>) -> SourceKeys<S> {
        const { assert!(S > 0) };
        let mut keys_of_sources = SourceKeys { keys: [Levels::ZERO; S], offsets: [0.0; S], count: sources.count() };
        let mut hidden = Levels::ZERO;
        let mut outputs = [[0.0; FOUR]; HIDDEN_FOURS];
        let mut view = 0;
        while view < sources.count() {
            parameters.hidden(sources.pose(view), &mut hidden);
            let largest = parameters.key.apply::<false>(&hidden, &mut outputs);
            keys_of_sources.keys[view as usize].fill(outputs.as_flattened(), largest);
            let mut sum = 0;
            for (weight, pair) in parameters.offset.chunks_exact(2).zip(hidden.pairs.as_flattened()) {
                let (x, y) = halves(*pair);
                sum += weight[0] as i32 * x + weight[1] as i32 * y;
            }
            keys_of_sources.offsets[view as usize] = parameters.offset_scale * hidden.scale * sum as f32;
            view += 1;
        }
        keys_of_sources
    }

    /// The weights of the sources for a target. Where hidden numbers overflow they are weights that mean nothing.
    ///
    /// Worst case: 6,784 products of whole numbers for the target and 64 for each source; then a softmax.
    pub fn weigh(&self, parameters: &QuantisedAttention, target: &Pose) -> Weights<S> {
        let mut hidden = Levels::ZERO;
        parameters.hidden(target, &mut hidden);
        let mut logits = [0.0; S];
        let mut view = 0;
        while view < (self.count as usize).min(S) {
            let key = &self.keys[view];
            let mut sum = 0_i64;
            for (pair_of_key, pair) in key.pairs.as_flattened().iter().zip(hidden.pairs.as_flattened()) {
                let ((a, b), (x, y)) = (halves(*pair_of_key), halves(*pair));
                // 15 bits and a sign each: a product fits into 31 bits.
                sum += i64::from(a * x);
                sum += i64::from(b * y);
            }
            logits[view] = self.offsets[view] + hidden.scale * key.scale * sum as f32;
            view += 1;
        }
        Weights::from_logits(&logits, self.count)
    }
}

/// The paper's cross-attention weighting with parameters of 8 bits. For more than one target of the same sources, keep
/// the [`SourceKeys`].
pub fn quantised_attention<const S: usize>(
    parameters: &QuantisedAttention,
    sources: &Sources<S>,
    target: &Pose,
) -> Weights<S> {
    SourceKeys::new(parameters, sources).weigh(parameters, target)
}
