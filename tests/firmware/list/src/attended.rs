//! Weighting by attention, with parameters by a formula.

use crate::rig::{Rig, VIEWS};
use crate::{Emit, Inputs, emit_all};
use viewfuse_core::attention::{
    EMBEDDING, FlatEmbedding, FourierEmbedding, LearnedCrossAttention, Linear, PoseEmbedding, PoseSelfAttention,
    attend, cross_attention, learned_cross_attention, pose_features, pose_self_attention, published_cross_attention,
};

/// A layer with irregular parameters, smaller the more inputs there are.
fn layer<const I: usize, const O: usize>(inputs: Inputs, first: u32) -> Linear<I, O> {
    let mut layer = Linear::ZERO;
    let mut index = first;
    for parameter in layer.weight.as_flattened_mut().iter_mut().chain(&mut layer.bias) {
        // A multiplicative hash: cheaper than a sine, there are 15,000 of them.
        index = index.wrapping_mul(0x9e37_79b1).wrapping_add(0x7f4a_7c15);
        *parameter = ((index >> 8) as f32 * (2.0 / 16_777_216.0) - 1.0) * (3.0 + inputs.phase) / I as f32;
    }
    layer
}

/// The paper's embedding.
pub fn fourier(inputs: Inputs) -> FourierEmbedding {
    FourierEmbedding { first: layer(inputs, 1), second: layer(inputs, 2), third: layer(inputs, 3) }
}

/// The list of attention.
pub fn attention(inputs: Inputs, emit: Emit) {
    let Rig { sources, target } = Rig::around(inputs, 2.0);
    emit_all("pose_features", &pose_features(target.centre_world(), -target.forward_world()), emit);
    emit_all("published attention", published_cross_attention(&sources, &target).values(), emit);
    by_fourier(inputs, emit);
    by_flat(inputs, emit);
    learned(inputs, emit);
    by_self_attention(inputs, emit);
}

// One function a kind: the parameters lie on the stack, and those of one kind are gone before the next.

#[inline(never)]
fn by_fourier(inputs: Inputs, emit: Emit) {
    let Rig { sources, target } = Rig::around(inputs, 2.0);
    let fourier = fourier(inputs);
    let query = fourier.embed(&target);
    emit_all("embedding", &query, emit);
    emit_all("attention", cross_attention(&fourier, &sources, &target).values(), emit);
    let mut keys = [0.0; VIEWS * EMBEDDING];
    for (key, view) in keys.chunks_exact_mut(EMBEDDING).zip(0..) {
        for (key, feature) in key.iter_mut().zip(fourier.embed(sources.pose(view))) {
            *key = feature;
        }
    }
    emit_all("attend", attend::<VIEWS>(&query, &keys, VIEWS as u32).values(), emit);
}

#[inline(never)]
fn by_flat(inputs: Inputs, emit: Emit) {
    let Rig { sources, target } = Rig::around(inputs, 2.0);
    let flat = FlatEmbedding { first: layer(inputs, 4), second: layer(inputs, 5) };
    emit_all("flat embedding", &flat.embed(&target), emit);
    emit_all("flat attention", cross_attention(&flat, &sources, &target).values(), emit);
}

#[inline(never)]
fn learned(inputs: Inputs, emit: Emit) {
    let Rig { sources, target } = Rig::around(inputs, 2.0);
    let learned = LearnedCrossAttention { query: layer(inputs, 6), key: layer(inputs, 7) };
    emit_all("learned attention", learned_cross_attention(&learned, &sources, &target).values(), emit);
}

#[inline(never)]
fn by_self_attention(inputs: Inputs, emit: Emit) {
    let Rig { sources, target } = Rig::around(inputs, 2.0);
    let network = PoseSelfAttention {
        query: layer(inputs, 8),
        key: layer(inputs, 9),
        value: layer(inputs, 10),
        output: layer(inputs, 11),
        logit: layer(inputs, 12),
    };
    emit_all("self attention", pose_self_attention(&network, &sources, &target).values(), emit);
}
