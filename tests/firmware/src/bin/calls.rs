//! The calls that are measured, one after another. Nothing is measured in here: `tests/embedded/firmware.rs` reads the
//! emulator's trace, from the first instruction of a function named `measured_...` to its return, so that the counts
//! have no overhead in them.
#![no_std]
#![no_main]

use core::hint::black_box;
use viewfuse_core::attention::quantised::{QuantisedAttention, SourceKeys, quantised_attention};
use viewfuse_core::composite::Composite;
use viewfuse_core::fuse::{fuse_readings, fuse_views, fuse_visible};
use viewfuse_core::math::sqrt;
use viewfuse_core::pose::Pose;
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_core::sources::Sources;
use viewfuse_core::weighting::{Scheme, weigh};
use viewfuse_core::weights::Weights;
use viewfuse_firmware::finish;
use viewfuse_list::Inputs;
use viewfuse_list::denoised::{denoiser_step, noise};
use viewfuse_list::formulas::{CHANNELS, SAMPLES, composite_ray, latents, samples, stratified, visibility};
use viewfuse_list::quantised::{ATTENTION, bytes, further_target, words};
use viewfuse_list::rig::{Rig, VIEWS, measured_schemes};

viewfuse_firmware::measured! {
    fn measured_weigh(scheme: Scheme, sources: &Sources<VIEWS>, target: &Pose) -> Weights<VIEWS> {
        weigh(scheme, sources, target)
    }

    fn measured_attend(parameters: &QuantisedAttention, sources: &Sources<VIEWS>, target: &Pose) -> Weights<VIEWS> {
        quantised_attention(parameters, sources, target)
    }

    fn measured_keys(parameters: &QuantisedAttention, sources: &Sources<VIEWS>) -> SourceKeys<VIEWS> {
        SourceKeys::new(parameters, sources)
    }

    fn measured_further(keys: &SourceKeys<VIEWS>, parameters: &QuantisedAttention, target: &Pose) -> Weights<VIEWS> {
        keys.weigh(parameters, target)
    }

    fn measured_fuse_u8(weights: &Weights<VIEWS>, readings: &[[u8; CHANNELS]; VIEWS]) -> [f32; CHANNELS] {
        fuse_readings(weights, readings)
    }

    fn measured_fuse_i16(weights: &Weights<VIEWS>, readings: &[[i16; CHANNELS]; VIEWS]) -> [f32; CHANNELS] {
        fuse_readings(weights, readings)
    }

    fn measured_fuse(weights: &Weights<VIEWS>, latents: &[[f32; CHANNELS]; VIEWS]) -> [f32; CHANNELS] {
        fuse_views(weights, latents)
    }

    fn measured_fuse_visible(
        weights: &Weights<VIEWS>,
        visibility: &[f32; VIEWS],
        latents: &[[f32; CHANNELS]; VIEWS],
    ) -> [f32; CHANNELS] {
        fuse_visible(weights, visibility, latents, [0.0; CHANNELS])
    }

    fn measured_ray(samples: &[[f32; 4]; SAMPLES]) -> Composite<3> {
        composite_ray(samples)
    }

    fn measured_depths(seed: u64) -> [f32; SAMPLES] {
        stratified(seed)
    }

    fn measured_step(schedule: &NoiseSchedule, index: u32, noisy: &[f32; CHANNELS]) -> [f32; CHANNELS] {
        denoiser_step(schedule, index, noisy)
    }

    fn measured_sqrt(x: f32) -> f32 {
        sqrt(x)
    }
}

#[viewfuse_firmware::entry]
fn main() -> ! {
    let inputs = black_box(Inputs::STANDARD);
    let Rig { sources, target } = Rig::around(inputs, 2.0);
    for (_, scheme) in measured_schemes() {
        black_box(measured_weigh(black_box(scheme), &sources, &target));
    }
    let weights = weigh(Scheme::ERROR, &sources, &target);
    let latents = latents(inputs);
    black_box(measured_fuse(&weights, &latents));
    black_box(measured_fuse_visible(&weights, &visibility(), &latents));
    black_box(measured_ray(&samples(inputs)));
    black_box(measured_depths(inputs.seed));
    black_box(measured_step(&NoiseSchedule::published(), 12, &noise(inputs)));
    black_box(measured_sqrt(inputs.phase));
    black_box(measured_fuse_u8(&weights, &bytes(inputs)));
    black_box(measured_fuse_i16(&weights, &words(inputs)));
    black_box(measured_attend(&ATTENTION, &sources, &target));
    let keys = measured_keys(&ATTENTION, &sources);
    black_box(measured_further(&keys, &ATTENTION, &further_target(inputs)));
    finish()
}
