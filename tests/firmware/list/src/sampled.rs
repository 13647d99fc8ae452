//! Every sampler on a value, churn, and the step controller.

use crate::{Emit, Inputs, emit_all, wave};
use viewfuse_core::sampler::churn::Churn;
use viewfuse_core::sampler::control::{FIRST_STEP, change_to_come, reached, verdict};
use viewfuse_core::sampler::{History, MAX_RESULTS, NoiseBlock, Sampler, noisy_element};
use viewfuse_core::schedule::{NoiseSchedule, Preconditioning};

/// Levels of the samplers: few, so that steps are long.
const FEW: u32 = 13;

/// The list of the samplers: coefficients and a whole descent of one value for each, churn, and the step controller.
pub fn sampling(inputs: Inputs, emit: Emit) {
    let Ok(schedule) = NoiseSchedule::new(0.002 * (1.0 + inputs.phase), 80.0 + inputs.phase) else {
        panic!("levels outside their range");
    };
    let churn = Churn { amount: 2.0, lowest: 0.05, highest: 50.0, deviation: 1.0 };
    let noise = NoiseBlock { seed: [inputs.seed as u32, (inputs.seed >> 32) as u32], stream: 0, scale: 80.0 };
    let mut state = noisy_element(&noise, 0.0, 3);
    emit("start", state);
    for sampler in Sampler::ALL {
        state = sampled(sampler, &schedule, state, emit);
        emit(sampler.name(), state);
        // The next one starts from noise again, on the picture of this one.
        let churned = churn.before(schedule.level(4, FEW), FEW);
        emit_all("churned", &[churned.level, churned.scale], emit);
        state = noisy_element(&NoiseBlock { stream: sampler.order(), ..noise }, state, 5);
    }
    let (mut sigma, mut step) = (80.0 + inputs.phase, FIRST_STEP);
    for index in 0..12 {
        let next = reached(sigma, step, 0.002);
        let error = 0.02 * (1.0 + wave(inputs, 700 + index));
        step = verdict(error, 0.01, step, 1 + index % 4).step;
        emit_all("controlled", &[next, step, change_to_come(error, 0.05 + inputs.phase, 0.05)], emit);
        sigma = next;
    }
}

/// A value from the largest level to 0, a factor stands for the network.
fn sampled(sampler: Sampler, schedule: &NoiseSchedule, start: f32, emit: Emit) -> f32 {
    let denoised = |noisy: f32, sigma: f32| {
        let factors = Preconditioning::at(sigma);
        factors.denoised(noisy, 0.625 * factors.network_input(noisy))
    };
    let mut history = History::NONE;
    let mut results = [0.0; MAX_RESULTS];
    let (mut state, mut begun) = (start, start);
    let mut index = 0;
    while index < FEW {
        let (sigma, next) = (schedule.level(index, FEW), schedule.level(index + 1, FEW));
        let said = denoised(state, sigma);
        if sampler == Sampler::UniPc && index > 0 {
            let correction = sampler.correction(&history, sigma);
            emit_all("correction", &correction.results, emit);
            state = correction.of(begun, &[said, results[0], results[1], results[2]]);
        }
        let kept = match sampler.kept(sigma) {
            Some(mix) => mix.of(state, &[said, 0.0, 0.0, 0.0]),
            None => said,
        };
        history.push(sigma);
        results = [kept, results[0], results[1], results[2]];
        let mix = sampler.step(&history, next);
        emit("remaining", mix.state);
        emit_all("coefficients", &mix.results, emit);
        begun = state;
        state = mix.of(state, &results);
        if sampler == Sampler::Heun && next > 0.0 {
            state = sampler.correction(&history, next).of(state, &[denoised(state, next), kept, 0.0, 0.0]);
        }
        emit("state", state);
        index += 1;
    }
    state
}
