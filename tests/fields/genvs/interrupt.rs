//! Stopping between two calls of the denoiser.

use super::{exact, made, sources, target, try_picture_with};
use std::time::{Duration, Instant};
use viewfuse::field::FieldError;
use viewfuse::field::genvs::GenvsOptions;
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse::job::progress::Progress;
use viewfuse_core::sampler::Sampler;
use viewfuse_core::weights::Weights;

/// Wants the work to stop from some moment on.
struct StopsAt(Instant);

impl Progress for StopsAt {
    fn is_cancelled(&self) -> bool {
        Instant::now() >= self.0
    }
}

#[test]
fn a_person_need_not_wait_for_the_picture() {
    let start = Instant::now();
    // As many calls as take a minute and more.
    let plan = Plan {
        early_termination: None,
        steps: Steps::Fixed { sampler: Sampler::Euler, level_count: 100_000 },
        ..Plan::published(0)
    };
    let field = made(GenvsOptions { plan, ..exact() });
    let progress = StopsAt(start + Duration::from_millis(300));
    match try_picture_with(&field, &sources(1), &Weights::mean(1), &target(32), &progress) {
        Err(FieldError::Interrupted(_)) => {}
        other => panic!("{:?}", other.map(|_| ())),
    }
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}
