//! A weighting.

use viewfuse::core::pose::Pose;
use viewfuse::weighting::Weigh;
use viewfuse::weighting::sources::{MAX_SOURCES, SourcePoses, SourceWeights};

/// The nearest source counts, and no other.
#[derive(Clone, Copy, Debug)]
pub struct Nearest;

impl Weigh for Nearest {
    fn name(&self) -> String {
        "nearest".to_owned()
    }

    fn weigh(&self, sources: &SourcePoses, target: &Pose) -> SourceWeights {
        let distance = |view: &u32| sources.pose(*view).distance(target);
        let nearest = (0..sources.count()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let mut scores = [0.0; MAX_SOURCES];
        scores[nearest.unwrap_or(0) as usize] = 1.0;
        SourceWeights::from_scores(&scores, sources.count())
    }
}
