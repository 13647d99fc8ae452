//! Coefficients against `f64`, and at their ends.

use viewfuse::check::poses::Random;
use viewfuse_core::math::ln_ratio;
use viewfuse_core::sampler::churn::Churn;
use viewfuse_core::sampler::control::{
    HALF_A_LEVEL, LONGEST_STEP, SHORTEST_STEP, UNDECIDED_ABOVE, change_to_come, reached, verdict,
};
use viewfuse_core::sampler::{History, Mix, Sampler, mixed_element};
use viewfuse_core::schedule::NoiseSchedule;

/// `integral over [0, 1] of weight(t) p(t)` for the polynomial through 1 at `places[own]` and 0 at the others, by
/// Simpson's rule.
fn integral(places: &[f64], chosen: usize, weight: impl Fn(f64) -> f64) -> f64 {
    const PIECES: usize = 4000;
    let value = |t: f64| {
        let others = places.iter().enumerate().filter(|(index, _)| *index != chosen);
        weight(t) * others.map(|(_, place)| (t - place) / (places[chosen] - place)).product::<f64>()
    };
    let sum = (0..=PIECES).map(|index| {
        let factor = if index == 0 || index == PIECES { 1.0 } else { 2.0 + 2.0 * (index % 2) as f64 };
        factor * value(index as f64 / PIECES as f64)
    });
    sum.sum::<f64>() / (3.0 * PIECES as f64)
}

/// What a step of so many results from `levels[0]` to `next` should be; with `reached`, the result there comes first.
fn expected(levels: &[f64], next: f64, reached: bool) -> Vec<f64> {
    let from = levels[0];
    let h = (from / next).ln();
    let place = |level: &f64| (from / level).ln() / h;
    let places: Vec<f64> = reached.then_some(1.0).into_iter().chain(levels.iter().map(place)).collect();
    (0..places.len()).map(|index| integral(&places, index, |t| h * (-h * (1.0 - t)).exp())).collect()
}

/// How far coefficients are off, in units of 2^-24 of the sum of their magnitudes: that is what rounding of the results
/// costs as well.
fn units_off(mix: &Mix, expected: &[f64]) -> f64 {
    let size: f64 = expected.iter().map(|coefficient| coefficient.abs()).sum();
    let off = mix.results.iter().zip(expected).map(|(actual, expected)| (f64::from(*actual) - expected).abs());
    assert!(mix.results[expected.len()..].iter().all(|coefficient| *coefficient == 0.0));
    off.fold(0.0, f64::max) / size * 16_777_216.0
}

#[test]
fn coefficients_agree_with_f64() {
    let mut random = Random::new(71);
    let mut worst = [0.0_f64; 2];
    for trial in 0..600 {
        // Steps of any length; a later one up to four times as long or short as the one before.
        let mut levels = vec![random.log_range(1.0e-3, 80.0)];
        let mut length = random.log_range(1.0e-3, 2.0);
        for _ in 0..4 {
            levels.push(levels[levels.len() - 1] * f64::exp(-length));
            length = (length * random.log_range(0.25, 4.0)).min(3.0);
        }
        let known = 1 + trial % 4;
        let levels: Vec<f32> = levels.into_iter().map(|level| level as f32).collect();
        let (levels, next) = (&levels[4 - known..4], levels[4]);
        let mut history = History::NONE;
        levels.iter().for_each(|level| history.push(*level));
        let newest_first: Vec<f64> = levels.iter().rev().map(|level| f64::from(*level)).collect();
        let next_exact = f64::from(next);
        let three = &newest_first[..known.min(3)];
        let cases = [
            (Sampler::UniPc.step(&history, next), expected(three, next_exact, false)),
            (Sampler::UniPc.correction(&history, next), expected(three, next_exact, true)),
        ];
        for ((mix, expected), worst) in cases.iter().zip(&mut worst) {
            *worst = worst.max(units_off(mix, expected));
        }
        assert_eq!(cases[0].0.state, next / levels[known - 1]);
    }
    assert!(worst.iter().all(|units| *units <= 12.0), "{worst:?}");
}

/// On even steps the directions' coefficients are the integrals of the polynomial through them.
#[test]
fn coefficients_of_directions_agree_with_f64_on_even_steps() {
    let mut history = History::NONE;
    for (known, level) in (0..9).map(|index| 9.0 - index as f32).enumerate() {
        history.push(level);
        let next = level - 1.0;
        let places: Vec<f64> = (0..=known.min(3)).map(|back| -(back as f64)).collect();
        let expected: Vec<f64> = (0..places.len()).map(|index| integral(&places, index, |_| -1.0)).collect();
        let mix = Sampler::Ipndm.step(&history, next);
        if next > 0.0 {
            assert!(mix.state == 1.0 && units_off(&mix, &expected) <= 2.0, "{mix:?}, not {expected:?}");
        } else {
            assert_eq!(mix, Mix { state: 1.0, results: [-1.0, 0.0, 0.0, 0.0] });
        }
    }
}

#[test]
fn logarithms_of_quotients_agree_with_f64() {
    let mut random = Random::new(72);
    let mut worst = 0.0_f64;
    for _ in 0..200_000 {
        let b = random.log_range(1.0e-20, 1.0e10) as f32;
        let far = random.log_range(1.0e-7, 20.0);
        let a = (f64::from(b) * if random.unit() < 0.5 { far } else { -far }.exp()) as f32;
        let expected = (f64::from(a) / f64::from(b)).ln();
        if expected != 0.0 {
            worst = worst.max((f64::from(ln_ratio(a, b)) / expected - 1.0).abs());
        }
    }
    assert!(worst <= 4.0e-7, "{worst:e}");
    // The largest numbers' sum is infinite.
    for (a, b) in [(3.0e38_f32, 2.0e38), (2.5e38, 1.5e38), (1.5e38, 3.4e38), (f32::MAX, 1.0)] {
        let expected = (f64::from(a) / f64::from(b)).ln();
        assert!((f64::from(ln_ratio(a, b)) / expected - 1.0).abs() < 4.0e-7, "{a:e} / {b:e}");
    }
    assert_eq!(ln_ratio(3.0, 3.0), 0.0);
}

#[test]
fn steps_at_their_ends() {
    let levels = [1.0e30, 80.0, 79.0, 1.0, 0.002, 1.0e-30];
    for sampler in Sampler::ALL {
        let mut history = History::NONE;
        assert_eq!(sampler.step(&history, 1.0), Mix::STAY);
        for (known, level) in levels.iter().enumerate() {
            history.push(*level);
            assert_eq!(history.count() as usize, (known + 1).min(4));
            // The last step gives what the denoiser said: of the state, 7, and of that.
            let last = sampler.step(&history, 0.0);
            let kept = sampler.kept(*level).map_or(0.25, |mix| mix.of(7.0, &[0.25, 0.0, 0.0, 0.0]));
            let picture = last.of(7.0, &[kept, f32::NAN, f32::NAN, f32::NAN]);
            let lost = if sampler.kept(*level).is_some() { 1.0e-6 } else { 0.0 };
            assert!((picture - 0.25).abs() <= lost, "{} from {level}: {picture}", sampler.name());
            for next in [*level, 2.0 * level] {
                assert_eq!(sampler.step(&history, next), Mix::STAY);
                assert_eq!(sampler.correction(&history, next), Mix::STAY);
            }
            for next in [0.9 * level, 0.1 * level].into_iter().chain(levels[known + 1..].iter().copied()) {
                let mixes = [sampler.step(&history, next), sampler.correction(&history, next)];
                let mut all = mixes.iter().flat_map(|mix| mix.results.iter().chain([&mix.state]));
                assert!(all.all(|coefficient| coefficient.is_finite()), "{sampler} {level} {next}");
            }
        }
        // A level that is not lower: nothing before it counts.
        history.push(1.0);
        assert_eq!(history.count(), 1);
    }
}

#[test]
fn calls_and_levels() {
    for sampler in Sampler::ALL {
        for count in 1..60 {
            let levels = sampler.level_count(count);
            assert!(sampler.call_count(levels) <= count && sampler.call_count(levels + 1) > count);
        }
    }
    assert_eq!([4, 25].map(|levels| Sampler::Heun.call_count(levels)), [7, 49]);
}

#[test]
fn what_has_no_coefficient_counts_nothing() {
    let mix = Mix { state: 0.0, results: [0.0, 2.0, 0.0, 0.0] };
    assert_eq!(mix.of(f32::NAN, &[f32::NAN, 3.0, f32::INFINITY, f32::NAN]), 6.0);
    let none: &[f32] = &[];
    assert_eq!(mixed_element(&mix, none, none, &[0.0, 3.0], none, none, 1), 6.0);
}

#[test]
fn churn_is_the_published_one() {
    let churn = Churn { amount: 40.0, lowest: 0.05, highest: 50.0, deviation: 1.003 };
    for count in [18, 25, 256] {
        let gamma = (40.0 / f64::from(count)).min(2.0_f64.sqrt() - 1.0);
        for index in 0..count {
            let sigma = NoiseSchedule::published().level(index, count);
            let churned = churn.before(sigma, count);
            if !(0.05..=50.0).contains(&sigma) {
                assert_eq!((churned.level, churned.scale), (sigma, 0.0));
                continue;
            }
            let (level, sigma) = (f64::from(sigma) * (1.0 + gamma), f64::from(sigma));
            let scale = (level * level - sigma * sigma).sqrt() * f64::from(1.003_f32);
            assert!((f64::from(churned.level) / level - 1.0).abs() < 3.0e-7);
            assert!((f64::from(churned.scale) / scale - 1.0).abs() < 5.0e-7);
        }
    }
    assert_eq!(Churn::NONE.before(3.0, 9).scale, 0.0);
    for amount in [1.0e-30, 1.0e-9, f32::MAX, f32::INFINITY, f32::NAN] {
        let churned = Churn { amount, ..Churn::NONE }.before(80.0, 25);
        assert!(churned.scale >= 0.0 && churned.scale <= 80.1 && churned.level >= 80.0, "{amount}: {churned:?}");
    }
}

#[test]
fn verdicts() {
    // An error that is as large as it may be: nine tenths of the step. A sixteenth of it, at order 4: twice that.
    let fair = verdict(0.01, 0.01, 0.5, 4);
    assert!(fair.is_accepted && (fair.step - 0.45).abs() < 1.0e-6);
    assert!((verdict(0.01 / 16.0, 0.01, 0.5, 4).step - 0.9).abs() < 1.0e-6);
    assert!(verdict(0.049, 0.01, 0.5, 4).is_accepted && !verdict(0.051, 0.01, 0.5, 4).is_accepted);
    assert_eq!(verdict(0.0, 0.01, 0.5, 4).step, 1.0);
    assert_eq!(verdict(0.0, 0.01, 1.4, 4).step, LONGEST_STEP);
    for bad in [f32::NAN, f32::INFINITY, 1.0e30] {
        let refused = verdict(bad, 0.01, 1.0, 2);
        assert!(!refused.is_accepted && (refused.step - 0.3).abs() < 1.0e-6, "{bad}: {refused:?}");
        // Nothing hangs.
        assert!(verdict(bad, 0.01, SHORTEST_STEP, 2).is_accepted);
    }
    assert_eq!(verdict(1.0, 0.0, 0.1, 3).step, SHORTEST_STEP);
    assert_eq!(verdict(1.0, f32::NAN, 0.1, 3).step, SHORTEST_STEP);
    assert_eq!([reached(1.0, 0.0, 0.5), reached(1.0, 1.0, 0.3), reached(1.0, 1.0, 0.9)], [1.0, 0.3, 0.9]);
    // Halved from 0.02 to 0.01: as much is to come.
    assert_eq!(change_to_come(HALF_A_LEVEL, 0.02, 0.01), HALF_A_LEVEL);
    assert_eq!(change_to_come(0.0, 1.0, 1.01 * UNDECIDED_ABOVE), f32::INFINITY);
    assert_eq!(change_to_come(0.0, 0.01, 0.01), f32::INFINITY);
}

#[test]
fn embedded_differences_are_between_orders() {
    // Even steps down to 1: Adams and Bashforth's coefficients of so many results less those of one result less, times
    // -1.
    let history = |levels: &[f32]| {
        let mut history = History::NONE;
        levels.iter().for_each(|level| history.push(*level));
        history
    };
    let difference = |levels: &[f32]| Sampler::Ipndm.embedded_difference(&history(levels), 1.0).expect("two orders");
    assert_eq!(difference(&[3.0, 2.0]), Mix { state: 0.0, results: [-0.5, 0.5, 0.0, 0.0] });
    let third = difference(&[4.0, 3.0, 2.0]);
    let expected = [-5.0, 10.0, -5.0, 0.0].map(|twelfths| twelfths / 12.0);
    let off = third.results.iter().zip(expected).map(|(result, expected)| (result - expected).abs());
    assert!(third.state == 0.0 && off.fold(0.0, f32::max) < 1.0e-6, "{third:?}");
    for sampler in Sampler::ALL {
        // A single result, and a level that is not lower, tell nothing.
        assert_eq!(sampler.embedded_difference(&history(&[2.0]), 1.0), None, "{sampler}");
        assert_eq!(sampler.embedded_difference(&history(&[3.0, 2.0]), 2.0), None, "{sampler}");
        // What the step adds to that by one result less, for all that have two.
        let (two, one) = (sampler.step(&history(&[3.0, 2.0]), 1.0), sampler.step(&history(&[2.0]), 1.0));
        match sampler.embedded_difference(&history(&[3.0, 2.0]), 1.0) {
            Some(mix) => (0..4).for_each(|index| {
                assert!((two.results[index] - one.results[index] - mix.results[index]).abs() < 1.0e-6, "{sampler}");
            }),
            None => assert!(sampler.is_single_step(), "{sampler}"),
        }
    }
}
