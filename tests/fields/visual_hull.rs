//! The training-free field as a whole, on the CPU.

mod extremes;
mod geometry;
mod sample;
mod worlds;

use viewfuse::field::AnyField;
use viewfuse::field::training_free::TrainingFree;
use viewfuse::field::training_free::hull::Hull;
use viewfuse_tests::fields::{largest_difference, weighted_picture};
use viewfuse_tests::lorry::target;
use worlds::{assert_shows_an_object, lorry_views};

#[test]
fn pictures_do_not_depend_on_the_bands() {
    let sources = lorry_views(48);
    let with_values = |most_band_values| {
        let hull = Hull { most_band_values, ..Hull::default() };
        let field = AnyField::new(TrainingFree { hull, ..TrainingFree::default() });
        weighted_picture(&field, "error:alpha=1", &sources, &target(48), 1.0 / 256.0).expect("a picture")
    };
    let whole = with_values(16 << 20);
    assert_shows_an_object(&whole);
    // At 24 planes of 48 pixels a row, bands of one kept row, of a few, and of half of the picture.
    for most_band_values in [1, 15 * 48 * 30, 35 * 48 * 30] {
        assert_eq!(whole, with_values(most_band_values), "{most_band_values} values a band");
    }
}

#[test]
fn a_ray_that_ends_early_changes_no_channel_by_more_than_it_may() {
    let sources = lorry_views(48);
    let with = |early_termination| {
        weighted_picture(&AnyField::default(), "error:alpha=1", &sources, &target(48), early_termination)
            .expect("a picture")
    };
    let full = with(0.0);
    assert_shows_an_object(&full);
    for early_termination in [0.3, 0.05, 1.0 / 256.0] {
        let difference = largest_difference(&with(early_termination).colours, &full.colours);
        assert!(difference <= early_termination + 1.0e-6, "{early_termination}: a channel is off by {difference}");
        assert!(difference > 0.01 * early_termination, "{early_termination}: no ray ended early");
    }
}
