//! The few sources that serve some targets best, by their weights.

use crate::sources::SourceWeights;

/// `count` of the sources (all of them if there are fewer), ascending: chosen one by one, each the one that raises
/// the sum over the targets of `sqrt(weight of the chosen sources)` most; of equal ones the first.
///
/// For one target these are the sources of greatest weight. For several the root prefers a source for a target that has
/// none to a further one for a target that has. The sum is within `1 - 1/e` of the greatest possible, as of every
/// greedy choice for such a function (monotone and submodular). Empty without targets.
pub fn select_sources(weights: &[SourceWeights], count: usize) -> Vec<usize> {
    let source_count = weights.first().map_or(0, |first| first.count() as usize);
    let mut covered = vec![0.0_f64; weights.len()];
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count.min(source_count) {
        let gain = |source: usize| -> f64 {
            let of =
                |(target, so_far): (&SourceWeights, &f64)| (so_far + weight(target, source)).sqrt() - so_far.sqrt();
            weights.iter().zip(&covered).map(of).sum()
        };
        let left = (0..source_count).filter(|source| !chosen.contains(source));
        let better = |best: Option<(usize, f64)>, source: usize| {
            let gain_of_source = gain(source);
            if best.is_none_or(|(_, most)| gain_of_source > most) { Some((source, gain_of_source)) } else { best }
        };
        let Some((next, _)) = left.fold(None, better) else { break };
        weights.iter().zip(&mut covered).for_each(|(target, so_far)| *so_far += weight(target, next));
        chosen.push(next);
    }
    chosen.sort_unstable();
    chosen
}

fn weight(weights: &SourceWeights, source: usize) -> f64 {
    f64::from(weights.get(source as u32))
}

#[cfg(test)]
mod tests {
    use super::select_sources;
    use crate::sources::SourceWeights;

    /// Weights of four sources.
    fn of(scores: [f32; 4]) -> SourceWeights {
        SourceWeights::from_scores(&std::array::from_fn(|source| scores.get(source).copied().unwrap_or_default()), 4)
    }

    #[test]
    fn one_target_takes_the_greatest_weights() {
        let weights = [of([0.1, 0.4, 0.2, 0.3])];
        assert_eq!(select_sources(&weights, 1), [1]);
        assert_eq!(select_sources(&weights, 2), [1, 3]);
        assert_eq!(select_sources(&weights, 9), [0, 1, 2, 3]);
        assert_eq!(select_sources(&[], 2), [0; 0]);
    }

    #[test]
    fn several_targets_all_get_a_source() {
        // By the sums alone, the second source would be 1: it serves the two first targets a second time.
        let near = of([0.55, 0.45, 0.0, 0.0]);
        let far = of([0.0, 0.0, 0.6, 0.4]);
        assert_eq!(select_sources(&[near, near, far], 2), [0, 2]);
    }
}
