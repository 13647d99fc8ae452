//! The training-free field as a whole, on the CPU.

mod extremes;
mod geometry;
mod sample;
mod worlds;

use viewfuse::field::training_free::TrainingFree;
use viewfuse::field::training_free::hull::Hull;
use viewfuse::scene::photographs::SourceImages;
use worlds::{Run, assert_shows_an_object, assert_sound, largest_difference, lorry_views, share_within, target};

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let sources = lorry_views(48);
    let with_threads = |count| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a thread pool");
        pool.install(|| Run::default().picture(&sources, &target(48)).expect("a picture"))
    };
    let one = with_threads(1);
    assert_shows_an_object(&one);
    assert_eq!(one, with_threads(2), "bit for bit");
    assert_eq!(one, with_threads(3), "bit for bit");
}

#[test]
fn pictures_do_not_depend_on_the_bands() {
    let sources = lorry_views(48);
    let with_values = |most_band_values| {
        let run = Run {
            field: TrainingFree { hull: Hull { most_band_values, ..Hull::default() }, ..TrainingFree::default() },
            ..Run::default()
        };
        run.picture(&sources, &target(48)).expect("a picture")
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
        Run { early_termination, ..Run::default() }.picture(&sources, &target(48)).expect("a picture")
    };
    let full = with(0.0);
    assert_shows_an_object(&full);
    for early_termination in [0.3, 0.05, 1.0 / 256.0] {
        let difference = largest_difference(&with(early_termination), &full);
        println!("early termination {early_termination}: largest difference {difference}");
        assert!(
            difference <= early_termination + 1.0e-6,
            "early termination {early_termination}: a channel is off by {difference}"
        );
        assert!(difference > 0.01 * early_termination, "early termination {early_termination}: no ray ended early");
    }
}

#[test]
fn the_order_of_the_sources_is_only_rounding() {
    let sources = lorry_views(48);
    let reversed = SourceImages { images: sources.images.iter().rev().cloned().collect(), ..sources.clone() };
    let one = Run::default().picture(&sources, &target(48)).expect("a picture");
    let other = Run::default().picture(&reversed, &target(48)).expect("a picture");
    let (largest, same) = (largest_difference(&one, &other), share_within(&one, &other, 1.0e-4));
    println!("sources in reverse: largest difference {largest}, {same} of the pixels within 1e-4");
    assert_sound(&one);
    // A sweep's two best planes may swap where their costs differ by rounding only.
    assert!(same >= 0.999, "only {same} of the pixels are the same");
    let shifted = SourceImages {
        images: sources
            .images
            .iter()
            .zip(sources.images.iter().cycle().skip(1))
            .map(|(image, next)| viewfuse::scene::photographs::SourceImage { camera: next.camera, ..image.clone() })
            .collect(),
        ..sources
    };
    let wrong = Run::default().picture(&shifted, &target(48));
    assert!(wrong.is_err() || share_within(&one, &wrong.expect("a picture"), 1.0e-4) < 0.99, "mixed-up cameras pass");
}
