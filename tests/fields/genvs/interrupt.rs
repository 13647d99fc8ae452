//! Stopping between two calls of the denoiser.

use super::{exact, made, sources, target, try_picture_with};
use std::sync::atomic::{AtomicUsize, Ordering};
use viewfuse::field::FieldError;
use viewfuse::field::genvs::GenvsOptions;
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse::job::progress::Progress;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::weights::Weights;

/// Wants the work to stop once it was asked so often, and counts on.
struct StopsAfter {
    times: usize,
    asked: AtomicUsize,
}

impl Progress for StopsAfter {
    fn is_cancelled(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.times
    }
}

/// Of so many calls that the picture would take a minute and more, none follows the wish to stop.
#[test]
fn a_person_need_not_wait_for_the_picture() {
    let plan = Plan {
        early_termination: None,
        steps: Steps::Fixed { sampler: Sampler::Ipndm, level_count: 100_000 },
        ..Plan::published(0)
    };
    let field = made(GenvsOptions { plan, ..exact() });
    for times in [0, 1, 40] {
        let progress = StopsAfter { times, asked: AtomicUsize::new(0) };
        match try_picture_with(&field, &sources(1), &Weights::mean(1), &target(32), &progress) {
            Err(FieldError::Interrupted(_)) => {}
            other => panic!("{:?}", other.map(|_| ())),
        }
        // The first answer ends it: nothing asks again between further pieces.
        assert_eq!(progress.asked.into_inner(), times + 1);
    }
}
