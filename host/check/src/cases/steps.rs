//! [`Kernel::StepParticles`], [`Kernel::StepHarmonics`] and [`Kernel::StepGains`]: Gaussians before a camera and beside
//! it, after none and several steps, with derivatives that are not finite, and after pictures whose lists were too
//! long.

use super::gaussians::{NEAR, gaussians};
use super::particles::{TERMS, camera, state, term_states, terms};
use super::*;
use crate::list_oracle::pixels;
use crate::step_oracle::{adam, depth, harmonics};
use crate::world::Numbers;
use viewfuse_core::gaussian::REST_COUNTS;
use viewfuse_kernels::gaussians::steps::{GAIN_PULL, PARAMETERS};

/// What is given to steps.
struct Stepped {
    block: StepBlock,
    gaussians: Vec<GaussianBlock>,
    states: Vec<ParticleState>,
    splats: Vec<ProjectedGaussian>,
    gradients: Vec<GaussianBlock>,
}

impl Stepped {
    fn new(seed: u64, size: u32, degree: u32) -> Stepped {
        let numbers = &mut Numbers::new(seed);
        let camera = camera(seed);
        let block = StepBlock {
            camera,
            rates: [0.01, 0.05, 0.02, 0.1, 0.03],
            opacity_penalty: 0.2,
            footprint: 0.004,
            depth: 2.0,
            degree,
            counts: 0,
        };
        let gaussians = gaussians(numbers, size);
        let states = (0..size).map(|_| state(numbers)).collect();
        let project = |gaussian: &GaussianBlock| {
            let mut splat = viewfuse_core::gaussian::project(gaussian, &camera, NEAR);
            // As harmonics may leave it.
            splat.colour[0] = if numbers.between(0.0, 1.0) < 0.3 { 0.0 } else { splat.colour[0] };
            splat
        };
        let splats = gaussians.iter().map(project).collect();
        let gradient = |index: u32| GaussianBlock {
            position: [0; 3].map(|_| numbers.between(-1.0, 1.0)),
            opacity: numbers.between(-1.0, 1.0),
            log_scales: [0; 3].map(|_| numbers.between(-1.0, 1.0)),
            padding: 0.0,
            rotation: [0; 4].map(|_| numbers.between(-1.0, 1.0)),
            colour: [if index % 9 == 4 { f32::NAN } else { 0.5 }, numbers.between(-1.0, 1.0), 0.7],
            padding_end: 0.0,
        };
        let gradients = (0..size).map(gradient).collect();
        Stepped { block: block.with_counts(size, TERMS), gaussians, states, splats, gradients }
    }
}

/// Whether a Gaussian takes the step; `None` where that depends on rounding.
fn takes(block: &StepBlock, splat: &ProjectedGaussian, status: &[u32]) -> Option<bool> {
    let [left, right, top, bottom] = pixels(splat, block.camera.width, block.camera.height)?;
    Some(status[0] == 0 && left < right && top < bottom)
}

/// Derivatives by the colour of degree 0.
fn by_colour(block: &StepBlock, gradient: &GaussianBlock, splat: &ProjectedGaussian) -> [f32; 3] {
    let is_dark = |channel: usize| block.degree > 0 && splat.colour[channel] <= 0.0;
    [0, 1, 2].map(|channel| if is_dark(channel) { 0.0 } else { gradient.colour[channel] })
}

impl Case for StepParticles {
    const LIMITS: Limits = Limits { tolerance: 5.0e-2, least: 1.0e-2 };
    const REASON: &'static str =
        "running error analysis of Adam's moments and of their quotient, and of the limits of scales";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("gaussians", |case| increase(case.gaussians.iter_mut().flat_map(|gaussian| &mut gaussian.position))),
        ("states", |case| increase(case.states.iter_mut().flat_map(|state| state.moments.as_flattened_mut()))),
        ("splats", |case| case.splats.iter_mut().for_each(|splat| splat.opacity = 0.0)),
        ("gradients", |case| increase(case.gradients.iter_mut().flat_map(|gradient| &mut gradient.position))),
        ("status", |case| case.status[0] ^= 1),
        ("parameters", |case| case.block.rates[0] *= 1.5),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<StepParticles> {
        let dispatch = |(degree, status, has_limited_colours): (u32, u32, bool)| {
            let Stepped { block, gaussians, states, splats, gradients } = Stepped::new(seed, size.max(24), degree);
            let block = block.with_limited_colours(has_limited_colours);
            let (next_gaussians, next_states) = (Output::Zeros(gaussians.len()), Output::Zeros(gaussians.len()));
            let status = vec![status, 3, 0];
            StepParticles { block, gaussians, states, splats, gradients, status, next_gaussians, next_states }
        };
        [(0, 0, false), (2, 0, false), (1, 1, false), (0, 0, true)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let all = map(self.gaussians.len(), 16, |index| {
            let state = &self.states[index];
            match takes(&self.block, &self.splats[index], &self.status) {
                None => ([None; 16], [None; 32]),
                Some(true) => self.stepped(index),
                Some(false) => {
                    let numbers: [f32; 16] = bytemuck::cast(self.gaussians[index]);
                    let moments = state.moments.map(|pair| pair.map(Bounded::from));
                    let counts = [state.step_count, state.moved_count, state.rest_count];
                    (numbers.map(|number| Some(number.into())), of_state(moments, state.moved.into(), counts))
                }
            }
        });
        let (gaussians, states): (Vec<_>, Vec<_>) = all.into_iter().unzip();
        gaussians.into_iter().flatten().chain(states.into_iter().flatten()).collect()
    }
}

/// A state's numbers: moments, steps, what it moved, in how many pictures, its coefficients.
fn of_state(
    moments: [[Bounded; 2]; PARAMETERS],
    moved: Bounded,
    [step_count, moved_count, rest_count]: [u32; 3],
) -> [Option<Bounded>; 32] {
    let counts = [Bounded::from(step_count), moved, moved_count.into(), rest_count.into()];
    let mut numbers = moments.into_iter().flatten().chain(counts);
    std::array::from_fn(|_| numbers.next())
}

impl StepParticles {
    /// A Gaussian and its state after a step.
    fn stepped(&self, index: usize) -> ([Option<Bounded>; 16], [Option<Bounded>; 32]) {
        let (block, gaussian, state) = (&self.block, &self.gaussians[index], &self.states[index]);
        let (splat, gradient) = (&self.splats[index], &self.gradients[index]);
        let odds = Bounded::from(gaussian.opacity).exp();
        let solid = odds / (Bounded::ONE + odds);
        let penalty = Bounded::from(block.opacity_penalty) * solid * (Bounded::ONE - solid);
        let [place, scale, turn, opaque, colour] = block.rates;
        let step_count = state.step_count + 1;
        let step = |number: usize, value: f32, gradient: Bounded, rate: f32| {
            let moments = state.moments[number];
            if gradient.value.is_finite() {
                adam(value, moments, gradient, rate.into(), step_count)
            } else {
                [value, moments[0], moments[1]].map(Bounded::from)
            }
        };
        let by_colour = by_colour(block, gradient, splat);
        let three = |first: usize, values: [f32; 3], by: [f32; 3], rate: f32| {
            [0, 1, 2].map(|axis| step(first + axis, values[axis], by[axis].into(), rate))
        };
        let position = three(0, gaussian.position, gradient.position, place);
        let scales = three(3, gaussian.log_scales, gradient.log_scales, scale);
        let rotation =
            [0, 1, 2, 3].map(|part| step(6 + part, gaussian.rotation[part], gradient.rotation[part].into(), turn));
        let opacity = step(10, gaussian.opacity, Bounded::from(gradient.opacity) + penalty, opaque);
        let colour = three(11, gaussian.colour, by_colour, colour);
        let stepped = position.into_iter().chain(scales).chain(rotation).chain([opacity]).chain(colour);
        let moments: Vec<[Bounded; 2]> = stepped.map(|[_, mean, square]| [mean, square]).collect();
        // The limits.
        let [place, scales, colour] = [position, scales, colour].map(|three| three.map(|[value, ..]| value));
        let depth = depth(place, &block.camera);
        let footprint = Bounded::from(8.0_f32) * block.footprint.into();
        let most = (footprint * (depth / block.depth.into()).greater(Bounded::ONE)).ln();
        let scales = scales.map(|scale| scale.lesser(most));
        let least = scales[0].greater(scales[1]).greater(scales[2]) - Bounded::from(2.3_f32);
        let scales = scales.map(|scale| scale.greater(least));
        let opacity = opacity[0].clamped(-6.0, 6.0);
        let colour = if block.has_limited_colours() { colour.map(|value| value.clamped(0.0, 1.0)) } else { colour };
        let square = gradient.position.iter().fold(Bounded::ZERO, |sum, part| sum + Bounded::from(*part).squared());
        let moved = square.square_root() * depth / block.camera.intrinsics[0].into();
        let rest_count = state.rest_count.max(REST_COUNTS[block.degree as usize]);
        let state = of_state(
            std::array::from_fn(|number| moments[number]),
            Bounded::from(state.moved) + moved,
            [step_count, state.moved_count + 1, if block.degree > 0 { rest_count } else { state.rest_count }],
        );
        let four = |[a, b, c]: [Bounded; 3], last: Bounded| [a, b, c, last];
        let rotation = rotation.map(|[value, ..]| value);
        let rows = [four(place, opacity), four(scales, Bounded::ZERO), rotation, four(colour, Bounded::ZERO)];
        (std::array::from_fn(|number| Some(rows[number / 4][number % 4])), state)
    }
}

impl Case for StepHarmonics {
    const LIMITS: Limits = Limits { tolerance: 5.0e-2, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis of Adam's moments and of their quotient";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("gaussians", |case| increase(case.gaussians.iter_mut().flat_map(|gaussian| &mut gaussian.position))),
        ("states", |case| case.states.iter_mut().for_each(|state| state.step_count += 1)),
        ("splats", |case| case.splats.iter_mut().for_each(|splat| splat.opacity = 0.0)),
        ("gradients", |case| increase(case.gradients.iter_mut().flat_map(|gradient| &mut gradient.colour))),
        ("status", |case| case.status[0] ^= 1),
        ("terms", |case| increase(case.terms.iter_mut().flat_map(|term| &mut term.value))),
        ("term_states", |case| {
            increase(case.term_states.iter_mut().flat_map(|state| state.moments.as_flattened_mut()))
        }),
        ("parameters", |case| case.block.rates[4] *= 1.5),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<StepHarmonics> {
        let dispatch = |(degree, status): (u32, u32)| {
            let size = size.div_ceil(TERMS).max(24);
            let Stepped { block, gaussians, states, splats, gradients } = Stepped::new(seed, size, degree);
            let numbers = &mut Numbers::new(seed + 9);
            let (terms, term_states) = (terms(numbers, size * TERMS), term_states(numbers, size * TERMS));
            let (next_terms, next_term_states) = (Output::Zeros(terms.len()), Output::Zeros(terms.len()));
            let status = vec![status, 0, 0];
            StepHarmonics {
                block,
                gaussians,
                states,
                splats,
                gradients,
                status,
                terms,
                term_states,
                next_terms,
                next_term_states,
            }
        };
        [(1, 0), (2, 0), (2, 1)].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let StepHarmonics { block, gaussians, states, splats, gradients, status, terms, term_states, .. } = self;
        let term = |at: usize| -> ([Option<Bounded>; 4], [Option<Bounded>; 8]) {
            let (index, number) = (at / TERMS as usize, at % TERMS as usize);
            let (term, state) = (&terms[at], &term_states[at]);
            let by = by_colour(block, &gradients[index], &splats[index]);
            let count = states[index].rest_count.max(REST_COUNTS[block.degree as usize]) as usize;
            let Some(takes) = takes(block, &splats[index], status) else { return ([None; 4], [None; 8]) };
            if !takes || number >= count || by.iter().any(|by| !by.is_finite()) {
                let same = |number: f32| Some(Bounded::from(number));
                let (term, state): ([f32; 4], [f32; 8]) = (bytemuck::cast(*term), bytemuck::cast(*state));
                return (term.map(same), state.map(same));
            }
            let basis = harmonics(&gaussians[index], &block.camera)[number];
            let rate = Bounded::from(0.2_f32) * block.rates[4].into();
            let step_count = states[index].step_count + 1;
            let [red, green, blue] = [0, 1, 2].map(|channel| {
                let gradient = Bounded::from(by[channel]) * basis;
                adam(term.value[channel], state.moments[channel], gradient, rate, step_count)
            });
            let zero = Bounded::ZERO;
            let moments = [red[1], red[2], green[1], green[2], blue[1], blue[2], zero, zero];
            ([red[0], green[0], blue[0], zero].map(Some), moments.map(Some))
        };
        let (terms, states): (Vec<_>, Vec<_>) = map(terms.len(), 16, term).into_iter().unzip();
        terms.into_iter().flatten().chain(states.into_iter().flatten()).collect()
    }
}

impl Case for StepGains {
    const LIMITS: Limits = Limits { tolerance: 1.0e-3, least: 1.0e-2 };
    const REASON: &'static str = "running error analysis of a sum, of Adam's moments and of a mean";
    const NEGATIVE_CONTROLS: &'static [NegativeControl<Self>] = &[
        ("sums", |case| increase(case.sums.as_flattened_mut())),
        ("status", |case| case.status[0] ^= 1),
        ("gains", |case| increase(case.gains.iter_mut().map(|gain| &mut gain.value[0]).take(1))),
        ("parameters", |case| case.block.rate *= 1.5),
    ];

    fn inputs(seed: u64, size: u32) -> Vec<StepGains> {
        let numbers = &mut Numbers::new(seed);
        let gain_count = size.clamp(3, 100);
        let gain = |_| GainBlock {
            value: [0; 3].map(|_| numbers.between(0.5, 1.5)),
            step_count: 3,
            moments: [0; 3].map(|_| [numbers.between(-0.5, 0.5), numbers.between(0.3, 0.6)]),
            padding: [0.0; 2],
        };
        let gains: Vec<GainBlock> = (0..gain_count).map(gain).collect();
        let sums: Vec<[f32; 4]> = (0..size).map(|_| [0; 4].map(|_| numbers.between(-1.0, 1.0))).collect();
        let dispatch = |status: u32| StepGains {
            block: GainStepBlock { source: 1, gain_count, run_count: size, rate: 0.05, factor: 0.25, padding: [0; 3] },
            sums: sums.clone(),
            status: vec![status, 0, 0],
            gains: gains.clone(),
            next_gains: Output::Zeros(gains.len()),
        };
        [0, 1].map(dispatch).to_vec()
    }

    fn expected(&self) -> Vec<Option<Bounded>> {
        let StepGains { block, sums, status, gains, .. } = self;
        let source = &gains[block.source as usize];
        let steps = [0, 1, 2].map(|channel| {
            let sum = Bounded::sum(sums.iter().map(|sum| f64::from(sum[channel])));
            let value = source.value[channel];
            let pull = Bounded::from(GAIN_PULL) * (Bounded::from(value) - Bounded::ONE);
            let by = Bounded::from(block.factor) * sum + pull;
            adam(value, source.moments[channel], by, block.rate.into(), source.step_count + 1)
        });
        let gain = |(index, gain): (usize, &GainBlock)| {
            let takes = status[0] == 0;
            let is_source = takes && index == block.source as usize;
            let value = [0, 1, 2].map(|channel| {
                let stepped = |index: usize| match index == block.source as usize {
                    true => steps[channel][0],
                    false => gains[index].value[channel].into(),
                };
                if !takes {
                    return gain.value[channel].into();
                }
                let all = (0..gains.len()).fold(Bounded::ZERO, |sum, index| sum + stepped(index));
                stepped(index) / (all / block.gain_count.into())
            });
            let moment = |number: usize| match is_source {
                true => steps[number / 2][1 + number % 2],
                false => gain.moments[number / 2][number % 2].into(),
            };
            let moments: [Bounded; 6] = std::array::from_fn(moment);
            let step_count = Bounded::from(gain.step_count + u32::from(is_source));
            value.into_iter().chain([step_count]).chain(moments).chain([Bounded::ZERO; 2]).collect::<Vec<Bounded>>()
        };
        decided(gains.iter().enumerate().flat_map(gain), 0)
    }
}
