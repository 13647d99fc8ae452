//! Means over scenes with confidence intervals.
//!
//! Views of one scene are alike, so a scene's score is one number, the mean over its views, and the sample size is the
//! number of scenes. The interval is Student's: the mean plus and minus the standard error (the standard deviation of
//! scenes, with their count less one, over the root of their count) times the quantile of the t distribution. It
//! contains the mean over all scenes of the kind in 95 of 100 evaluations if scenes are drawn at random and their
//! scores are approximately normal.
//!
//! Two schemes are compared by their difference on each scene ([`Interval::of_differences`]): most of the variation
//! between scenes is common to both.

use serde::Serialize;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

/// The confidence level.
const CONFIDENCE: f64 = 0.95;

/// A mean with its confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Interval {
    /// Mean over scenes.
    pub mean: f64,
    /// Half the width of the 95 % interval; `None` for a single scene, from which it cannot be estimated, and where a
    /// score is infinite.
    pub half_width: Option<f64>,
    /// How many scenes.
    pub count: usize,
}

impl Interval {
    /// From one score for each scene; `None` without scenes.
    pub fn of(scores: &[f64]) -> Option<Interval> {
        let count = scores.len();
        if count == 0 {
            return None;
        }
        let mean = scores.iter().sum::<f64>() / count as f64;
        let deviations: f64 = scores.iter().map(|score| (score - mean).powi(2)).sum();
        let half_width = (count > 1 && deviations.is_finite()).then(|| {
            let freedom = count - 1;
            quantile(freedom) * (deviations / freedom as f64 / count as f64).sqrt()
        });
        Some(Interval { mean, half_width, count })
    }

    /// From the differences `a - b` on the scenes that both have; `None` if there is no such scene.
    pub fn of_differences<S: Ord>(a: &BTreeMap<S, f64>, b: &BTreeMap<S, f64>) -> Option<Interval> {
        // Two infinite scores are two equal pictures.
        let difference = |a: f64, b: f64| if a == b { 0.0 } else { a - b };
        let differences = a.iter().filter_map(|(scene, score)| Some(difference(*score, *b.get(scene)?)));
        Interval::of(&differences.collect::<Vec<_>>())
    }

    /// Whether 0 lies outside: for a difference, whether it is significant. Without a width it is unknown: `false`, but
    /// for an infinite difference, of a picture that is exact.
    pub fn excludes_zero(&self) -> bool {
        self.half_width.map_or(self.mean.is_infinite(), |half_width| self.mean.abs() > half_width)
    }
}

/// The two-sided 95 % quantile of Student's t distribution with this many degrees of freedom, at least 1.
fn quantile(freedom: usize) -> f64 {
    let root = (freedom as f64).sqrt();
    // In the angle whose tangent is t / root the probability grows from 0 to 1 at pi / 2.
    let (mut low, mut high) = (0.0, FRAC_PI_2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if probability(middle, freedom) < CONFIDENCE { low = middle } else { high = middle }
    }
    root * (0.5 * (low + high)).tan()
}

/// The probability that the variable's angle is below this one in magnitude: finite sums for whole degrees of freedom
/// (Abramowitz and Stegun, 26.7.3 and 26.7.4).
fn probability(angle: f64, freedom: usize) -> f64 {
    let (sine, cosine) = angle.sin_cos();
    let is_odd = freedom % 2 == 1;
    // 1 + 1/2 cos^2 + 1/2 3/4 cos^4 ..., or cos + 2/3 cos^3 + 2/3 4/5 cos^5 ...
    let (mut term, mut sum) = (if is_odd { cosine } else { 1.0 }, 0.0);
    let mut power = freedom % 2;
    while power + 2 <= freedom {
        sum += term;
        term *= cosine * cosine * (power + 1) as f64 / (power + 2) as f64;
        power += 2;
    }
    if is_odd { (angle + sine * sum) / FRAC_PI_2 } else { sine * sum }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_tables() {
        let table =
            [(1, 12.7062), (2, 4.30265), (3, 3.18245), (4, 2.77645), (5, 2.57058), (10, 2.22814), (30, 2.04227)];
        for (freedom, expected) in table.into_iter().chain([(100, 1.98397), (2000, 1.96115)]) {
            let ours = quantile(freedom);
            assert!((ours / expected - 1.0).abs() < 3.0e-6, "{freedom}: {ours} is not {expected}");
        }
    }

    #[test]
    fn of_three_scenes() {
        let interval = Interval::of(&[1.0, 2.0, 6.0]).expect("three scenes");
        // Deviations -2, -1 and 3: variance 7.
        let expected = 4.30265 * (7.0_f64 / 3.0).sqrt();
        assert_eq!((interval.mean, interval.count), (3.0, 3));
        assert!((interval.half_width.expect("a width") - expected).abs() < 1.0e-4, "{interval:?}");
        assert!(!interval.excludes_zero());
    }

    #[test]
    fn degenerate_counts_and_scores() {
        assert_eq!(Interval::of(&[]), None);
        let one = Interval { mean: 4.0, half_width: None, count: 1 };
        assert_eq!(Interval::of(&[4.0]), Some(one));
        assert!(!one.excludes_zero());
        let equal = Interval::of(&[4.0, 4.0]).expect("two scenes");
        assert_eq!(equal.half_width, Some(0.0));
        let infinite = Interval::of(&[4.0, f64::INFINITY]).expect("two scenes");
        assert_eq!((infinite.mean, infinite.half_width), (f64::INFINITY, None));
        assert!(infinite.excludes_zero(), "one of two is exact");
    }

    #[test]
    fn pairs_are_surer_than_means() {
        let scheme = |offset: f64| {
            let scores = [("a", 10.0), ("b", 22.0), ("c", 30.5), ("d", 41.0)];
            BTreeMap::from(scores.map(|(scene, score)| (scene.to_owned(), score * (1.0 + 0.001 * offset) + offset)))
        };
        let (better, worse) = (scheme(1.0), scheme(0.0));
        let difference = Interval::of_differences(&better, &worse).expect("four scenes");
        assert!(difference.count == 4 && difference.excludes_zero() && difference.mean > 1.0, "{difference:?}");
        let alone = Interval::of(&better.values().copied().collect::<Vec<_>>()).expect("four scenes");
        assert!(alone.half_width > difference.half_width.map(|half_width| 100.0 * half_width));
        // Scenes that one of them lacks do not count; the difference of equal infinite scores is 0.
        let mut fewer = better.clone();
        fewer.remove("a");
        assert_eq!(Interval::of_differences(&fewer, &worse).map(|interval| interval.count), Some(3));
        let infinite = BTreeMap::from([("a".to_owned(), f64::INFINITY)]);
        assert_eq!(Interval::of_differences(&infinite, &infinite).map(|interval| interval.mean), Some(0.0));
        assert_eq!(Interval::of_differences(&BTreeMap::new(), &worse), None);
    }
}
