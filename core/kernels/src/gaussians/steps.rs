//! Steps of an optimisation: of a Gaussian's parameters, of its spherical harmonics, and of a photograph's gain. The
//! same functions step what the host optimises and what lives on a device.

use super::adam::{FIRST_DECAY, SECOND_DECAY, adam_step};
use super::windows::GainBlock;
use bytemuck::{Pod, Zeroable};
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::gaussian::{GaussianBlock, REST_COUNTS, harmonics, opacity};
use viewfuse_core::math::{clamp, has_finite_bits, max, min, sqrt};

/// Logarithm of the greatest quotient of a Gaussian's scales: ten.
const MAX_ELONGATION: f32 = 2.3;
/// Greatest magnitude of an opacity's logit.
const MAX_LOGIT: f32 = 6.0;
/// Greatest standard deviation, in footprints of the level.
const MAX_SCALE: f32 = 8.0;
/// The harmonics' learning rate is this share of the colour's: four times that of the published code, which has ten
/// times the iterations (`host/results/gaussian_quality.md`).
const RATE_SHARE: f32 = 0.2;
/// Share of a gain's difference from 1 in its derivative.
pub const GAIN_PULL: f32 = 0.02;
/// Parameters of a Gaussian that are stepped.
pub const PARAMETERS: usize = 14;

/// The state of a Gaussian's optimisation, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ParticleState {
    /// Moments of the derivatives by position, log scales, rotation, opacity and colour.
    pub moments: [[f32; 2]; PARAMETERS],
    /// Steps so far.
    pub step_count: u32,
    /// Sum of the lengths of the derivative by its place in a picture.
    pub moved: f32,
    /// Of how many pictures.
    pub moved_count: u32,
    /// Coefficients of a channel beyond degree 0 that it has.
    pub rest_count: u32,
}

const _: () = assert!(size_of::<ParticleState>() == 128);

/// A coefficient of spherical harmonics, red, green and blue, as plain data: all that pictures read of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct HarmonicTerm {
    /// Red, green, blue.
    pub value: [f32; 3],
    /// Zero.
    pub padding: f32,
}

/// The state of a coefficient's optimisation, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TermState {
    /// Moments of the derivatives, `[channel]`.
    pub moments: [[f32; 2]; 3],
    /// Zero.
    pub padding: [f32; 2],
}

const _: () = assert!(size_of::<HarmonicTerm>() == 16 && size_of::<TermState>() == 32);

/// A camera and Gaussians whose colours depend on the direction, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct ParticleBlock {
    /// The camera.
    pub camera: CameraBlock,
    /// Depth along the principal axis from which on Gaussians are seen, world units, above 0.
    pub near: f32,
    /// Number of Gaussians.
    pub gaussian_count: u32,
    /// Terms of a Gaussian in the array of all, at most 15.
    pub term_count: u32,
    /// 1 if splats keep their integral when they are dilated, otherwise 0.
    pub is_antialiased: u32,
    /// 1 if states say how many terms of each Gaussian there are so far, 0 if all are there.
    pub has_states: u32,
}

const _: () = assert!(size_of::<ParticleBlock>() == 100);

/// The bit of [`StepBlock::counts`] that limits colours.
const LIMITED: u32 = 1 << 28;

/// What an iteration does to Gaussians, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct StepBlock {
    /// The picture's camera.
    pub camera: CameraBlock,
    /// Learning rates of position, log scale, rotation, opacity and colour.
    pub rates: [f32; 5],
    /// What the opacity's derivative grows by, a unit of it.
    pub opacity_penalty: f32,
    /// Size of the level's pixel at the median depth, world units.
    pub footprint: f32,
    /// Median depth, world units.
    pub depth: f32,
    /// Degree of the spherical harmonics so far, at most 3.
    pub degree: u32,
    /// Number of Gaussians in the lower 24 bits; above them the terms of a Gaussian in the array of all, in four bits,
    /// and one that is 1 where colours stay between 0 and 1.
    pub counts: u32,
}

const _: () = assert!(size_of::<StepBlock>() == 120);

/// What an iteration does to the photographs' gains, as plain data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct GainStepBlock {
    /// The picture's photograph.
    pub source: u32,
    /// Photographs, at least 1.
    pub gain_count: u32,
    /// Runs of the picture's pixels.
    pub run_count: u32,
    /// Learning rate.
    pub rate: f32,
    /// What the sum over the runs is multiplied by.
    pub factor: f32,
    /// Zero.
    pub padding: [u32; 3],
}

const _: () = assert!(size_of::<GainStepBlock>() == 32);

impl StepBlock {
    /// The two numbers of `counts`: fewer than 2^24 Gaussians, at most 15 terms.
    pub fn with_counts(self, gaussian_count: u32, term_count: u32) -> StepBlock {
        StepBlock { counts: self.counts & LIMITED | gaussian_count | term_count << 24, ..self }
    }

    /// Whether colours stay between 0 and 1.
    pub fn with_limited_colours(self, are_limited: bool) -> StepBlock {
        StepBlock { counts: self.counts & !LIMITED | if are_limited { LIMITED } else { 0 }, ..self }
    }

    /// Whether colours stay between 0 and 1.
    #[inline(always)]
    pub fn has_limited_colours(&self) -> bool {
        self.counts & LIMITED != 0
    }

    /// Number of Gaussians.
    #[inline(always)]
    pub fn gaussian_count(&self) -> u32 {
        self.counts & 0x00ff_ffff
    }

    /// Terms of a Gaussian in the array of all.
    #[inline(always)]
    pub fn term_count(&self) -> u32 {
        self.counts >> 24 & 15
    }
}

/// A number to a power, by squares: the same bits on all targets.
#[inline(always)]
pub fn power(base: f32, exponent: u32) -> f32 {
    let (mut square, mut rest, mut power) = (base, exponent, 1.0);
    while rest != 0 {
        if rest & 1 != 0 {
            power *= square;
        }
        square *= square;
        rest >>= 1;
    }
    power
}

/// 1 less the decays of Adam to the power of the steps so far.
#[inline(always)]
pub fn corrections(step_count: u32) -> [f32; 2] {
    [1.0 - power(FIRST_DECAY, step_count), 1.0 - power(SECOND_DECAY, step_count)]
}

/// From a camera to a Gaussian's mean, of length 1; 0 at the camera itself.
#[inline(always)]
pub fn direction(gaussian: &GaussianBlock, camera: &CameraBlock) -> Vec3 {
    let [x, y, z] = gaussian.position;
    let offset = Vec3::new(x, y, z) - camera.centre_world();
    let inverse = 1.0 / sqrt(offset.x * offset.x + offset.y * offset.y + offset.z * offset.z);
    if inverse > 0.0 && inverse <= f32::MAX { offset * inverse } else { Vec3::ZERO }
}

/// A Gaussian's colour along a direction of length 1, from its first `count` terms, which begin at `first`: at least 0,
/// once there are terms. They are added in their order.
#[inline(always)]
pub fn colour_along(
    mut colour: [f32; 3],
    terms: &(impl Fetch<HarmonicTerm> + ?Sized),
    first: u32,
    count: u32,
    unit: Vec3,
) -> [f32; 3] {
    if count == 0 {
        return colour;
    }
    let basis = harmonics(unit);
    let mut term = 0;
    while term < count {
        let value = terms.fetch((first + term) as usize).value;
        colour[0] += basis[term as usize] * value[0];
        colour[1] += basis[term as usize] * value[1];
        colour[2] += basis[term as usize] * value[2];
        term += 1;
    }
    [max(colour[0], 0.0), max(colour[1], 0.0), max(colour[2], 0.0)]
}

/// Derivatives by the colour of degree 0, from those by the colour that is `seen` and the degree of the harmonics:
/// where there are harmonics colours end at 0.
#[inline(always)]
pub fn by_colour(gradient: [f32; 3], seen: [f32; 3], degree: u32) -> [f32; 3] {
    let ends = |channel: usize| degree > 0 && seen[channel] <= 0.0;
    [
        if ends(0) { 0.0 } else { gradient[0] },
        if ends(1) { 0.0 } else { gradient[1] },
        if ends(2) { 0.0 } else { gradient[2] },
    ]
}

/// A coefficient of the spherical harmonic `basis`, and its state, after a step against the derivatives by the colour.
#[inline(always)]
pub fn step_term(
    term: &HarmonicTerm,
    state: &TermState,
    by_colour: [f32; 3],
    basis: f32,
    colour_rate: f32,
    corrections: [f32; 2],
) -> (HarmonicTerm, TermState) {
    let step = |channel: usize| {
        let (mut value, mut moments) = (term.value[channel], state.moments[channel]);
        adam_step(&mut value, &mut moments, by_colour[channel] * basis, RATE_SHARE * colour_rate, corrections);
        (value, moments)
    };
    let ((red, of_red), (green, of_green), (blue, of_blue)) = (step(0), step(1), step(2));
    let value = [red, green, blue];
    (HarmonicTerm { value, ..*term }, TermState { moments: [of_red, of_green, of_blue], ..*state })
}

/// A parameter and its moments after a step; the same if the derivative is not finite.
#[inline(always)]
fn stepped(value: f32, moments: [f32; 2], gradient: f32, rate: f32, corrections: [f32; 2]) -> (f32, [f32; 2]) {
    let (mut value, mut moments) = (value, moments);
    if has_finite_bits(gradient) {
        adam_step(&mut value, &mut moments, gradient, rate, corrections);
    }
    (value, moments)
}

/// A Gaussian that is in a picture and the state of its optimisation after a step. `gradient` are the derivatives by
/// its parameters, `seen` its colour in the picture, `ln` the natural logarithm.
#[inline(always)]
pub fn step_particle(
    gaussian: &GaussianBlock,
    state: &ParticleState,
    gradient: &GaussianBlock,
    seen: [f32; 3],
    block: &StepBlock,
    ln: impl Fn(f32) -> f32,
) -> (GaussianBlock, ParticleState) {
    let (mut next, mut after) = (*gaussian, *state);
    after.step_count += 1;
    let corrections = corrections(after.step_count);
    let [place, scale, turn, opaque, colour] = block.rates;
    let solid = opacity(gaussian.opacity);
    let penalty = block.opacity_penalty * solid * (1.0 - solid);
    let by_colour = by_colour(gradient.colour, seen, block.degree);
    let old = &state.moments;
    let three = |first: usize, values: [f32; 3], by: [f32; 3], rate: f32| {
        let (a, of_a) = stepped(values[0], old[first], by[0], rate, corrections);
        let (b, of_b) = stepped(values[1], old[first + 1], by[1], rate, corrections);
        let (c, of_c) = stepped(values[2], old[first + 2], by[2], rate, corrections);
        ([a, b, c], [of_a, of_b, of_c])
    };
    let (position, [m0, m1, m2]) = three(0, gaussian.position, gradient.position, place);
    let (log_scales, [m3, m4, m5]) = three(3, gaussian.log_scales, gradient.log_scales, scale);
    let ([w, i, j, k], [by_w, by_i, by_j, by_k]) = (gaussian.rotation, gradient.rotation);
    let (w, m6) = stepped(w, old[6], by_w, turn, corrections);
    let ([i, j, k], [m7, m8, m9]) = three(7, [i, j, k], [by_i, by_j, by_k], turn);
    let (logit, m10) = stepped(gaussian.opacity, old[10], gradient.opacity + penalty, opaque, corrections);
    let (colour, [m11, m12, m13]) = three(11, gaussian.colour, by_colour, colour);
    after.moments = [m0, m1, m2, m3, m4, m5, m6, m7, m8, m9, m10, m11, m12, m13];
    (next.position, next.rotation, next.colour) = (position, [w, i, j, k], colour);
    if block.has_limited_colours() {
        next.colour = [clamp(colour[0], 0.0, 1.0), clamp(colour[1], 0.0, 1.0), clamp(colour[2], 0.0, 1.0)];
    }
    let [x, y, z] = next.position;
    let depth = block.camera.pose.rotate_to_camera(Vec3::new(x, y, z) - block.camera.centre_world()).z;
    let most = ln(MAX_SCALE * block.footprint * max(depth / block.depth, 1.0));
    let [a, b, c] = log_scales;
    let [a, b, c] = [min(a, most), min(b, most), min(c, most)];
    let least = max(max(a, b), c) - MAX_ELONGATION;
    next.log_scales = [max(a, least), max(b, least), max(c, least)];
    next.opacity = clamp(logit, -MAX_LOGIT, MAX_LOGIT);
    if block.degree > 0 && after.rest_count < REST_COUNTS[block.degree as usize] {
        after.rest_count = REST_COUNTS[block.degree as usize];
    }
    // A place in the picture moves by the focal length over the depth.
    let [x, y, z] = gradient.position;
    let length = sqrt(x * x + y * y + z * z) * depth / block.camera.intrinsics[0];
    if has_finite_bits(length) {
        after.moved += length;
        after.moved_count += 1;
    }
    (next, after)
}

/// A gain after a step against its derivative.
#[inline(always)]
pub fn step_gain(gain: &GainBlock, by_gain: [f32; 3], rate: f32) -> GainBlock {
    let step_count = gain.step_count + 1;
    let corrections = corrections(step_count);
    let step = |channel: usize| {
        let (mut value, mut moments) = (gain.value[channel], gain.moments[channel]);
        let pulled = by_gain[channel] + GAIN_PULL * (value - 1.0);
        adam_step(&mut value, &mut moments, pulled, rate, corrections);
        (value, moments)
    };
    let ((red, of_red), (green, of_green), (blue, of_blue)) = (step(0), step(1), step(2));
    GainBlock { value: [red, green, blue], step_count, moments: [of_red, of_green, of_blue], ..*gain }
}
