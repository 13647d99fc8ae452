//! The power of the step with which errors shrink.

use super::walk::{published, row, start, walk};
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
