//! Input that nobody would give on purpose: results stay finite and in range.

use super::{assert_sound, body, mist, omitting, picture, sources, target};
use viewfuse::device::cpu::Cpu;
use viewfuse::field::FieldError;
use viewfuse::field::pixelnerf::{Architecture, Omissions, PixelNerf, PixelNerfOptions, test_networks};
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::SourceImages;
use viewfuse_core::weights::Weights;
use viewfuse_tests::checkpoints::{LARGE, multiplied};
use viewfuse_tests::fields;

#[test]
fn one_source_looks_as_far_as_several() {
    let picture = picture(&body(PixelNerfOptions::default()), &sources(1), &target(16));
    let middle = picture.colours[16 * 8 + 8][3];
    let corner = picture.colours[0][3];
    assert!(middle > 0.9 && corner == 0.0, "the body is there, and all of it: {middle}, {corner}");
    let depth = picture.depths[16 * 8 + 8];
    assert!((0.8..1.3).contains(&depth), "{depth}");
}

#[test]
fn rays_of_no_length_and_of_any_length() {
    for near_far in [[1.0, 1.0], [0.0, 1.0e-6], [0.0, 1.0e6], [1.0e6, 2.0e6]] {
        for omissions in [Omissions::NONE, Omissions::default()] {
            let mut options = omitting(omissions);
            options.sampling.near_far = Some(near_far);
            assert_sound(&picture(&mist(options), &sources(2), &target(8)));
            assert_sound(&picture(&body(options), &sources(2), &target(8)));
        }
    }
}

#[test]
fn few_samples_and_many() {
    for (coarse_count, importance_count, depth_count) in [(1, 0, 0), (1, 1, 1), (2, 0, 5), (3, 40, 0), (200, 100, 100)]
    {
        for omissions in [Omissions::NONE, Omissions::default()] {
            let mut options = omitting(omissions);
            options.sampling.coarse_count = coarse_count;
            options.sampling.importance_count = importance_count;
            options.sampling.depth_count = depth_count;
            assert_sound(&picture(&body(options), &sources(2), &target(8)));
        }
    }
}

#[test]
fn a_background_of_another_colour_shows_where_nothing_is() {
    let black = SourceImages { background: [0.0, 0.25, 1.0], ..sources(2) };
    let picture = picture(&body(PixelNerfOptions::default()), &black, &target(16));
    assert_sound(&picture);
    assert_eq!(picture.colours[0], [0.0, 0.25, 1.0, 0.0], "a corner");
    assert_eq!(picture.depths[0], 0.0);
    let middle = picture.depths[16 * 8 + 8];
    assert!((0.8..1.3).contains(&middle), "the body is before the middle of the scene: {middle}");
}

#[test]
fn networks_that_overflow_are_errors_and_no_white_pictures() {
    let sources = sources(2);
    let weights = Weights::mean(2);
    let between_nodes = Omissions { nodes: 16, ..Omissions::default() };
    for layer in ["lin_in.weight", "fc_1.weight"] {
        let made = test_networks::body(&Architecture::small(16));
        let checkpoint = multiplied(&made, |name| name.ends_with(layer), LARGE);
        for omissions in [Omissions::NONE, Omissions::default(), between_nodes] {
            let field = PixelNerf::new(&checkpoint, omitting(omissions)).expect("a made network");
            let made = fields::picture(&Cpu, &field, &sources, &weights, &target(8), 0.0, &Silent);
            let error = made.err().unwrap_or_else(|| panic!("{layer}: a picture"));
            let said = error.to_string();
            assert!(matches!(error, FieldError::NotFinite(_)), "{layer}: {said}");
            let words = ["evaluating the network at points", "not a finite number"];
            assert!(words.iter().all(|words| said.contains(words)), "{said}");
        }
    }
}
