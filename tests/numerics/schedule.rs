//! The noise schedule, the factors around the network and the second-order step: against the published levels and
//! formulas in `f64`, and at the extremes.

use crate::{assert_near, relative_units};
use serde_json::Value;
use viewfuse::check::agreement::unit_in_last_place;
use viewfuse::check::poses::Random;
use viewfuse_core::schedule::{
    HeunStep, MAX_LEVEL, NoiseSchedule, Preconditioning, SIGMA_DATA, SMALLEST_LEVEL, ScheduleError,
};

#[test]
fn the_published_levels() {
    let reference: Value = serde_json::from_str(include_str!("../data/schedule.json")).expect("JSON");
    let schedule = NoiseSchedule::published();
    assert_eq!(NoiseSchedule::new(0.002, 80.0), Ok(schedule));
    for count in [4, 18, 25] {
        let numbers = reference["levels"][count.to_string()].as_array().expect("levels");
        let expected: Vec<f64> = numbers.iter().filter_map(Value::as_f64).collect();
        let actual: Vec<f32> = (0..count).map(|index| schedule.level(index, count)).collect();
        assert_near(&actual, &expected, 0.0, 1.0e-6);
    }
}

const ENDS: [(f32, f32); 6] =
    [(0.002, 80.0), (1.0e-3, 1.0), (0.02, 100.0), (1.0e-30, 1.0e30), (1.0e-30, 1.0e-29), (1.0e6, 1.0e30)];

#[test]
fn levels_agree_with_f64_to_a_rounding() {
    // Rests of products are lost where they are below the smallest numbers.
    let [mut worst, mut worst_tiny] = [0.0_f64; 2];
    for (sigma_min, sigma_max) in ENDS {
        let schedule = NoiseSchedule::new(sigma_min, sigma_max).expect("a schedule");
        let [low, high] = [sigma_min, sigma_max].map(|sigma| f64::from(sigma).powf(1.0 / 7.0));
        for count in [2_u32, 3, 4, 25, 50, 1000, 100_003] {
            let mut previous = f32::INFINITY;
            for index in (0..count).step_by(1 + count as usize / 3000) {
                let place = f64::from(index) / f64::from(count - 1);
                let expected = (high + place * (low - high)).powi(7);
                let level = schedule.level(index, count);
                let error = (f64::from(level) - expected).abs() / unit_in_last_place(expected);
                let worst = if expected < 1.0e-28 { &mut worst_tiny } else { &mut worst };
                *worst = worst.max(error);
                assert!(level < previous || count > 1000, "{index} of {count}");
                assert!(level <= previous && (sigma_min..=sigma_max).contains(&level), "{index} of {count}");
                previous = level;
            }
        }
    }
    assert!(worst <= 0.6 && worst_tiny <= 3.0, "{worst} {worst_tiny}");
}

#[test]
fn the_ends_are_exact_and_few_levels_are_no_quotient_of_zeros() {
    for (sigma_min, sigma_max) in ENDS {
        let schedule = NoiseSchedule::new(sigma_min, sigma_max).expect("a schedule");
        assert_eq!([0, 1, 2].map(|index| schedule.level(index, 1)), [sigma_max, 0.0, 0.0]);
        assert_eq!([0, 1, 2].map(|index| schedule.level(index, 2)), [sigma_max, sigma_min, 0.0]);
        assert_eq!([0, 999, 1000, u32::MAX].map(|index| schedule.level(index, 1000)), [sigma_max, sigma_min, 0.0, 0.0]);
        assert_eq!(schedule.level(0, 0), 0.0);
        assert_eq!(schedule.level(u32::MAX - 1, u32::MAX), sigma_min);
        assert!(schedule.level(u32::MAX / 2, u32::MAX).is_finite());
    }
    let constant = NoiseSchedule::new(3.0, 3.0).expect("a schedule");
    assert!((0..50).all(|index| constant.level(index, 50) == 3.0));
}

#[test]
fn impossible_ends_are_refused() {
    for bad in [0.0, -1.0, 9.0e-31, 1.1e30, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(NoiseSchedule::new(bad, 80.0), Err(ScheduleError::Level), "{bad}");
        assert_eq!(NoiseSchedule::new(0.002, bad), Err(ScheduleError::Level), "{bad}");
    }
    assert_eq!(NoiseSchedule::new(80.0, 0.002), Err(ScheduleError::Order));
    assert!(NoiseSchedule::new(SMALLEST_LEVEL, MAX_LEVEL).is_ok());
    assert!(ScheduleError::Level.to_string().contains("1e-30") && ScheduleError::Order.to_string().contains("above"));
}

#[test]
fn preconditioning_agrees_with_f64() {
    let mut random = Random::new(61);
    let levels = (0..200_000).map(|_| random.log_range(1.0e-30, 1.0e30) as f32);
    let mut worst = [0.0_f64; 4];
    for sigma in levels.chain((0..50).map(|index| NoiseSchedule::published().level(index, 50))) {
        let actual = Preconditioning::at(sigma);
        let (s, d) = (f64::from(sigma), f64::from(SIGMA_DATA));
        let norm = s.hypot(d);
        let expected = [(d / norm) * (d / norm), s / norm * d, 1.0 / norm, s.ln() / 4.0];
        let actual = [actual.skip, actual.output, actual.input, actual.noise];
        for ((actual, expected), worst) in actual.into_iter().zip(expected).zip(&mut worst) {
            // Below the normal numbers there are fewer digits.
            let small = expected.abs() < 1.0e-37 && f64::from(actual) < 1.0e-37;
            let units = if small { 0.0 } else { relative_units(actual, expected) };
            *worst = worst.max(units);
        }
    }
    assert!(worst.iter().all(|units| units / 16_777_216.0 <= 4.0e-7), "{worst:?}");
}

#[test]
fn preconditioning_at_its_ends() {
    let at = |sigma: f32| {
        let p = Preconditioning::at(sigma);
        assert!([p.skip, p.output, p.input, p.noise].iter().all(|factor| factor.is_finite()), "{sigma}: {p:?}");
        p
    };
    let clean = at(0.0);
    assert_eq!((clean.skip, clean.output, clean.input), (1.0, 0.0, 2.0));
    assert!((-21.9..-21.8).contains(&clean.noise));
    assert_eq!(clean.denoised(0.7, 123.0), 0.7);
    for none in [-1.0, f32::NAN, f32::NEG_INFINITY] {
        assert_eq!(at(none), clean);
    }
    let tiny = at(1.0e-30);
    assert_eq!((tiny.skip, tiny.output, tiny.input), (1.0, 1.0e-30, 2.0));
    let large = at(1.0e6);
    assert!(large.skip < 2.6e-13 && large.output == 0.5 && large.input <= 1.0e-6);
    assert_eq!(large.network_input(1.0e6), 1.0);
    for huge in [1.0e20, 1.0e38, f32::MAX, f32::INFINITY] {
        let p = at(huge);
        assert!(p.skip < 1.0e-38 && p.output == 0.5 && p.input <= 1.0e-20, "{huge}: {p:?}");
    }
}

#[test]
fn steps_at_their_ends() {
    let last = HeunStep::between(0.002, 0.0);
    assert_eq!((last.remaining, last.correction, last.is_corrected()), (0.0, 0.0, false));
    // Whatever the state was, the last step returns what the denoiser says.
    assert_eq!(last.euler(0.123, 0.456), 0.456);
    assert_eq!(last.correct(0.456, 0.456, f32::MAX), 0.456);
    let levels = [0.0, 1.0e-30, 0.002, 80.0, 1.0e6, 1.0e30];
    for sigma in levels {
        let stay = HeunStep::between(sigma, sigma);
        assert_eq!(stay.correction, 0.0);
        for next in levels {
            let step = HeunStep::between(sigma, next);
            assert!(step.remaining.is_finite() && step.remaining >= 0.0, "{sigma} {next}: {step:?}");
            assert!(step.correction.is_finite() && step.correction >= -0.5, "{sigma} {next}: {step:?}");
            assert_eq!(step.euler(0.25, 0.25), 0.25);
            assert_eq!(step.correct(0.25, -1.0, -1.0), 0.25);
        }
    }
}

/// Of each step over the published levels, in `f64`: the slope before it, and the mean of that and the one behind it.
#[test]
fn the_steps_are_the_published_ones() {
    let (schedule, mut random) = (NoiseSchedule::published(), Random::new(63));
    for (count, index) in [2, 4, 18, 25, 1000].into_iter().flat_map(|count| (0..count).map(move |index| (count, index)))
    {
        let (sigma, next) = (schedule.level(index, count), schedule.level(index + 1, count));
        let step = HeunStep::between(sigma, next);
        let [noisy, denoised, there] = [sigma, 1.0, 1.0].map(|scale| scale * random.normal() as f32);
        let stepped = step.euler(noisy, denoised);
        let corrected = if step.is_corrected() { step.correct(stepped, denoised, there) } else { stepped };

        let [s, n, x, d, e] = [sigma, next, noisy, denoised, there].map(f64::from);
        let slope = (x - d) / s;
        let first = x + (n - s) * slope;
        let second = if n > 0.0 { x + (n - s) * 0.5 * (slope + (first - e) / n) } else { first };
        // Fewer than eight roundings of what is added; the correction multiplies a difference.
        let size = x.abs() + d.abs() + e.abs() + f64::from(step.correction) * (e - d).abs();
        let off = (f64::from(stepped) - first).abs().max((f64::from(corrected) - second).abs());
        assert!(off <= 8.0 * size / 16_777_216.0, "{index} of {count}: {off:e}");
    }
}
