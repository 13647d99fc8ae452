//! The weights of fields that compare views to find depth. Weights decide a picture's colours; close to a photograph
//! nearly all of them is that photograph's, and there would be nothing to compare it with.

use viewfuse_core::pose::Pose;
use viewfuse_core::weights::{Omission, Weights};
use viewfuse_weighting::sources::{MAX_SOURCES, SourcePoses, SourceWeights};

/// Views that are compared at least, where there are so many: one, and three that can confirm its depths.
const MIN_VIEWS: usize = 4;
/// The least weight of a view that is kept to be compared, before all are made to sum to 1: it shows where the others
/// show nothing, and changes little else.
const MIN_WEIGHT: f32 = 0.001;

/// How many views have a weight.
pub(super) fn weighed_count(weights: &SourceWeights) -> usize {
    weights.values().iter().filter(|weight| **weight > 0.0).count()
}

/// An omission of which enough views are left to be compared: those of the greatest weight stay, of equal weights those
/// nearest to the target, both in units in which the cameras look at something about 1 away.
pub(super) fn comparable(
    weights: &SourceWeights,
    omission: Omission<MAX_SOURCES>,
    sources: &SourcePoses,
    target: &Pose,
) -> Omission<MAX_SOURCES> {
    let missing = MIN_VIEWS.saturating_sub(weighed_count(&omission.weights));
    let mut others: Vec<u32> = (0..sources.count()).filter(|view| omission.weights.get(*view) <= 0.0).collect();
    if missing == 0 || others.is_empty() {
        return omission;
    }
    let away = |view: u32| sources.pose(view).distance(target) + sources.pose(view).axis_angle(target);
    others.sort_by(|a, b| weights.get(*b).total_cmp(&weights.get(*a)).then(away(*a).total_cmp(&away(*b))));
    let omitted = others.split_off(missing.min(others.len()));
    let mut scores: [f32; MAX_SOURCES] = *weights.values();
    omitted.iter().for_each(|view| scores[*view as usize] = 0.0);
    others.iter().for_each(|view| scores[*view as usize] = weights.get(*view).max(MIN_WEIGHT));
    Omission {
        weights: Weights::from_scores(&scores, weights.count()),
        omitted_weight: omitted.iter().map(|view| weights.get(*view)).sum(),
        omitted_count: omitted.iter().filter(|view| weights.get(**view) > 0.0).count() as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::Vec3;

    fn pose(x: f32) -> Pose {
        Pose::look_at(Vec3::new(x, 0.0, -1.0), Vec3::new(x, 0.0, 0.0), -Vec3::Y).expect("a pose")
    }

    /// Of sources at these places with these weights, at the origin, where so much may be omitted.
    fn kept(places: &[f32], weights: &[f32], total: f32) -> Omission<MAX_SOURCES> {
        let mut scores = [0.0; MAX_SOURCES];
        scores[..weights.len()].copy_from_slice(weights);
        let weights = Weights::from_scores(&scores, places.len() as u32);
        let sources = SourcePoses::new(&places.iter().copied().map(pose).collect::<Vec<_>>()).expect("sources");
        comparable(&weights, weights.without_least(total), &sources, &pose(0.0))
    }

    #[test]
    fn the_greatest_of_what_was_omitted_stay_and_then_the_nearest() {
        let places = [0.0, 4.0, 1.0, -2.0, 3.0, -5.0];
        let all_at_one = kept(&places, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.01);
        let is_compared = |omission: &Omission<MAX_SOURCES>| [0, 1, 2, 3, 4, 5].map(|v| omission.weights.get(v) > 0.0);
        assert_eq!(is_compared(&all_at_one), [true, false, true, true, true, false]);
        assert_eq!((all_at_one.omitted_weight, all_at_one.omitted_count), (0.0, 0));
        assert!((all_at_one.weights.get(2) - MIN_WEIGHT).abs() < 0.01 * MIN_WEIGHT, "{all_at_one:?}");
        let nearly = kept(&places, &[0.992, 0.004, 0.0001, 0.002, 0.001, 0.0009], 0.01);
        assert_eq!(is_compared(&nearly), [true, true, false, true, true, false]);
        assert!((nearly.omitted_weight - 0.001).abs() < 1.0e-6 && nearly.omitted_count == 2, "{nearly:?}");
        assert!((nearly.weights.get(1) - 0.004).abs() < 1.0e-5, "{nearly:?}");
    }

    #[test]
    fn four_views_with_a_weight_are_enough_and_of_few_all_stay() {
        let weights = [0.5, 0.001, 0.25, 0.125, 0.125];
        let omission = kept(&[0.0, 1.0, 2.0, 3.0, 4.0], &weights, 0.01);
        assert_eq!((omission.weights.get(1), omission.omitted_count), (0.0, 1));
        assert_eq!(weighed_count(&kept(&[0.0, 1.0], &[1.0, 0.0], 0.0).weights), 2);
    }
}
