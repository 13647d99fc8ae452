//! Views that nobody would take on purpose: results stay finite and in range.

use super::worlds::{assert_shows_an_object, ball, ball_views, rendered};
use viewfuse::field::AnyField;
use viewfuse::field::training_free::NoObject;
use viewfuse_lab::scenes::sources;
use viewfuse_tests::fields::{assert_sound, over_white, rms, weighted_picture};
use viewfuse_tests::lorry::{orbit, target};

#[test]
fn identical_sources() {
    let mut sources = ball_views(32);
    let again = sources.images[..3].to_vec();
    sources.images.extend(again);
    let picture = rendered(&sources, &target(32)).expect("a picture");
    assert_sound(&picture);
    assert_shows_an_object(&picture);

    // One camera twice says nothing about where along its rays the object is.
    sources.images = vec![sources.images[0].clone(); 2];
    let outcome = rendered(&sources, &target(32));
    assert!(outcome.as_ref().is_err_and(|error| error.is::<NoObject>()), "{:?}", outcome.map(|picture| picture.width));
}

#[test]
fn a_target_that_is_a_source_looks_like_it() {
    let sources = ball_views(48);
    let picture = rendered(&sources, &sources.images[3].camera).expect("a picture");
    assert_sound(&picture);
    let psnr = -20.0 * rms(&picture.colours, &over_white(&sources.images[3].texels)).log10();
    assert!(psnr > 28.0, "{psnr} dB");
}

#[test]
fn sources_of_unequal_sizes() {
    let mut cameras = orbit(32).spiral(8, [-0.5, 0.8]).expect("cameras");
    for (index, camera) in cameras.iter_mut().enumerate() {
        camera.pinhole = camera.pinhole.resized(24 + 7 * index as u32, 40 - 2 * index as u32).expect("a size");
    }
    let picture = rendered(&sources(&ball(), &cameras), &target(40)).expect("a picture");
    assert_sound(&picture);
    assert_shows_an_object(&picture);
}

#[test]
fn a_white_object_on_white() {
    let mut sources = ball_views(32);
    for texel in sources.images.iter_mut().flat_map(|image| &mut image.texels) {
        *texel = [texel[3]; 4];
    }
    let picture = rendered(&sources, &target(32)).expect("a picture");
    assert_sound(&picture);
    assert_shows_an_object(&picture);
    let darkest = picture.colours.iter().flat_map(|colour| &colour[..3]).copied().fold(1.0, f32::min);
    assert!(darkest > 1.0 - 1.0e-5, "white became {darkest}");
}

#[test]
fn photographs_without_any_background() {
    let mut sources = sources(&ball(), &orbit(24).spiral(6, [-0.5, 0.8]).expect("cameras"));
    sources.background = [0.0; 3];
    sources.images.iter_mut().for_each(|image| image.texels.fill([0.35, 0.47, 0.12, 1.0]));
    assert_sound(&rendered(&sources, &target(24)).expect("a picture"));
}

#[test]
fn pictures_of_hardly_any_pixels() {
    for side in [1, 2, 3] {
        let cameras = orbit(side).spiral(6, [-0.5, 0.8]).expect("cameras");
        let sources = sources(&ball(), &cameras);
        for target_side in [1, 5] {
            match rendered(&sources, &target(target_side)) {
                Ok(picture) => assert_sound(&picture),
                Err(error) => println!("{side} x {side}: {error}"),
            }
        }
    }
}

#[test]
fn every_weighting_scheme() {
    let sources = ball_views(24);
    for scheme in viewfuse::weighting::scheme_names() {
        let picture =
            weighted_picture(&AnyField::default(), scheme, &sources, &target(24), 1.0 / 256.0).expect("a picture");
        assert_sound(&picture);
        assert_shows_an_object(&picture);
    }
}
