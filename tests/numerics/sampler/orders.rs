//! The power of the step with which errors shrink.

use super::walk::{mixed, published, row, start, walk};
use viewfuse_core::sampler::Sampler;
use viewfuse_tests::mixture::{Mixture, distance};

/// Wide data: the flow is smooth, and errors follow their power soon.
fn smooth() -> Mixture {
    Mixture::new(3, &[0.4, 0.6, 0.5])
}

/// Errors at the smallest level for each of these numbers of levels.
fn errors(counts: &[u32], run: impl Fn(&[f32]) -> Vec<f64>) -> Vec<f64> {
    let truth = smooth().solution(&start(80.0), 80.0, f64::from(0.002_f32), 4000);
    let error = |count: &u32| distance(&run(&published(*count)[..*count as usize]), &truth);
    counts.iter().map(error).collect()
}

fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).log2()).collect()
}

#[test]
fn the_oracle_does_not_move() {
    let solved = |count| smooth().solution(&start(80.0), 80.0, f64::from(0.002_f32), count);
    let moved = distance(&solved(2000), &solved(4000));
    assert!(moved < 1.0e-10, "{moved:e}");
}

#[test]
fn every_sampler_has_its_order() {
    println!("\n{:>10}  error with 20, 40, 80, 160 levels          observed order", "");
    for sampler in Sampler::ALL {
        let errors = errors(&[20, 40, 80, 160], |levels| walk(sampler, levels, &start(80.0), &smooth()));
        let observed = orders(&errors);
        println!("{:>10}  {}  {observed:.2?}", sampler.name(), row(&errors));
        // The last doubling whose error the coefficients' own rounding does not show in.
        let last = observed.iter().zip(&errors[1..]).rfind(|(_, error)| **error > 3.0e-6).map(|(order, _)| *order);
        let (last, nominal) = (last.expect("an error that can be seen"), f64::from(sampler.order()));
        assert!((nominal - 0.35..nominal + 0.8).contains(&last), "{}: {last:.2}, not {nominal}", sampler.name());
    }
}

/// DPM-Solver++(3M) as its authors' code has it: the second difference counts half, and the order is 2.
#[test]
fn the_published_third_order_is_second() {
    let run = |levels: &[f32]| {
        let mixture = smooth();
        let mut said: Vec<(f64, Vec<f64>)> = Vec::new();
        let mut state = start(80.0);
        for (sigma, next) in levels.iter().zip(&levels[1..]) {
            let (sigma, next) = (f64::from(*sigma), f64::from(*next));
            said.insert(0, (sigma, mixture.denoised(&state, sigma)));
            let h = (sigma / next).ln();
            let phi = 1.0 - next / sigma;
            let combined = |index: usize| {
                let newest = said[0].1[index];
                if said.len() < 3 {
                    return phi * newest;
                }
                let (r, q) = ((said[1].0 / sigma).ln() / h, (said[2].0 / said[1].0).ln() / h);
                let (first, second) = ((newest - said[1].1[index]) / r, (said[1].1[index] - said[2].1[index]) / q);
                let slope = first + r / (r + q) * (first - second);
                let bend = (first - second) / (r + q);
                phi * newest + (1.0 - phi / h) * slope + (0.5 - (1.0 - phi / h) / h) * bend
            };
            let stepped = (0..state.len()).map(|index| next / sigma * state[index] + combined(index));
            state = stepped.collect();
        }
        state
    };
    let errors = errors(&[80, 160, 320], run);
    let observed = orders(&errors);
    println!("published dpm++3m: {}, orders {observed:.2?}", row(&errors));
    assert!((1.7..2.3).contains(&observed[1]), "{observed:?}");
}

/// On even steps the coefficients of `ipndm` are those of `ipndm-v`.
#[test]
fn even_steps_are_a_case_of_uneven_ones() {
    let levels: Vec<f32> = (0..9).map(|index| 9.0 - index as f32).collect();
    let mut history = viewfuse_core::sampler::History::NONE;
    for pair in levels.windows(2) {
        history.push(pair[0]);
        let [even, uneven] =
            [Sampler::Ipndm, Sampler::IpndmUneven].map(|sampler| sampler.step(&history, pair[1]).results);
        for (even, uneven) in even.iter().zip(uneven) {
            assert!((even - uneven).abs() <= 1.0e-6, "{even} {uneven}");
        }
    }
    let state = mixed(&Sampler::Ipndm.step(&history, 0.0), &[5.0], &[&[2.5], &[9.0], &[9.0], &[9.0]]);
    assert_eq!(state, [0.0]);
}
