//! The denoiser's noise schedule and one step of it.

use crate::formulas::CHANNELS;
use crate::{Emit, Inputs, emit_all, wave};
use viewfuse_core::schedule::{HeunStep, NoiseSchedule, Preconditioning};

/// How many levels there are, as published.
pub const LEVELS: u32 = 25;

/// A second-order step of a few values, from level `index` to the next; a factor stands for the network.
pub fn denoiser_step(schedule: &NoiseSchedule, index: u32, noisy: &[f32; CHANNELS]) -> [f32; CHANNELS] {
    let network = |input: f32| 0.625 * input;
    let (sigma, next) = (schedule.level(index, LEVELS), schedule.level(index + 1, LEVELS));
    let (here, there) = (Preconditioning::at(sigma), Preconditioning::at(next));
    let step = HeunStep::between(sigma, next);
    let mut values = *noisy;
    for value in &mut values {
        let denoised = here.denoised(*value, network(here.network_input(*value)));
        *value = step.euler(*value, denoised);
        if step.is_corrected() {
            let denoised_there = there.denoised(*value, network(there.network_input(*value)));
            *value = step.correct(*value, denoised, denoised_there);
        }
    }
    values
}

/// Values at the largest level.
pub fn noise(inputs: Inputs) -> [f32; CHANNELS] {
    let mut noise = [0.0; CHANNELS];
    for (index, value) in noise.iter_mut().enumerate() {
        *value = 80.0 * wave(inputs, 500 + index as u32);
    }
    noise
}

/// The list of the denoiser: every level with its factors, then a whole descent.
pub fn denoising(inputs: Inputs, emit: Emit) {
    let Ok(schedule) = NoiseSchedule::new(0.002 * (1.0 + inputs.phase), 80.0 + inputs.phase) else {
        panic!("levels outside their range");
    };
    for index in 0..=LEVELS {
        let sigma = schedule.level(index, LEVELS);
        let factors = Preconditioning::at(sigma);
        emit("level", sigma);
        emit_all("factors", &[factors.skip, factors.output, factors.input, factors.noise], emit);
        let step = HeunStep::between(sigma, schedule.level(index + 1, LEVELS));
        emit_all("step", &[step.remaining, step.correction], emit);
    }
    let mut values = noise(inputs);
    for index in 0..LEVELS {
        values = denoiser_step(&schedule, index, &values);
        emit_all("denoised", &values, emit);
    }
}
