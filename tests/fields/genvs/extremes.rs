//! Sources, targets and rays that are as they should not be: a sound picture, or an error that says what is wrong.

use super::{assert_sound, exact, made, picture, picture_with, sources, target, try_picture, weights};
use viewfuse::device::cpu::Cpu;
use viewfuse::field::genvs::Genvs;
use viewfuse::field::genvs::reference::Reference;
use viewfuse::field::learned::NoDepths;
use viewfuse::job::progress::Silent;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_core::weights::Weights;

#[test]
fn one_source_and_the_most_sources() {
    for count in [1, 32] {
        assert_sound(&picture(&made(exact()), &sources(count), &target(12)));
    }
}

#[test]
fn black_white_and_identical_sources() {
    let mut same = sources(3);
    same.images = vec![same.images[0].clone(); 3];
    assert_sound(&picture(&made(exact()), &same, &target(12)));
    for colour in [[0.0, 0.0, 0.0, 1.0], [1.0; 4], [0.0; 4]] {
        let mut flat = sources(2);
        flat.images.iter_mut().for_each(|image| image.texels.fill(colour));
        assert_sound(&picture(&made(exact()), &flat, &target(12)));
    }
}

#[test]
fn a_target_that_is_a_source() {
    let sources = sources(3);
    let camera = Camera { pinhole: target(12).pinhole, ..sources.images[1].camera };
    assert_sound(&picture_with(&made(exact()), &sources, &weights([0.0, 1.0], 3), &camera));
}

#[test]
fn a_target_among_the_sources_looking_away() {
    // Points of its rays lie behind some sources, at the centre of none.
    let eye = Vec3::new(0.9, 0.1, 0.2);
    let pose = Pose::look_at(eye, Vec3::new(5.0, 0.3, 0.4), Vec3::Z).expect("a pose");
    assert_sound(&picture(&made(exact()), &sources(3), &Camera { pose, ..target(12) }));
}

fn between(near: f32, far: f32) -> Genvs {
    let mut options = exact();
    options.rays.near_far = Some([near, far]);
    made(options)
}

#[test]
fn rays_of_any_length() {
    for (near, far) in [(0.0, 1.0e-6), (0.8, 1.0e6), (0.0, 1.0e6), (1.0e6, 2.0e6), (1.0e-20, 1.0e30)] {
        assert_sound(&picture(&between(near, far), &sources(2), &target(8)));
    }
}

/// A volume reaches from near to far: with nothing between there is nothing to look up, and no picture would mean
/// anything.
#[test]
fn rays_of_no_length_are_an_error() {
    let infinite = f32::INFINITY;
    for (near, far) in [(1.0, 1.0), (1.8, 0.8), (f32::NAN, 1.0), (1.0, f32::NAN), (1.0, infinite), (-3.0e38, 3.0e38)] {
        match try_picture(&between(near, far), &sources(2), &Weights::mean(2), &target(8)) {
            Err(error) if error.is::<NoDepths>() => {
                let expected = format!(
                    "the near bound of rays, {near}, must be below the far bound, {far}, and both must be finite"
                );
                assert_eq!(error.to_string(), expected);
            }
            other => panic!("{near} to {far}: {other:?}"),
        }
    }
}

#[test]
fn few_samples_and_many() {
    for sample_count in [0, 1, 2, 3, 500] {
        let mut options = exact();
        options.rays.sample_count = sample_count;
        assert_sound(&picture(&made(options), &sources(2), &target(8)));
    }
}

#[test]
fn noise_levels_of_nothing_and_of_any_strength() {
    let field = made(exact());
    let reference = Reference::new(&field, &Cpu, &sources(1), &Silent).expect("sources on the device");
    let noisy: Vec<f32> = (0..16 * 16 * 3).map(|index| (index % 7) as f32 / 3.0 - 1.0).collect();
    let features = vec![0.25; 16 * 16 * 16];
    let denoised = |level: f32| {
        let scaled: Vec<f32> = noisy.iter().map(|value| value * level.max(1.0)).collect();
        reference.denoised(&scaled, &features, [16, 16], level).expect("a picture")
    };
    assert_eq!(denoised(0.0), noisy, "without noise there is nothing to take away");
    for level in [1.0e-30, 1.0e-6, 80.0, 1.0e6, 1.0e18] {
        let values = denoised(level);
        assert!(values.iter().all(|value| value.abs() < 100.0), "level {level}");
    }
}

#[test]
fn pictures_of_one_pixel_and_of_one_row() {
    for (width, height) in [(1, 1), (33, 1), (1, 9), (100, 75)] {
        let camera = target(32);
        let pinhole = camera.pinhole.resized(width, height).expect("a size");
        let picture = picture(&made(exact()), &sources(2), &Camera { pinhole, ..camera });
        assert_sound(&picture);
        assert_eq!((picture.width, picture.height), (width, height));
    }
}
