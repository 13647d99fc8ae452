//! The weight of the sources that are more than a field uses.

use viewfuse_weighting::sources::SourceWeights;

/// The sum of all but the `count` greatest weights, from the least one on, and a hundred thousandth more for the order
/// of the sum.
pub(super) fn weight_beyond(weights: &SourceWeights, count: usize) -> f32 {
    let mut all = *weights.values();
    all.sort_unstable_by(f32::total_cmp);
    let beyond = all.len().saturating_sub(count);
    (1.0 + 1.0e-5) * all[..beyond].iter().sum::<f32>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::weights::Weights;
    use viewfuse_weighting::sources::MAX_SOURCES;

    /// Weights of 40 views in a mixed order, all different.
    fn weights() -> SourceWeights {
        let mut scores = [0.0; MAX_SOURCES];
        (0..40).for_each(|view| scores[view] = 1.0 + ((view * 17) % 40) as f32);
        Weights::from_scores(&scores, 40)
    }

    #[test]
    fn what_is_left_out_leaves_the_greatest_weights() {
        let weights = weights();
        for count in [1, 12, 39, 40] {
            let kept = weights.without_least(weight_beyond(&weights, count));
            assert_eq!(kept.omitted_count as usize, 40 - count);
            let is_kept = |view: &usize| kept.weights.get(*view as u32) > 0.0;
            assert!((0..40).filter(is_kept).all(|view| (view * 17) % 40 >= 40 - count));
        }
    }

    #[test]
    fn equal_weights_stay_together() {
        let equal = Weights::from_scores(&[1.0; MAX_SOURCES], 40);
        assert_eq!(equal.without_least(weight_beyond(&equal, 12)).omitted_count, 0);
    }
}
