//! The expected score of a target's picture, from the scores of held-out sources.
//!
//! ```text
//! expected = P + c0 + c1 log2(G / g) + c2 (e - E) + c3 D + c4 n + s (c5 + c6 D), at most M + 3 dB
//! ```
//!
//! `P`, `G`: the means of score and gap over the held-out sources (of the gap, the geometric one; small gaps are
//! raised, see [`SMALL_GAP`]); `M`: the best of these scores, beyond which a run has seen little; `E`: of the scores
//! that their confidences say by the calibration; `g`, `e`: the target's gap and score by its confidences; `D`: the
//! decibels that the coarse pictures do not show, see [`Basis::detail`]; `n`: the share of its surfaces that no
//! photograph shows ([`Seen::by_none`]); `s`: 1 for objects with silhouettes, whose `D` there is at most
//! [`MAX_DETAIL`], 0 for whole photographs.

use super::calibration::Calibration;
use super::held_out::Outcome;
use crate::budget::Estimate;
use crate::render::Seen;
use crate::standing::Standing;
use serde::{Deserialize, Serialize};

/// `c0` to `c6`, fitted to the targets of 11 scenes (`host/results/training_free.md`, "What auto chooses and expects").
const CONSTANTS: [f64; TERMS] = [0.90, 5.20, 0.80, 0.085, -14.5, 1.68, 1.84];
/// Most decibels that count as lost detail of an object: of pictures as small as the coarse ones, which lack none, more
/// was expected than there is (1.5 dB in the mean of five objects at 48 to 96 pixels).
const MAX_DETAIL: f64 = -0.75;
/// A gap far below this, 4 degrees on a circle, is as good as none: errors are left that no nearer source takes away.
const SMALL_GAP: f64 = 0.1;
/// The most that is expected above the best held-out source, decibels.
const MAX_ABOVE: f64 = 3.0;
/// Half of the interval, decibels: the error that four of five targets of scenes that the fit has not seen stay below
/// (split conformal, a scene left out at a time).
const REACH: f64 = 3.0;
/// How many times as far from its sources as the farthest held-out source a target may be, and the greatest share of
/// it that no photograph shows, for a score to be expected: beyond them nothing was measured.
const MOST_FARTHER: f64 = 1.25;
/// See [`MOST_FARTHER`].
const MOST_UNSEEN: f32 = 0.15;
/// Terms of the sum.
pub const TERMS: usize = 7;

/// An expected score, decibels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// The centre of the interval.
    pub psnr: f64,
    /// Lower and upper end of the interval that holds four of five scores.
    pub interval: [f64; 2],
    /// What is expected of single pixels; null for fields without confidences.
    #[serde(default)]
    pub pixels: Option<PixelErrors>,
}

/// Why no score is expected of a picture: it is beyond what the constants were fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Beyond {
    /// Its camera is this many times as far from the sources as the farthest held-out source is from the others.
    Far(f64),
    /// No photograph shows this share of it.
    Unseen(f32),
}

/// What is expected of a picture's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PixelErrors {
    /// A pixel's expected root mean square error, as a share of a colour's range, is this times that of its confidence
    /// in the calibration ([`Calibration`](super::Calibration)): so the whole picture has the expected score.
    pub scale: f32,
}

impl Expected {
    /// The same of a picture with this error beside the exact one, whose squares add up; the interval's lower end is
    /// that of the error's upper one.
    pub(super) fn with_error(self, error: &Estimate) -> Expected {
        let with = |psnr: f64, error: f64| -10.0 * (10.0_f64.powf(-0.1 * psnr) + error * error).log10();
        let [low, high] = self.interval;
        let interval = [with(low, error.upper), with(high, error.value)];
        Expected { psnr: with(self.psnr, error.value), interval, ..self }
    }
}

/// The statistics of the held-out sources.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basis {
    /// Mean score, decibels.
    pub psnr: f64,
    /// The best score, decibels.
    pub best: f64,
    /// Mean base-2 logarithm of the gaps, of which small ones are raised.
    pub log_gap: f64,
    /// The greatest gap.
    pub greatest_gap: f64,
    /// Mean of their scores by the calibration of their confidences, decibels; `None` without one.
    pub calibrated: Option<f64>,
    /// Mean square, in `[0, 1]`, of the detail that the sources have at the pictures' size and not at that of the
    /// coarse ones.
    pub detail: f64,
    /// Whether the sources are of an object with silhouettes.
    pub has_silhouettes: bool,
}

impl Basis {
    /// From at least one outcome.
    pub(super) fn of(
        outcomes: &[Outcome],
        calibration: Option<&Calibration>,
        detail: f64,
        has_silhouettes: bool,
    ) -> Basis {
        let count = outcomes.len().max(1) as f64;
        let sum = |value: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(value).sum::<f64>() / count;
        Basis {
            psnr: sum(&|outcome| outcome.psnr),
            best: outcomes.iter().map(|outcome| outcome.psnr).fold(f64::NEG_INFINITY, f64::max),
            log_gap: sum(&|outcome| log_gap(outcome.standing)),
            greatest_gap: outcomes.iter().map(|outcome| outcome.standing.gap).fold(0.0, f64::max),
            calibrated: calibration.and_then(|calibration| {
                let scores = outcomes.iter().map(|outcome| {
                    calibration.mean_square(outcome.samples.iter().map(|sample| sample.confidence)).map(decibels)
                });
                scores.collect::<Option<Vec<f64>>>().map(|scores| scores.iter().sum::<f64>() / count)
            }),
            detail,
            has_silhouettes,
        }
    }

    /// The terms that the constants multiply, for a target of this geometry, with this score by its confidences, and
    /// with so much of it seen by few; what is not known counts 0.
    pub fn terms(&self, standing: Standing, calibrated: Option<f64>, seen: Option<Seen>) -> [f64; TERMS] {
        let surer = match (calibrated, self.calibrated) {
            (Some(score), Some(mean)) => score - mean,
            _ => 0.0,
        };
        let gap = self.log_gap - log_gap(standing);
        let (unseen, none) = (self.unseen(), seen.map_or(0.0, |seen| f64::from(seen.by_none)));
        let object = f64::from(u8::from(self.has_silhouettes));
        [1.0, gap, surer, unseen, none, object, object * unseen.min(MAX_DETAIL)]
    }

    /// Whether a target of this geometry, with so much of it seen by few, is beyond what is known; why, if it is.
    pub fn beyond(&self, standing: Standing, seen: Option<Seen>) -> Option<Beyond> {
        let (farther, unseen) = (standing.gap / self.greatest_gap, seen.map_or(0.0, |seen| seen.by_none));
        if farther > MOST_FARTHER {
            return Some(Beyond::Far(farther));
        }
        (unseen > MOST_UNSEEN).then_some(Beyond::Unseen(unseen))
    }

    /// The expected score there.
    pub fn expected(&self, standing: Standing, calibrated: Option<f64>, seen: Option<Seen>) -> Expected {
        let terms = self.terms(standing, calibrated, seen);
        let sum: f64 = terms.iter().zip(CONSTANTS).map(|(term, constant)| term * constant).sum();
        let psnr = (self.psnr + sum).min(self.best + MAX_ABOVE);
        Expected { psnr, interval: [psnr - REACH, psnr + REACH], pixels: None }
    }

    /// By how many decibels the score falls if the detail is lost as well.
    fn unseen(&self) -> f64 {
        let error = 10.0_f64.powf(-0.1 * self.psnr);
        -10.0 * ((error + self.detail) / error).log10()
    }
}

/// The base-2 logarithm of a gap, a small one raised: it hardly falls below that of [`SMALL_GAP`].
fn log_gap(standing: Standing) -> f64 {
    standing.gap.hypot(SMALL_GAP).log2()
}

/// The peak signal to noise ratio of a mean square error, decibels.
pub(super) fn decibels(square: f64) -> f64 {
    -10.0 * square.max(1.0e-9).log10()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_bound_costs_is_not_expected() {
        let expected = Expected { psnr: 25.0, interval: [22.0, 28.0], pixels: None };
        assert!((expected.with_error(&Estimate::EXACT).psnr - 25.0).abs() < 1.0e-9);
        // As much error as the picture has at 25 dB: half of the square is lost.
        let as_much = Estimate { value: 10.0_f64.powf(-1.25), upper: 2.0 * 10.0_f64.powf(-1.25), pixels: 0 };
        let bounded = expected.with_error(&as_much);
        assert!((bounded.psnr - 21.99).abs() < 0.01, "{bounded:?}");
        assert!(bounded.interval[0] < 18.0 && bounded.interval[1] < 24.0, "{bounded:?}");
    }

    /// Of an object whose pictures are as small as the coarse ones no more is expected than where a little is lost.
    #[test]
    fn a_small_picture_of_an_object_is_no_better() {
        let basis = |detail: f64| Basis {
            psnr: 25.0,
            best: 30.0,
            log_gap: -2.0,
            greatest_gap: 0.4,
            calibrated: None,
            detail,
            has_silhouettes: true,
        };
        let expected = |detail: f64| basis(detail).expected(Standing { gap: 0.25, outside: 0.5 }, None, None).psnr;
        // A sixth of the error's square is 0.67 dB.
        let error = 10.0_f64.powf(-2.5);
        assert!((expected(0.0) - expected(error / 6.0)).abs() < 0.1, "{} {}", expected(0.0), expected(error / 6.0));
        assert!(expected(error) < expected(0.0) - 3.0, "{}", expected(error));
    }

    /// Twice as far from the sources costs about 5 dB, unless both are near, and in the middle of the held-out sources
    /// little more than their mean is expected.
    #[test]
    fn a_target_that_is_farther_is_worse() {
        let at = |gap: f64| Standing { gap, outside: 0.5 };
        let basis = Basis {
            psnr: 25.0,
            best: 30.0,
            log_gap: log_gap(at(0.25)),
            greatest_gap: 0.4,
            calibrated: None,
            detail: 0.0,
            has_silhouettes: false,
        };
        let expected = |gap: f64| basis.expected(at(gap), None, None).psnr;
        assert!((25.0..26.2).contains(&expected(0.25)), "{}", expected(0.25));
        assert!((4.0..5.5).contains(&(expected(0.25) - expected(0.5))), "{}", expected(0.5));
        let near = Basis { log_gap: log_gap(at(0.04)), ..basis };
        let gained = near.expected(at(0.02), None, None).psnr - near.expected(at(0.04), None, None).psnr;
        assert!((0.1..0.5).contains(&gained), "{gained}");
    }

    #[test]
    fn nothing_is_expected_beyond_what_was_measured() {
        let basis = Basis {
            psnr: 25.0,
            best: 27.0,
            log_gap: -2.0,
            greatest_gap: 0.4,
            calibrated: None,
            detail: 0.0,
            has_silhouettes: false,
        };
        let beyond =
            |gap: f64, by_none: f32| basis.beyond(Standing { gap, outside: 0.5 }, Some(Seen { by_none, by_one: 0.0 }));
        assert_eq!(beyond(0.4 * MOST_FARTHER, MOST_UNSEEN), None);
        assert_eq!(beyond(0.8, 0.0), Some(Beyond::Far(2.0)));
        assert_eq!(beyond(0.1, 0.25), Some(Beyond::Unseen(0.25)));
        assert_eq!(basis.beyond(Standing { gap: 0.1, outside: 0.5 }, None), None, "a field without depths");
    }
}
