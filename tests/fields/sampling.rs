//! The driver of the samplers, on the CPU: which calls it makes, what it starts from, when it ends, and what it does
//! with NaN and infinity. That it gives what the samplers' formulas give is in `numerics/sampler.rs`.

use viewfuse::device::cpu::Cpu;
use viewfuse::field::FieldError;
use viewfuse::field::finite::NotFinite;
use viewfuse::field::genvs::sampling::{Plan, Sampled, Start, Steps, sample};
use viewfuse::job::progress::Silent;
use viewfuse_core::random::normal;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::sampler::churn::Churn;
use viewfuse_core::sampler::control::{HALF_A_LEVEL, UNDECIDED_ABOVE};
use viewfuse_core::schedule::NoiseSchedule;
use viewfuse_tests::mixture::Mixture;

const COUNT: usize = 128;

type Outcome = Result<Sampled<Cpu>, FieldError>;

/// Runs a plan with a denoiser of values; also gives the states at the calls.
fn run(
    plan: &Plan,
    start: Start<'_, Cpu>,
    mut denoise: impl FnMut(&[f32], f32) -> Vec<f32>,
) -> (Outcome, Vec<Vec<f32>>) {
    let mut states = Vec::new();
    let outcome = sample(&Cpu, plan, COUNT, start, &Silent, |state, sigma, denoised| {
        states.push(state.clone());
        *denoised = denoise(state, sigma);
        Ok(())
    });
    (outcome, states)
}

fn picture(plan: &Plan) -> Sampled<Cpu> {
    let mixture = Mixture::new(3, &[0.2, 0.3, 0.25]);
    let denoise = |state: &_, sigma, denoised: &mut _| mixture.denoise(&Cpu, state, sigma, denoised);
    sample(&Cpu, plan, COUNT, Start::Noise, &Silent, denoise).expect("a picture")
}

fn fixed(sampler: Sampler, level_count: u32) -> Plan {
    Plan { steps: Steps::Fixed { sampler, level_count }, ..Plan::published(9) }
}

fn levels(count: u32) -> Vec<f32> {
    (0..count).map(|index| NoiseSchedule::published().level(index, count)).collect()
}

#[test]
fn calls_are_at_the_levels() {
    for sampler in Sampler::ALL {
        for count in [1, 2, 4, 25] {
            let sampled = picture(&fixed(sampler, count));
            assert_eq!((sampled.call_count(), sampled.left_out), (sampler.call_count(count), 0));
            let expected: Vec<f32> = match sampler {
                Sampler::Heun => levels(count).iter().flat_map(|level| [*level; 2]).skip(1).collect(),
                _ => levels(count),
            };
            assert_eq!(sampled.levels, expected, "{}", sampler.name());
        }
    }
    assert_eq!(picture(&fixed(Sampler::Heun, 4)).call_count(), 7);
    assert_eq!(picture(&Plan::published(9)).call_count(), 49);
    // No level at all is one.
    assert_eq!(picture(&fixed(Sampler::Ipndm, 0)).levels, [80.0]);
}

#[test]
fn the_seed_decides() {
    for sampler in [Sampler::Heun, Sampler::UniPc, Sampler::Ipndm] {
        let plan = Plan { churn: Churn { amount: 20.0, ..Churn::NONE }, ..fixed(sampler, 9) };
        let first = picture(&plan).picture;
        assert_eq!(first, picture(&plan).picture);
        assert_ne!(first, picture(&Plan { seed: 10, ..plan }).picture);
        // Also by its upper half.
        assert_ne!(first, picture(&Plan { seed: plan.seed + (1 << 32), ..plan }).picture);
    }
}

#[test]
fn the_last_denoised_picture_is_the_picture() {
    for sampler in Sampler::ALL {
        let mut calls = 0;
        let (outcome, _) = run(&fixed(sampler, 6), Start::Noise, |_, _| {
            calls += 1;
            vec![calls as f32 * 0.1; COUNT]
        });
        assert_eq!(outcome.expect("a picture").picture, vec![calls as f32 * 0.1; COUNT]);
    }
}

/// With a denoiser that sees nothing, the state has the deviation of its level: with churn as well.
#[test]
fn noise_has_the_deviation_of_its_level() {
    const MANY: usize = 1 << 16;
    let churn = Churn { amount: 30.0, lowest: 0.05, highest: 50.0, deviation: 1.0 };
    let mut raised = 0;
    for sampler in [Sampler::Ipndm, Sampler::Heun] {
        let plan = Plan { churn, ..fixed(sampler, 12) };
        let look = |state: &Vec<f32>, sigma: f32, denoised: &mut Vec<f32>| {
            let squares: f64 = state.iter().map(|value| f64::from(*value).powi(2)).sum();
            let deviation = (squares / MANY as f64).sqrt();
            // The deviation of a measured deviation is 1 / sqrt(2 n) of it, 0.28 %.
            assert!((deviation / f64::from(sigma) - 1.0).abs() < 0.012, "{deviation} at {sigma}");
            raised += u32::from(!levels(12).contains(&sigma));
            denoised.fill(0.0);
            Ok(())
        };
        sample(&Cpu, &plan, MANY, Start::Noise, &Silent, look).expect("a picture");
    }
    let within = levels(12).iter().filter(|level| (0.05..=50.0).contains(*level)).count();
    assert_eq!(raised as usize, 2 * within);
}

/// Noise before every step leaves no sampler anything to remember: all take the same steps, of first order.
#[test]
fn noise_on_the_way_forgets() {
    let churn = Churn { amount: 5.0, ..Churn::NONE };
    let [directions, pictures] =
        [Sampler::Ipndm, Sampler::UniPc].map(|sampler| picture(&Plan { churn, ..fixed(sampler, 20) }).picture);
    let largest = directions.iter().zip(&pictures).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(largest < 1.0e-4, "{largest}");
}

#[test]
fn a_run_ends_when_nothing_changes() {
    for sampler in Sampler::ALL {
        let plan = Plan { early_termination: Some(HALF_A_LEVEL), ..fixed(sampler, 25) };
        // Above a certain level nothing is decided, whatever does not change.
        let (outcome, _) = run(&plan, Start::Noise, |_, _| vec![0.3; COUNT]);
        let sampled = outcome.expect("a picture");
        let last = *sampled.levels.last().expect("calls");
        assert!(last <= UNDECIDED_ABOVE && last > 0.3 * UNDECIDED_ABOVE, "{}: {last}", sampler.name());
        assert_eq!(sampled.call_count() + sampled.left_out, sampler.call_count(25));
        assert!(sampled.left_out >= 5 && sampled.picture == vec![0.3; COUNT]);
        // One value that changes is enough to go on.
        let mut calls = 0;
        let (outcome, _) = run(&plan, Start::Noise, |_, _| {
            calls += 1;
            let mut values = vec![0.3; COUNT];
            values[COUNT - 1] = if calls % 2 == 0 { 0.9 } else { -0.9 };
            values
        });
        let sampled = outcome.expect("a picture");
        assert!(*sampled.levels.last().expect("calls") < 0.01, "{}", sampler.name());
    }
    let plan = Plan { steps: Steps::Chosen { tolerance: 1.0e-3, most_calls: 99 }, ..Plan::published(9) };
    let stopped = picture(&Plan { early_termination: Some(HALF_A_LEVEL), ..plan });
    let whole = picture(&plan);
    let largest = stopped.picture.iter().zip(&whole.picture).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(stopped.call_count() < whole.call_count() && largest <= 2.0 * HALF_A_LEVEL, "{largest}");
}

#[test]
fn an_earlier_picture_saves_calls() {
    let earlier: Vec<f32> = (0..COUNT).map(|index| (index as f32 * 0.1).sin()).collect();
    for sampler in Sampler::ALL {
        let start = |level| Start::Picture { picture: &earlier, level };
        let (outcome, states) = run(&fixed(sampler, 10), start(1.0), |state, _| vec![0.5 * state[0]; COUNT]);
        let sampled = outcome.expect("a picture");
        let rest: Vec<f32> = levels(10).into_iter().filter(|level| *level <= 1.0).collect();
        let made = sampler.call_count(rest.len() as u32);
        assert_eq!((sampled.levels[0], sampled.call_count()), (rest[0], made));
        assert_eq!(sampled.left_out, sampler.call_count(10) - made);
        for (element, (value, state)) in earlier.iter().zip(&states[0]).enumerate() {
            assert_eq!(*state, value + rest[0] * normal([9, 0], element as u32, 0));
        }
        // Levels that there are none of: the next that there is.
        for (level, first) in [(1.0e9, 80.0), (0.0, 0.002), (f32::NAN, 0.002)] {
            let (outcome, _) = run(&fixed(sampler, 10), start(level), |_, _| vec![0.0; COUNT]);
            assert_eq!(outcome.expect("a picture").levels[0], first);
        }
    }
    let plan = Plan { steps: Steps::Chosen { tolerance: 1.0e-2, most_calls: 99 }, ..Plan::published(9) };
    for (level, first) in [(1.0, 1.0), (1.0e9, 80.0), (0.0, 0.002), (f32::NAN, 0.002)] {
        let (outcome, _) = run(&plan, Start::Picture { picture: &earlier, level }, |_, _| vec![0.0; COUNT]);
        assert_eq!(outcome.expect("a picture").levels[0], first);
    }
}

#[test]
fn chosen_levels_fall_and_end() {
    let chosen = |tolerance, most_calls| Plan { steps: Steps::Chosen { tolerance, most_calls }, ..Plan::published(9) };
    let sampled = picture(&chosen(1.0e-3, 200));
    assert!(sampled.levels.windows(2).all(|pair| pair[1] < pair[0]), "{:?}", sampled.levels);
    assert_eq!(sampled.levels.last(), Some(&0.002));
    for most_calls in [0, 1, 2, 7] {
        assert_eq!(picture(&chosen(1.0e-3, most_calls)).call_count(), most_calls.max(1));
    }
    // Nothing is good enough, and still it ends: with the shortest steps.
    for tolerance in [0.0, -1.0, f32::NAN, 1.0e-30] {
        let sampled = picture(&chosen(tolerance, 10_000));
        assert!((200..400).contains(&sampled.call_count()), "{}", sampled.call_count());
    }
    // A jump is noticed, and the step over it taken once more, shorter.
    let jump = |_: &[f32], sigma: f32| vec![if sigma > 0.5 { -0.9 } else { 0.9 }; COUNT];
    let sampled = run(&chosen(1.0e-2, 200), Start::Noise, jump).0.expect("a picture");
    assert!(sampled.levels.windows(2).any(|pair| pair[1] >= pair[0]), "{:?}", sampled.levels);
}

#[test]
fn numbers_that_are_none_are_found() {
    for (bad, element) in [(f32::NAN, 0), (f32::INFINITY, 77), (f32::NEG_INFINITY, COUNT - 1)] {
        for sampler in Sampler::ALL {
            let level = levels(8)[3];
            let (outcome, _) = run(&fixed(sampler, 8), Start::Noise, |_, sigma| {
                let mut values = vec![0.1; COUNT];
                if sigma == level {
                    values[element] = bad;
                    values[COUNT - 1] = f32::NAN;
                }
                values
            });
            let Err(FieldError::NotFinite(NotFinite { stage, tensor, index, .. })) = outcome else {
                panic!("{}: no error", sampler.name());
            };
            assert_eq!((tensor.as_str(), index), ("denoised picture", element));
            assert_eq!(stage, format!("denoising at level {level}"));
        }
    }
    let error = NotFinite { stage: "s".into(), tensor: "t".into(), index: 3, value: f32::NAN };
    assert_eq!(error.to_string(), "s: element 3 of the t is not a finite number");
    let infinite = NotFinite { value: f32::INFINITY, ..error };
    assert_eq!(infinite.to_string(), "s: element 3 of the t is inf, not a finite number");
}

#[test]
fn samplers_have_names() {
    for sampler in Sampler::ALL {
        assert_eq!(sampler.to_string().parse(), Ok(sampler));
    }
    let error = "huen".parse::<Sampler>().expect_err("no sampler");
    let names = Sampler::ALL.map(Sampler::name).join(", ");
    assert_eq!(error.to_string(), format!("unknown sampler; there are: {names}"));
}
