//! Everything but attention.

use crate::denoised::denoising;
use crate::rig::{Rig, VIEWS, schemes};
use crate::{Emit, Inputs, emit_all, wave};
use viewfuse_core::composite::{Composite, Compositor};
use viewfuse_core::depths::{inverse_cdf, stratified_depth};
use viewfuse_core::fuse::{fuse_views, fuse_visible};
use viewfuse_core::math::{angle_from_components, exp, norm3, sin_cos, sqrt};
use viewfuse_core::random::{threefry_2x32, uniform};
use viewfuse_core::weighting::{Scheme, weigh};
use viewfuse_core::weights::Weights;

/// Channels of a latent.
pub const CHANNELS: usize = 16;
/// Samples on a ray.
pub const SAMPLES: usize = 64;

/// The list without attention.
pub fn formulas(inputs: Inputs, emit: Emit) {
    elementary(inputs, emit);
    weights(inputs, emit);
    limits(inputs, emit);
    fusion(inputs, emit);
    ray(inputs, emit);
    depths(inputs, emit);
    random(inputs, emit);
    denoising(inputs, emit);
}

fn elementary(inputs: Inputs, emit: Emit) {
    for step in 0..40 {
        let at = step as f32 - 19.5 + inputs.phase;
        let (sin, cos) = sin_cos(4.6 * at);
        emit("sin", sin);
        emit("cos", cos);
        emit("exp", exp(4.3 * at));
        // From 1e-36 to 1e36.
        emit("sqrt", sqrt(exp(4.2 * at)));
        emit("angle", angle_from_components(exp(at), 3.0 * sin));
        emit("norm3", norm3(exp(3.9 * at), exp(-3.9 * at), sin));
    }
    // The least subnormal number, the greatest one, and the ends.
    for bits in [0x0000_0001, 0x0000_0123, 0x007f_ffff, 0x0080_0000, 0x7f7f_ffff] {
        emit("sqrt", sqrt(f32::from_bits(core::hint::black_box(bits))));
    }
}

fn weights(inputs: Inputs, emit: Emit) {
    // Far out the formulas take other ways, and very near the squares vanish; a great beta needs small distances.
    for scale in [2.0, 1.0e-3, 1.0e8, 1.0e24, 1.0e-18] {
        every_scheme(&Rig::around(inputs, scale), emit);
    }
    every_scheme(&Rig::at_a_source(inputs), emit);
    for entry in Rig::around(inputs, 2.0).target.to_opencv().as_flattened() {
        emit("pose", *entry);
    }
}

fn every_scheme(rig: &Rig, emit: Emit) {
    for (name, scheme) in schemes() {
        emit_all(name, weigh(scheme, &rig.sources, &rig.target).values(), emit);
    }
}

fn limits(inputs: Inputs, emit: Emit) {
    let mut scores = [0.0; VIEWS];
    for (view, score) in scores.iter_mut().enumerate() {
        *score = 20.0 * wave(inputs, view as u32);
    }
    emit_all("from_logits", Weights::from_logits(&scores, 7).values(), emit);
    emit_all("from_scores", Weights::from_scores(&scores, 8).values(), emit);
    scores[3] = f32::NAN;
    scores[5] = f32::INFINITY;
    let weights = Weights::from_scores(&scores, 8);
    emit_all("from_scores", weights.values(), emit);
    let weights = Weights::from_errors(&scores, 8);
    emit_all("from_errors", weights.values(), emit);
    for total in [0.05, 0.2, 0.5] {
        let omission = Weights::from_errors(&scores, 8).without_least(total);
        emit("omitted", omission.omitted_weight);
        emit_all("without_least", omission.weights.values(), emit);
    }
}

/// Eight latents.
pub fn latents(inputs: Inputs) -> [[f32; CHANNELS]; VIEWS] {
    let mut latents = [[0.0; CHANNELS]; VIEWS];
    for (index, value) in latents.as_flattened_mut().iter_mut().enumerate() {
        *value = 3.0 * wave(inputs, 100 + index as u32);
    }
    latents
}

/// How much each view sees of a point: the first nothing, the last everything.
pub fn visibility() -> [f32; VIEWS] {
    let mut visibility = [0.0; VIEWS];
    for (view, seen) in visibility.iter_mut().enumerate() {
        *seen = view as f32 / (VIEWS - 1) as f32;
    }
    visibility
}

fn fusion(inputs: Inputs, emit: Emit) {
    let rig = Rig::around(inputs, 2.0);
    let (weights, latents) = (weigh(Scheme::ERROR, &rig.sources, &rig.target), latents(inputs));
    emit_all("fuse_views", &fuse_views(&weights, &latents), emit);
    emit_all("fuse_visible", &fuse_visible(&weights, &visibility(), &latents, [0.0; CHANNELS]), emit);
    emit_all("fuse_unseen", &fuse_visible(&weights, &[0.0; VIEWS], &latents, latents[1]), emit);
}

/// Samples of a ray: red, green, blue and optical depth.
pub fn samples(inputs: Inputs) -> [[f32; 4]; SAMPLES] {
    let mut samples = [[0.0; 4]; SAMPLES];
    for (index, [red, green, blue, optical_depth]) in samples.iter_mut().enumerate() {
        let index = index as u32;
        *red = 0.5 + 0.5 * wave(inputs, index);
        *green = 0.5 + 0.5 * wave(inputs, index + 1000);
        *blue = 0.5 + 0.5 * wave(inputs, index + 2000);
        // Thin at first, then denser.
        *optical_depth = 2.0e-5 * (1 + index * index) as f32 * (1.2 + wave(inputs, index + 3000));
    }
    samples
}

/// The pixel of a ray of samples at equal distances.
pub fn composite_ray(samples: &[[f32; 4]; SAMPLES]) -> Composite<3> {
    let mut ray = Compositor::<3>::START;
    let mut depth = 1.0;
    for [red, green, blue, optical_depth] in samples {
        ray.add(&[*red, *green, *blue], *optical_depth, depth);
        depth += 0.03125;
    }
    ray.finish(&[1.0, 1.0, 1.0], 0.0)
}

fn ray(inputs: Inputs, emit: Emit) {
    let samples = samples(inputs);
    let pixel = composite_ray(&samples);
    emit_all("pixel", &pixel.channels, emit);
    emit("pixel depth", pixel.depth);
    emit("pixel opacity", pixel.opacity);
    let mut ray = Compositor::<3>::START;
    for (index, [red, green, blue, occupancy]) in samples.iter().enumerate() {
        emit("solid", ray.add_solid(&[*red, *green, *blue], 4.0 * *occupancy, index as f32));
    }
    emit_all("solid pixel", &ray.finish(&[0.0; 3], 0.0).channels, emit);
}

/// Stratified depths of a ray, jittered.
pub fn stratified(seed: u64) -> [f32; SAMPLES] {
    let mut depths = [0.0; SAMPLES];
    for (part, depth) in depths.iter_mut().enumerate() {
        let part = part as u32;
        *depth = stratified_depth(0.7, 3.1, part, SAMPLES as u32, uniform(seed, 5, part));
    }
    depths
}

fn depths(inputs: Inputs, emit: Emit) {
    emit_all("stratified", &stratified(inputs.seed), emit);
    let mut weights = [0.0; SAMPLES];
    for (part, weight) in weights.iter_mut().enumerate() {
        *weight = wave(inputs, part as u32);
    }
    for step in 0..17 {
        emit("inverse_cdf", inverse_cdf(0.7, 3.1, &weights, step as f32 / 16.0));
    }
}

fn random(inputs: Inputs, emit: Emit) {
    for pixel in 0..16 {
        emit("uniform", uniform(inputs.seed, pixel * 7919, pixel));
        let words = threefry_2x32([pixel, inputs.seed as u32], [3, !pixel]);
        for word in words {
            // Both halves, as whole numbers: a word's bits could be those of a NaN.
            emit("threefry", (word >> 16) as f32);
            emit("threefry", (word & 0xffff) as f32);
        }
    }
}
