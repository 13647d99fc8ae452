//! The elementary functions against `f64`: dense sweeps, extremes, and the errors that their documentation states.

use viewfuse::check::agreement::unit_in_last_place;
use viewfuse::check::poses::Random;
use viewfuse_core::math;

/// Every `stride`-th `f32` from `low` to `high`, both at least 0, and both ends.
fn sweep(low: f32, high: f32, stride: usize) -> impl Iterator<Item = f32> {
    (low.to_bits()..=high.to_bits()).step_by(stride).map(f32::from_bits).chain([high])
}

/// Largest of the second numbers; NaN wins.
fn worst(cases: impl Iterator<Item = (f32, f64)>) -> (f32, f64) {
    cases.fold((0.0, 0.0), |worst, case| if case.1 <= worst.1 { worst } else { case })
}

#[track_caller]
fn assert_below(what: &str, (at, error): (f32, f64), bound: f64) {
    assert!(error <= bound, "{what}: {error:e} at {at:e}, stated {bound:e}");
}

/// How far a function is off at a number, units in the last place.
fn off(ours: fn(f32) -> f32, exact: fn(f64) -> f64) -> impl Fn(f32) -> (f32, f64) + Copy {
    move |x| {
        let expected = exact(f64::from(x));
        (x, (f64::from(ours(x)) - expected).abs() / unit_in_last_place(expected))
    }
}

#[test]
fn functions_of_one_number_are_within_their_errors() {
    let exp = off(math::exp, f64::exp);
    let both = sweep(0.0, 87.3, 97).map(|x| exp(-x)).chain(sweep(0.0, 88.7, 97).map(exp));
    assert_below("exp, ULP", worst(both), 1.1);
    let ln = off(math::ln, f64::ln);
    assert_below("ln, ULP", worst(sweep(f32::MIN_POSITIVE, f32::MAX, 197).map(ln)), 0.9);
    assert_below("ln around 1, ULP", worst(sweep(0.7, 1.5, 1).map(ln)), 0.9);
    let root = off(math::seventh_root, |x| x.powf(1.0 / 7.0));
    assert_below("seventh_root, ULP", worst(sweep(f32::MIN_POSITIVE, f32::MAX, 197).map(root)), 1.3);
    assert_below("seventh_root around 1, ULP", worst(sweep(0.5, 2.0, 3).map(root)), 1.3);
}

#[test]
fn exp_at_its_ends() {
    assert_eq!(math::exp(0.0), 1.0);
    assert_eq!(math::exp(-0.0), 1.0);
    assert_eq!(math::exp(f32::MIN_POSITIVE), 1.0);
    assert!(math::exp(-87.3) >= f32::MIN_POSITIVE);
    for low in [-87.31, -88.0, -1.0e10, f32::MIN, f32::NEG_INFINITY, f32::NAN] {
        assert_eq!(math::exp(low), 0.0, "{low}");
    }
    for high in [88.71, 1.0e10, f32::MAX, f32::INFINITY] {
        assert_eq!(math::exp(high), math::exp(88.7), "{high}");
        assert!(math::exp(high).is_finite());
    }
}

#[test]
fn ln_at_its_ends() {
    assert_eq!(math::ln(1.0), 0.0);
    let lowest = math::ln(f32::MIN_POSITIVE);
    assert!((-87.4..-87.3).contains(&lowest), "{lowest}");
    for low in [0.0, -0.0, 1.0e-40, -1.0, f32::NEG_INFINITY, f32::NAN] {
        assert_eq!(math::ln(low), lowest, "{low}");
    }
    assert_eq!(math::ln(f32::INFINITY), math::ln(f32::MAX));
    assert!((88.7..88.8).contains(&math::ln(f32::MAX)));
}

#[test]
fn seventh_roots_at_their_ends() {
    assert_eq!(math::seventh_root(1.0), 1.0);
    assert_eq!(math::seventh_root(128.0), 2.0);
    for low in [0.0, -0.0, 1.0e-40, -1.0, f32::NEG_INFINITY, f32::NAN] {
        assert_eq!(math::seventh_root(low), 0.0, "{low}");
    }
    assert_eq!(math::seventh_root(f32::INFINITY), math::seventh_root(f32::MAX));
}

#[test]
fn sin_cos_is_within_its_absolute_error() {
    let error = |x: f32| {
        let (sin, cos) = math::sin_cos(x);
        let (s, c) = f64::from(x).sin_cos();
        (x, (f64::from(sin) - s).abs().max((f64::from(cos) - c).abs()))
    };
    let both = |range: f32, stride: usize| sweep(0.0, range, stride).flat_map(|x| [x, -x]).map(error);
    assert_below("sin_cos up to 90 rad, absolute", worst(both(90.0, 97)), 9.0e-8);
    assert_below("sin_cos up to 8192 rad, absolute", worst(both(8192.0, 101)), 9.0e-8);
}

#[test]
fn sin_cos_stays_in_its_range_everywhere() {
    for x in sweep(8192.0, f32::MAX, 1009).flat_map(|x| [x, -x]) {
        let (sin, cos) = math::sin_cos(x);
        assert!(sin.abs() <= 1.000_000_2 && cos.abs() <= 1.000_000_2, "{x}: {sin} {cos}");
    }
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(math::sin_cos(x), (0.0, 1.0));
    }
    assert_eq!(math::sin_cos(0.0), (0.0, 1.0));
    assert_eq!(math::sin_cos(1.0e-30).0, 1.0e-30);
}

#[test]
fn angles_are_relatively_accurate() {
    let error = |y: f32, x: f32| {
        let expected = f64::from(y).atan2(f64::from(x));
        (y / x, (f64::from(math::angle_from_components(y, x)) - expected).abs() / unit_in_last_place(expected))
    };
    let ratios = sweep(1.0e-30, 1.0e30, 53).flat_map(|y| [error(y, 1.0), error(y, -1.0)]);
    assert_below("angle_from_components of (y, +-1), ULP", worst(ratios), 3.0);
    let mut random = Random::new(1);
    let pairs = (0..2_000_000).map(|_| {
        let y = random.log_range(1.0e-6, 1.0e6) as f32;
        let x = random.log_range(1.0e-6, 1.0e6) as f32;
        error(y, if random.unit() < 0.5 { -x } else { x })
    });
    assert_below("angle_from_components of random components, ULP", worst(pairs), 3.0);
}

#[test]
fn angles_at_their_ends() {
    use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    assert_eq!(math::angle_from_components(0.0, 0.0), 0.0);
    assert_eq!(math::angle_from_components(0.0, 2.0), 0.0);
    assert_eq!(math::angle_from_components(0.0, -2.0), PI);
    assert_eq!(math::angle_from_components(3.0, 0.0), FRAC_PI_2);
    assert_eq!(math::angle_from_components(3.0, 3.0), FRAC_PI_4);
    assert_eq!(math::angle_from_components(f32::MAX, f32::MIN_POSITIVE), FRAC_PI_2);
    for i in 0..=1000 {
        let (sin, cos) = math::sin_cos(PI * i as f32 / 1000.0);
        let angle = math::angle_from_components(sin.max(0.0), cos);
        assert!((0.0..=PI).contains(&angle));
    }
}

#[test]
fn norms_neither_overflow_nor_vanish() {
    let mut random = Random::new(2);
    let mut error = |low: f64, high: f64| {
        let [x, y, z] = [0; 3].map(|_| (random.log_range(low, high) * (random.unit() - 0.5).signum()) as f32);
        let wide = [x, y, z].map(f64::from);
        let expected = wide.iter().map(|c| c * c).sum::<f64>().sqrt();
        (x, (f64::from(math::norm3(x, y, z)) - expected).abs() / unit_in_last_place(expected))
    };
    for (what, count, low, high, bound) in [
        ("norm3, ULP", 1_000_000, 1.0e-6, 1.0e6, 2.0),
        ("norm3 around 1e-15, ULP", 300_000, 1.0e-16, 1.0e-14, 3.0),
        ("norm3 of small components, ULP", 300_000, 1.0e-34, 1.0e-15, 3.0),
        ("norm3 of large components, ULP", 300_000, 1.0e14, 1.0e37, 3.0),
    ] {
        assert_below(what, worst((0..count).map(|_| error(low, high))), bound);
    }
    assert_eq!(math::norm3(0.0, 0.0, 0.0), 0.0);
    assert_eq!(math::norm3(-3.0, 0.0, 4.0), 5.0);
    for at in 0..3 {
        let with = |value: f32, other: f32| {
            let mut three = [1.0, other, 2.0];
            three[at] = value;
            math::norm3(three[0], three[1], three[2])
        };
        assert!(with(f32::NAN, 0.0).is_nan() && with(f32::NAN, 1.0e30).is_nan(), "{at}");
        assert_eq!((with(f32::INFINITY, 0.0), with(f32::NEG_INFINITY, 1.0)), (f32::INFINITY, f32::INFINITY), "{at}");
    }
    assert_eq!(math::norm3(3.0e30, 4.0e30, 0.0), 5.0e30);
}

#[test]
fn small_functions() {
    for (x, floor) in [(0.0, 0), (0.9, 0), (-0.1, -1), (-1.0, -1), (3.0, 3), (-3.5, -4), (f32::NAN, 0)] {
        assert_eq!(math::floor_to_i32(x), floor, "{x}");
    }
    assert_eq!(math::floor_to_i32(1.0e20), i32::MAX);
    assert_eq!(math::floor_to_i32(-1.0e20), i32::MIN);
    assert_eq!(math::floor_to_i32(f32::NEG_INFINITY), i32::MIN);
    assert_eq!(math::min(f32::NAN, 1.0), 1.0);
    assert_eq!(math::max(f32::NAN, 1.0), 1.0);
    assert_eq!(math::clamp(f32::NAN, 2.0, 3.0), 2.0);
    assert_eq!(math::clamp(f32::INFINITY, 2.0, 3.0), 3.0);
    for k in -126..=127 {
        assert_eq!(f64::from(math::exact_power_of_two(k)), f64::from(k).exp2());
    }
    for x in sweep(1.0e-30, 1.0e30, 1_000_003) {
        assert_eq!(f64::from(math::sqrt(x)), f64::from(f64::from(x).sqrt() as f32));
    }
    assert!(math::sqrt(-1.0).is_nan());
}
