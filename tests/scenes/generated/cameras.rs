//! Cameras of scenes to learn from: where SRN's stand.

use std::f64::consts::FRAC_PI_2;
use viewfuse_core::camera::Camera;
use viewfuse_lab::scenes::cameras::{DISTANCE, random_views, sphere, spiral_views};

fn centre(camera: &Camera) -> [f64; 3] {
    camera.pose.centre_world().to_array().map(f64::from)
}

/// Every camera stands at the distance, looks at the origin and is upright.
#[track_caller]
fn assert_looks_at_origin(cameras: &[Camera]) {
    for (index, camera) in cameras.iter().enumerate() {
        let place = camera.pose.centre_world();
        assert!((place.length() - DISTANCE).abs() < 1.0e-6, "view {index} is {} away", place.length());
        let along = camera.pose.forward_world().dot(-place) / DISTANCE;
        assert!(along > 0.999_999, "view {index} looks past the origin: {along}");
        // World z of the image's axes to the right and downwards.
        let [right, down, ..] = camera.pose.to_opencv()[2];
        assert!(right.abs() < 1.0e-6 && down < 0.0, "view {index} is not upright: {right}, {down}");
    }
}

#[test]
fn the_spiral_is_that_of_the_published_scenes() {
    let views = spiral_views(&sphere(128).expect("a size"), 251).expect("cameras");
    assert_eq!(views.len(), 251);
    assert_looks_at_origin(&views);
    for (index, view) in views.iter().enumerate().take(250) {
        let t = index as f64 / 250.0;
        let (azimuth, elevation) = (20.0 * (1.0 - t), FRAC_PI_2 * t);
        let level = elevation.cos();
        let expected = [level * azimuth.cos(), level * azimuth.sin(), elevation.sin()].map(|x| 1.3 * x);
        for (found, expected) in centre(view).into_iter().zip(expected) {
            assert!((found - expected).abs() < 3.0e-6, "view {index}: {found}, not {expected}");
        }
    }
    // The centres of two views as published; a spiral that turns the other way has others.
    let published = [(64, [-0.809_151, 0.881_142, 0.508_786]), (128, [-0.851_555, -0.296_656, 0.936_402])];
    for (index, expected) in published {
        for (found, expected) in centre(&views[index]).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1.0e-5, "view {index}: {found}, not {expected}");
        }
    }
    assert!(centre(&views[250])[2] > 1.299_99, "the last view is from above");
    assert_eq!(spiral_views(&sphere(64).expect("a size"), 1).expect("one camera").len(), 1);
}

#[test]
fn random_views_cover_the_upper_half_evenly_and_the_lower_one_rarely() {
    let sphere = sphere(64).expect("a size");
    let views = random_views(&sphere, 7, 3, 4000).expect("cameras");
    assert_looks_at_origin(&views);
    let sines: Vec<f64> = views.iter().map(|view| centre(view)[2] / 1.3).collect();
    let below = sines.iter().filter(|&&sine| sine < 0.0).count();
    // 400 expected, standard deviation 19.
    assert!((300..500).contains(&below), "{below} of 4000 views from below");
    for tenth in 0..10 {
        let range = f64::from(tenth) / 10.0..f64::from(tenth + 1) / 10.0;
        let count = sines.iter().filter(|sine| range.contains(sine)).count();
        // 360 expected, standard deviation 18.
        assert!((270..450).contains(&count), "{count} views at a sine of elevation in {range:?}");
    }
    let quarters = views.iter().filter(|view| centre(view)[0] > 0.0 && centre(view)[1] > 0.0).count();
    assert!((860..1140).contains(&quarters), "{quarters} views in a quarter of the azimuths");

    let fewer = random_views(&sphere, 7, 3, 10).expect("cameras");
    assert_eq!(fewer, views[..10], "a view does not depend on how many there are");
    for other in [random_views(&sphere, 8, 3, 10), random_views(&sphere, 7, 4, 10)] {
        let other = other.expect("cameras");
        assert!(other.iter().zip(&fewer).all(|(a, b)| a != b), "another seed or object has other views");
    }
}
