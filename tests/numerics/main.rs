//! Arithmetic against `f64`, known answers and the published codes: every function of core, its errors and its ends.

mod agreement;
mod attention;
mod camera;
mod census;
mod compositing;
mod front;
mod gaussian;
mod gaussians;
mod group_norm;
mod half_precision;
mod lens;
mod math;
mod metrics;
mod network;
mod plane_sweep;
mod quantised;
mod rays;
mod sampler;
mod sampling;
mod schedule;
mod visual_hull;
mod volumes;
mod weighting;
mod weights;

use viewfuse::check::agreement::{Limits, measure};
use viewfuse::check::bounded::Bounded;

/// Relative error in units of `2^-24`; 0 for equal numbers, infinite for NaN.
fn relative_units(actual: f32, expected: f64) -> f64 {
    if f64::from(actual) == expected {
        return 0.0;
    }
    let units = (f64::from(actual) - expected).abs() / expected.abs() * 16_777_216.0;
    if units.is_nan() { f64::INFINITY } else { units }
}

/// Numbers that are no farther from the expected ones than a number of units of `2^-24` and a share of each, and vary.
#[track_caller]
fn assert_near(actual: &[f32], expected: &[f64], units: f64, share: f64) {
    let bounded = |value: &f64| Some(Bounded { value: *value, error: units / 16_777_216.0 + share * value.abs() });
    let expected: Vec<Option<Bounded>> = expected.iter().map(bounded).collect();
    let limits = Limits { tolerance: f64::MAX, least: 1.0e-2 };
    assert_eq!(measure(actual, &expected, limits).disagreement, None);
}
