//! The errors and times that efforts are expected to have in this scene: the typical ones, scaled by what was found.

use super::Estimate;
use crate::{AnyOptions, Variant};

/// Errors are expected to be larger than the scaled typical ones by this factor: most first checks then succeed.
const MARGIN: f64 = 1.15;
/// The least scale: few draws often miss the few largest differences, so that low estimates prove little.
const MIN_SCALE: f64 = 0.9;
/// Trials of so little work may skip this many efforts at most: typical errors tell little of scenes that are not
/// typical.
pub(super) const CHEAP: f32 = 0.1;
const MAX_SKIPPED: usize = 3;
/// Pictures are compared whose typical errors differ by at least this factor.
const MIN_RATIO: f32 = 1.5;
/// An effort is tried if it is expected to take this share of the time that is left.
const TIME_SHARE: f64 = 0.75;

/// The efforts of a field, the cheapest first, and what was found of them.
pub(super) struct Expected {
    pub(super) efforts: Vec<Variant<AnyOptions>>,
    /// Factor on all errors.
    margin: f64,
    /// Estimated over typical errors in this scene: of efforts that omit something, and of those that only round.
    scales: [Option<f64>; 2],
    /// Seconds of each effort's last picture, without encoding.
    pub(super) seconds: Vec<Option<f64>>,
}

impl Expected {
    /// Nothing is known yet. `safety` is that of the estimates by which efforts will be judged.
    pub(super) fn new(mut efforts: Vec<Variant<AnyOptions>>, safety: f64) -> Expected {
        if efforts.is_empty() {
            efforts.push(Variant::exact(AnyOptions::new(())));
        }
        let seconds = vec![None; efforts.len()];
        Expected { efforts, margin: MARGIN * safety, scales: [None; 2], seconds }
    }

    /// Whether an effort is the exact one.
    pub(super) fn is_exact(&self, effort: usize) -> bool {
        effort + 1 == self.efforts.len()
    }

    /// The cheapest effort whose error is expected to be below the bound.
    pub(super) fn cheapest_within(&self, most: f64) -> usize {
        let is_within = |effort: &Variant<AnyOptions>| {
            let scale = self.margin * self.scales[usize::from(effort.omits_nothing)].unwrap_or(1.0);
            scale * f64::from(effort.typical_error) <= most
        };
        self.efforts.iter().position(is_within).unwrap_or(self.efforts.len() - 1)
    }

    /// The same of those that are as exact as `f32` is.
    pub(super) fn cheapest_as_f32(&self, most: f64) -> usize {
        let first = self.efforts.iter().position(|effort| effort.rounds_as_f32).unwrap_or(self.efforts.len() - 1);
        self.cheapest_within(most).max(first)
    }

    /// Whether two efforts render from the same encodings: the second one then takes what the first one did not do.
    pub(super) fn encode_alike(&self, first: usize, second: usize) -> bool {
        self.efforts[first].options.encodes_alike(&self.efforts[second].options)
    }

    /// The effort to try after one whose error is too large.
    pub(super) fn after(&self, effort: usize, most: f64) -> usize {
        let next = self.cheapest_within(most).max(effort + 1);
        let mut near = (effort + 1..=effort + MAX_SKIPPED).rev();
        let cheap = near.find(|near| self.efforts.get(*near).is_some_and(|effort| effort.typical_share <= CHEAP));
        cheap.map_or(next, |cheap| next.min(cheap))
    }

    /// The best effort below another one whose error is typically larger by a factor that a comparison can tell.
    pub(super) fn below(&self, effort: usize) -> usize {
        let least = MIN_RATIO * self.efforts[effort].typical_error;
        (0..effort).rev().find(|below| self.efforts[*below].typical_error >= least).unwrap_or(0)
    }

    /// The best effort that is expected to take less than the time that is left; none before a time was measured.
    pub(super) fn best_within(&self, left: f64) -> Option<usize> {
        let index = self.seconds.iter().rposition(Option::is_some)?;
        let rate = self.seconds[index]? / f64::from(self.efforts[index].typical_share);
        let expected = |effort: usize| match self.seconds[effort] {
            Some(seconds) => seconds,
            None => rate * f64::from(self.efforts[effort].typical_share),
        };
        (0..self.efforts.len()).rev().find(|effort| expected(*effort) <= TIME_SHARE * left)
    }

    /// Updates the scale of the errors of an effort's kind by half, in logarithms: single estimates are uncertain.
    pub(super) fn learn(&mut self, effort: usize, estimate: Estimate) {
        let found = estimate.value / f64::from(self.efforts[effort].typical_error);
        if found.is_finite() && found > 0.0 {
            let kept = &mut self.scales[usize::from(self.efforts[effort].omits_nothing)];
            let scale = kept.map_or(found, |scale| (scale * found).sqrt());
            *kept = Some(scale.max(MIN_SCALE));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn efforts() -> Expected {
        let some = [(0.04, 0.02), (0.02, 0.03), (0.01, 0.05), (0.002, 0.3)];
        let some = some.map(|(error, work)| Variant::new("", AnyOptions::new(()), error, work));
        Expected::new(some.into_iter().chain([Variant::exact(AnyOptions::new(()))]).collect(), 1.0)
    }

    fn found(value: f64) -> Estimate {
        Estimate { value, upper: value, pixels: 24 }
    }

    #[test]
    fn cheap_efforts_are_not_skipped() {
        let mut expected = efforts();
        assert_eq!((expected.cheapest_within(0.012), expected.is_exact(2)), (2, false));
        // Ten times the typical error: only the exact picture is expected to be within the bound.
        expected.learn(0, found(0.4));
        assert_eq!((expected.cheapest_within(0.012), expected.is_exact(4)), (4, true));
        assert_eq!([0, 1, 2, 3].map(|effort| expected.after(effort, 0.012)), [2, 2, 4, 4]);
    }

    #[test]
    fn tight_bounds_are_kept_as_f32_does() {
        let expected = efforts();
        assert_eq!((expected.cheapest_within(0.05), expected.cheapest_as_f32(0.05)), (0, 4));
        // What omissions cost here says nothing of rounding.
        let mut rounding = efforts();
        rounding.efforts.insert(4, Variant { rounds_as_f32: true, ..Variant::new("", AnyOptions::new(()), 1e-4, 0.4) });
        assert_eq!([0.05, 1e-3, 1e-5].map(|most| rounding.cheapest_as_f32(most)), [4, 4, 5]);
        rounding.efforts[4].omits_nothing = true;
        rounding.learn(3, found(0.1));
        assert_eq!(rounding.after(3, 1e-3), 4);
        rounding.learn(4, found(2e-3));
        assert_eq!(rounding.cheapest_within(1e-3), 5);
    }

    #[test]
    fn a_scale_moves_by_half_and_never_far_below_one() {
        let mut expected = efforts();
        expected.learn(0, found(0.16));
        expected.learn(0, found(0.04));
        // 4, then its geometric mean with 1.
        assert!(expected.scales[0].is_some_and(|scale| (scale - 2.0).abs() < 1.0e-6));
        (0..20).for_each(|_| expected.learn(0, found(0.0004)));
        assert_eq!(expected.scales, [Some(MIN_SCALE), None]);
        expected.learn(0, found(f64::NAN));
        assert_eq!(expected.scales, [Some(MIN_SCALE), None]);
    }
}
