//! Input that nobody would give on purpose: results stay finite and in range.

use super::{assert_sound, body, exact, leaving_out, mist, orbit, picture, picture_with, sources, target};
use std::collections::BTreeMap;
use viewfuse::device::cpu::Cpu;
use viewfuse::field::FieldError;
use viewfuse::field::pixelnerf::{Architecture, Omissions, PixelNerf, PixelNerfOptions, test_networks};
use viewfuse::job::progress::Silent;
use viewfuse::nn::checkpoint::{Checkpoint, TensorShape};
use viewfuse::scene::photographs::SourceImages;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_core::weights::Weights;
use viewfuse_tests::fields;

#[test]
fn one_source_and_the_most_sources() {
    for count in [1, 32] {
        assert_sound(&picture(&mist(PixelNerfOptions::default()), &sources(count), &target(12)));
    }
}

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
fn a_target_that_is_a_source() {
    let sources = sources(3);
    let mut scores = [0.0; viewfuse::weighting::sources::MAX_SOURCES];
    scores[1] = 1.0;
    let camera = Camera { pinhole: orbit(12).pinhole, ..sources.images[1].camera };
    assert_sound(&picture_with(&mist(exact()), &sources, &Weights::from_scores(&scores, 3), &camera, 0.0));
}

#[test]
fn a_target_among_the_sources_looking_away() {
    // Points of its rays lie behind some sources, at the centre of none.
    let eye = Vec3::new(0.9, 0.1, 0.2);
    let pose = Pose::look_at(eye, Vec3::new(5.0, 0.3, 0.4), Vec3::Z).expect("a pose");
    for omissions in [Omissions::NONE, Omissions::default()] {
        let camera = Camera { pose, pinhole: orbit(12).pinhole };
        assert_sound(&picture(&mist(leaving_out(omissions)), &sources(3), &camera));
    }
}

#[test]
fn rays_of_no_length_and_of_any_length() {
    for near_far in [[1.0, 1.0], [0.0, 1.0e-6], [0.0, 1.0e6], [1.0e6, 2.0e6]] {
        for omissions in [Omissions::NONE, Omissions::default()] {
            let mut options = leaving_out(omissions);
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
            let mut options = leaving_out(omissions);
            options.sampling.coarse_count = coarse_count;
            options.sampling.importance_count = importance_count;
            options.sampling.depth_count = depth_count;
            assert_sound(&picture(&body(options), &sources(2), &target(8)));
        }
    }
}

#[test]
fn black_white_and_identical_sources() {
    let mut same = sources(3);
    same.images = vec![same.images[0].clone(); 3];
    assert_sound(&picture(&mist(PixelNerfOptions::default()), &same, &target(12)));
    for colour in [[0.0, 0.0, 0.0, 1.0], [1.0; 4], [0.0; 4]] {
        let mut flat = sources(2);
        flat.images.iter_mut().for_each(|image| image.texels.fill(colour));
        assert_sound(&picture(&mist(PixelNerfOptions::default()), &flat, &target(12)));
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
fn pictures_of_one_pixel_and_of_one_row() {
    for (width, height) in [(1, 1), (33, 1), (1, 9)] {
        let camera = target(32);
        let pinhole = camera.pinhole.resized(width, height).expect("a size");
        assert_sound(&picture(&body(PixelNerfOptions::default()), &sources(2), &Camera { pinhole, ..camera }));
    }
}

/// Times this, every weight is finite still; what becomes of numbers that meet several of them is not.
const LARGE: f32 = 1.9e38;

/// The body's network with all weights of layers of this name multiplied.
fn multiplied(layer: &'static str, options: PixelNerfOptions) -> PixelNerf {
    let made = test_networks::body(&Architecture::small(16));
    let shapes = made.shapes().iter();
    let shapes: Vec<TensorShape> =
        shapes.map(|(name, shape)| TensorShape { name: name.clone(), shape: shape.clone() }).collect();
    assert!(shapes.iter().any(|tensor| tensor.name.ends_with(layer)), "{layer}");
    let checkpoint = Checkpoint::computed("changed", shapes, BTreeMap::new(), move |tensor| {
        let mut values = made.tensor(&tensor.name).expect("values");
        if tensor.name.ends_with(layer) {
            values.iter_mut().for_each(|value| *value *= LARGE);
        }
        values
    });
    PixelNerf::new(&checkpoint, options).expect("a made network")
}

#[test]
fn networks_that_overflow_are_errors_and_no_white_pictures() {
    let sources = sources(2);
    let weights = Weights::mean(2);
    let between_nodes = Omissions { nodes: 16, ..Omissions::default() };
    for layer in ["lin_in.weight", "fc_1.weight"] {
        for omissions in [Omissions::NONE, Omissions::default(), between_nodes] {
            let field = multiplied(layer, leaving_out(omissions));
            let made = fields::picture(&Cpu, &field, &sources, &weights, &target(8), 0.0, &Silent);
            let error = made.err().unwrap_or_else(|| panic!("{layer}: a picture"));
            let said = error.to_string();
            assert!(matches!(error, FieldError::NotFinite(_)), "{layer}: {said}");
            assert!(
                said.contains("evaluating the network at points") && said.contains("not a finite number"),
                "{said}"
            );
        }
    }
}
