//! Whether a candidate is better than another, by its gains on the held-out sources.

use super::held_out::Outcome;
use super::{MAX_LOSS, MIN_GAIN};
use viewfuse_job::medians::median;

/// Whether more than half of the sources gain too little for [`is_better`]'s median, by the first ones' results.
pub(super) fn is_lost(first: &[Outcome], replaced: &[Outcome]) -> bool {
    fewest_to_lose(first, replaced) == 0
}

/// How many further sources it takes at the least until it [is lost](is_lost); 0 if it is.
pub(super) fn fewest_to_lose(first: &[Outcome], replaced: &[Outcome]) -> usize {
    let gains_little = |(replaced, new): &(&Outcome, &Outcome)| new.psnr - replaced.psnr <= 0.5 * MIN_GAIN;
    let lost = replaced.iter().zip(first).filter(gains_little).count();
    (replaced.len() / 2 + 1).saturating_sub(lost)
}

/// Whether a candidate beats the best one so far, and the one it replaces by more than the noise: in the mean, and by
/// half of that in the median, so that one source alone does not decide. One that was given up does not.
pub(super) fn is_better(candidate: &[Outcome], best: &[Outcome], replaced: &[Outcome]) -> bool {
    if is_lost(candidate, replaced) {
        return false;
    }
    mean_score(candidate) > mean_score(best)
        && mean_score(candidate) - mean_score(replaced) > MIN_GAIN
        && median_gain(candidate, replaced) > 0.5 * MIN_GAIN
}

/// The median of the gains at the sources that both have, decibels; 0 without one.
pub(super) fn median_gain(candidate: &[Outcome], replaced: &[Outcome]) -> f64 {
    median(candidate.iter().zip(replaced).map(|(new, replaced)| new.psnr - replaced.psnr)).unwrap_or(0.0)
}

/// What the held-out source that is nearest to the others gains, decibels; the same number of both. Targets are nearer
/// to their sources than held-out sources are, and of objects with silhouettes what gains far from the sources may lose
/// near them (`host/results/training_free.md`, "What auto chooses and expects"; of mixtures
/// `host/results/gaussians.md`).
pub(super) fn gain_where_nearest(candidate: &[Outcome], replaced: &[Outcome]) -> f64 {
    let at = nearest(replaced.iter().map(|outcome| outcome.standing.gap));
    at.map_or(0.0, |at| candidate[at].psnr - replaced[at].psnr)
}

/// The held-out source with the least of these gaps to the others; `None` without any.
pub(super) fn nearest(gaps: impl Iterator<Item = f64>) -> Option<usize> {
    gaps.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(index, _)| index)
}

/// Whether a candidate is better than one by the noise, and at the held-out source that is nearest to the others, too.
pub(super) fn is_better_near(candidate: &[Outcome], replaced: &[Outcome]) -> bool {
    is_better(candidate, replaced, replaced) && gain_where_nearest(candidate, replaced) > MIN_GAIN
}

/// Whether a mixture goes before another one: by the mean, and where that is nearly the same by the source that is
/// nearest to the others.
pub(super) fn is_preferred(mixture: &[Outcome], other: &[Outcome]) -> bool {
    let gain = mean_score(mixture) - mean_score(other);
    if gain.abs() > MIN_GAIN { gain > 0.0 } else { gain_where_nearest(mixture, other) > 0.0 }
}

/// Whether a mixture is worth taking in place of one picture: it does not lose, and of an object not at the source that
/// is nearest to the others, either.
pub(super) fn is_worth_mixing(mixture: &[Outcome], single: &[Outcome], has_silhouettes: bool) -> bool {
    mean_score(mixture) > mean_score(single) - MAX_LOSS
        && !(has_silhouettes && gain_where_nearest(mixture, single) < -MAX_LOSS)
}

/// Mean score, decibels.
pub(super) fn mean_score(outcomes: &[Outcome]) -> f64 {
    outcomes.iter().map(|outcome| outcome.psnr).sum::<f64>() / outcomes.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::super::{LEADER, schemes};
    use super::*;
    use crate::standing::Standing;
    use viewfuse_weighting::Weighting;

    fn outcomes(scores: &[f64]) -> Vec<Outcome> {
        let standing = Standing { gap: 0.1, outside: 0.5 };
        let scored = |&psnr: &f64| Outcome { psnr, confidence: None, samples: Vec::new(), standing, copy: 10.0 };
        scores.iter().map(scored).collect()
    }

    #[test]
    fn the_nearest_source_says_what_is_gained_near_the_sources() {
        let at = |scores: [f64; 2]| -> Vec<Outcome> {
            let at_gap = |(outcome, gap)| Outcome { standing: Standing { gap, outside: 0.5 }, ..outcome };
            outcomes(&scores).into_iter().zip([0.5, 0.4]).map(at_gap).collect()
        };
        assert_eq!(gain_where_nearest(&at([22.0, 25.0]), &at([17.0, 26.0])), -1.0);
        assert_eq!(gain_where_nearest(&at([16.0, 26.5]), &at([17.0, 26.0])), 0.5);
        assert_eq!(gain_where_nearest(&[], &[]), 0.0);
    }

    #[test]
    fn what_loses_at_the_nearest_source_is_not_taken_for_an_object() {
        let at = |scores: [f64; 2]| -> Vec<Outcome> {
            let at_gap = |(outcome, gap)| Outcome { standing: Standing { gap, outside: 0.5 }, ..outcome };
            outcomes(&scores).into_iter().zip([0.5, 0.4]).map(at_gap).collect()
        };
        let single = at([20.0, 25.0]);
        assert!(is_better_near(&at([20.4, 25.2]), &single) && !is_better_near(&at([21.0, 25.06]), &single));
        assert!(is_preferred(&at([20.5, 24.8]), &single), "more in the mean");
        assert!(!is_preferred(&at([20.3, 24.8]), &single), "as much in the mean, less at the nearest");
        assert!(is_preferred(&at([19.7, 25.2]), &single), "as much in the mean, more at the nearest");
        let losing = at([22.0, 24.9]);
        assert!(is_worth_mixing(&losing, &single, false) && !is_worth_mixing(&losing, &single, true));
    }

    #[test]
    fn a_candidate_is_lost_as_soon_as_the_median_is() {
        let replaced = outcomes(&[17.0, 15.0, 14.0, 16.0]);
        assert!(!is_lost(&outcomes(&[16.0, 14.9]), &replaced), "the other two may gain more");
        assert!(is_lost(&outcomes(&[16.0, 14.9, 14.04]), &replaced), "three of four");
        assert!(!is_lost(&outcomes(&[16.0, 15.1, 14.0]), &replaced), "one gains");
        assert!(!is_lost(&replaced, &[]), "the first candidate");
        // Whatever the last one had gained.
        for last in [16.0, 60.0] {
            assert!(!is_better(&outcomes(&[16.0, 14.9, 14.04, last]), &replaced, &replaced));
        }
        assert!(!is_better(&outcomes(&[16.0, 14.9, 14.04]), &replaced, &replaced), "given up");
    }

    #[test]
    fn the_leader_is_the_error_s_square_root_and_its_median_counts() {
        assert_eq!(Weighting::from(schemes()[LEADER]).to_string(), "error:alpha=0.5");
        let first = outcomes(&[20.0, 21.0, 22.0]);
        assert_eq!(median_gain(&outcomes(&[19.0, 20.75, 30.0]), &first), -0.25);
        assert_eq!(median_gain(&outcomes(&[19.0, 20.5]), &first), -0.75, "given up after two");
        assert_eq!(median_gain(&[], &first), 0.0);
    }

    #[test]
    fn one_source_alone_does_not_decide() {
        let first = outcomes(&[16.6, 14.5, 14.1]);
        assert!(!is_better(&outcomes(&[17.3, 14.5, 14.1]), &first, &first), "one of three gains");
        assert!(is_better(&outcomes(&[17.0, 14.6, 14.2]), &first, &first), "all gain");
        assert!(!is_better(&outcomes(&[16.65, 14.55, 14.15]), &first, &first), "within the noise");
        let best = outcomes(&[17.3, 15.0, 14.6]);
        assert!(!is_better(&outcomes(&[17.0, 14.9, 14.6]), &best, &first), "another one is better");
        let (four, more) = (outcomes(&[20.0; 4]), outcomes(&[20.0, 20.0, 20.2, 22.0]));
        assert!(is_better(&more, &four, &four), "the median of four lies between the middle two");
    }
}
