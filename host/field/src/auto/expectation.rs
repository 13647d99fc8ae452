//! The expected score of a target's picture, from the scores of sources that were left out.
//!
//! ```text
//! expected = P + c0 + c1 log2(G / g) + c2 (k - K) + c3 K + c4 D + c5 P + c6 o + c7 s
//! ```
//!
//! `P`, `G`, `K`: the means of score, gap and confidence over the sources that were left out (of the gap, the geometric one);
//! `s`: the standard deviation of their scores; `g`, `k`: the target's own gap and confidence; `o`: how much its sources are
//! on one side of it ([`Standing::outside`]); `D`: the decibels that the coarse pictures do not show, see [`Basis::detail`].
//! In the sum, `K` and `P` count from what is usual. Few left-out sources are a small sample: `c3`, `c5` and `c7` move a mean
//! that is extreme towards the usual one.

use super::geometry::Standing;
use super::leave_out::Outcome;
use serde::{Deserialize, Serialize};

/// `c0` to `c7`: ridge regression over 188 targets of 18 scenes (fern, fox, cup, herz_jesus_p8, dtu_scan65, dino, four
/// torcs_cars; the room and the sample scene of the repository, three generated rooms and three gardens) from 3 to 9 sources,
/// at longest sides of 128 and 288 pixels, each scene with the same weight in all. With constants that were fitted to the
/// other scenes: correlation 0.88, root mean square error 2.07 dB, 57 % of the targets within 1.5 dB, four of five within
/// 2.55 dB. The experiment `self_knowledge` of `viewfuse-research` prints the data and the fit.
const CONSTANTS: [f64; TERMS] = [1.72, 2.91, 9.7, 9.4, 0.39, -0.27, -3.4, 0.53];
/// Root mean square error for scenes that the fit has not seen, decibels.
const DEVIATION: f64 = 2.05;
/// The constants count the mean confidence from here; that of a field that estimates none is taken as this.
const USUAL_CONFIDENCE: f64 = 0.7;
/// The constants count the mean score from here, decibels.
const USUAL_PSNR: f64 = 24.0;
/// Deviations that hold 80 % of a normal distribution.
const DEVIATIONS_OF_80: f64 = 1.2816;
/// Terms of the sum.
pub const TERMS: usize = 8;

/// An expected score, decibels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// The centre of the interval.
    pub psnr: f64,
    /// Lower and upper end of the interval that holds four of five scores.
    pub interval: [f64; 2],
}

/// The statistics of the sources that were left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Basis {
    /// Mean score, decibels.
    pub psnr: f64,
    /// Standard deviation of the scores, decibels.
    pub spread: f64,
    /// Mean base-2 logarithm of the gaps.
    pub log_gap: f64,
    /// Mean confidence; `None` if the field does not estimate it.
    pub confidence: Option<f64>,
    /// Mean square, in `[0, 1]`, of the detail that the sources have at the pictures' size and not at that of the
    /// coarse ones.
    pub detail: f64,
}

impl Basis {
    /// From at least one outcome.
    pub(super) fn of(outcomes: &[Outcome], detail: f64) -> Basis {
        let count = outcomes.len().max(1) as f64;
        let sum = |value: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(value).sum::<f64>() / count;
        let confidences: Option<Vec<f64>> = outcomes.iter().map(|outcome| outcome.confidence).collect();
        let psnr = sum(&|outcome| outcome.psnr);
        Basis {
            psnr,
            spread: sum(&|outcome| (outcome.psnr - psnr).powi(2)).sqrt(),
            log_gap: sum(&|outcome| outcome.standing.gap.log2()),
            confidence: confidences.map(|all| all.iter().sum::<f64>() / count),
            detail,
        }
    }

    /// The terms that the constants multiply, for a target of this geometry and mean confidence.
    pub fn terms(&self, standing: Standing, confidence: Option<f64>) -> [f64; TERMS] {
        let surer = match (confidence, self.confidence) {
            (Some(own), Some(mean)) => own - mean,
            _ => 0.0,
        };
        let gap = self.log_gap - standing.gap.log2();
        let sure = self.confidence.map_or(0.0, |mean| mean - USUAL_CONFIDENCE);
        [1.0, gap, surer, sure, self.unseen(), self.psnr - USUAL_PSNR, standing.outside, self.spread]
    }

    /// The expected score there.
    pub fn expected(&self, standing: Standing, confidence: Option<f64>) -> Expected {
        let terms = self.terms(standing, confidence);
        let sum: f64 = terms.iter().zip(CONSTANTS).map(|(term, constant)| term * constant).sum();
        let (psnr, reach) = (self.psnr + sum, DEVIATIONS_OF_80 * DEVIATION);
        Expected { psnr, interval: [psnr - reach, psnr + reach] }
    }

    /// By how many decibels the score falls if the detail is lost as well.
    fn unseen(&self) -> f64 {
        let error = 10.0_f64.powf(-0.1 * self.psnr);
        -10.0 * ((error + self.detail) / error).log10()
    }
}
