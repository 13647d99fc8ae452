//! The expected score of a target's picture, from the scores of sources that were left out.
//!
//! ```text
//! expected = P + c0 + c1 log2(G / g) + c2 (k - K) + c3 D
//! ```
//!
//! `P`, `G`, `K`: the means of score, gap and confidence over the sources that were left out (of the gap, the geometric one);
//! `g`, `k`: the target's own; `D`: the decibels that the coarse pictures do not show, see [`Basis::detail`].

use super::geometry::Standing;
use super::leave_out::Outcome;
use serde::{Deserialize, Serialize};

/// `c0` to `c3`. Least squares over 111 targets of 16 scenes ( fern, fox, cup, herz_jesus_p8, dtu_scan65, dino, three
/// torcs_cars; the rooms, gardens and the lorry of `viewfuse-synthetic`) from 3 to 12 sources, at longest sides of 128 and 320
/// pixels, each scene with the same weight in all. The example `self_knowledge` of `viewfuse-evaluate` prints the data
/// of the fit. Cross-validated by scene: correlation 0.88, root mean square error 2.2 dB, 58 % of the targets within
/// 1.5 dB, 79 % within the interval. They were fitted with `error:alpha=1` as the first scheme.
const CONSTANTS: [f64; TERMS] = [1.37, 1.96, 15.1, 0.69];
/// Root mean square error for scenes that the fit has not seen, decibels.
const DEVIATION: f64 = 2.2;
/// Deviations that hold 80 % of a normal distribution.
const DEVIATIONS_OF_80: f64 = 1.2816;
/// Terms of the sum.
pub const TERMS: usize = 4;

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
        Basis {
            psnr: sum(&|outcome| outcome.psnr),
            log_gap: sum(&|outcome| outcome.standing.gap.log2()),
            confidence: confidences.map(|all| all.iter().sum::<f64>() / count),
            detail,
        }
    }

    /// The terms that the constants multiply, for a target of this gap and mean confidence.
    pub fn terms(&self, standing: Standing, confidence: Option<f64>) -> [f64; TERMS] {
        let surer = match (confidence, self.confidence) {
            (Some(own), Some(mean)) => own - mean,
            _ => 0.0,
        };
        [1.0, self.log_gap - standing.gap.log2(), surer, self.unseen()]
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
