//! Rays and noise that are as they should not be: a sound picture, or an error that says what is wrong.

use super::{assert_sound, exact, made, picture, sources, target, try_picture};
use viewfuse::device::cpu::Cpu;
use viewfuse::field::genvs::Genvs;
use viewfuse::field::genvs::reference::Reference;
use viewfuse::field::learned::NoDepths;
use viewfuse::job::progress::Silent;
use viewfuse_core::weights::Weights;

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
