//! Stopping between two calls of the denoiser.

use super::{exact, made, sources, target, try_picture_with};
use viewfuse::field::FieldError;
use viewfuse::field::genvs::GenvsOptions;
use viewfuse::field::genvs::sampling::{Plan, Steps};
use viewfuse_core::sampler::Sampler;
use viewfuse_core::weights::Weights;
use viewfuse_tests::listener::Listener;

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
        let progress = Listener::stops_after(times);
        match try_picture_with(&field, &sources(1), &Weights::mean(1), &target(32), &progress) {
            Err(FieldError::Interrupted(_)) => {}
            other => panic!("{:?}", other.map(|_| ())),
        }
        // The first answer ends it: nothing asks again between further pieces.
        assert_eq!(progress.asked(), times + 1);
    }
}
