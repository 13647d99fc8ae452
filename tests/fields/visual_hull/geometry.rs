//! Depths against the closed form, and what moves with the world.

use super::worlds::{RADIUS, assert_shows_an_object, ball_views, lorry_views, rendered};
use viewfuse::field::Rendered;
use viewfuse::field::training_free::NoObject;
use viewfuse::scene::photographs::{SourceImage, SourceImages};
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::math::sin_cos;
use viewfuse_core::pose::Pose;
use viewfuse_lab::scenes::{self, toy::lorry};
use viewfuse_tests::fields::{assert_sound, largest_difference, share_within};
use viewfuse_tests::lorry::target;

/// Depth along the principal axis at which a pixel's ray meets the ball; `None` if it misses it.
fn closed_form(camera: &Camera, column: u32, row: u32) -> Option<f64> {
    let ray = camera.ray(column as f32 + 0.5, row as f32 + 0.5);
    let numbers = |v: Vec3| [v.x, v.y, v.z].map(f64::from);
    let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
    let (origin, direction) = (numbers(ray.origin_world), numbers(ray.direction_world));
    let half = dot(origin, direction);
    let margin = half * half - dot(origin, origin) + f64::from(RADIUS).powi(2);
    let forward = numbers(camera.pose.forward_world());
    (margin > 0.0).then(|| (-half - margin.sqrt()) * dot(direction, forward))
}

#[test]
fn a_ball_has_the_depth_and_the_silhouette_of_a_ball() {
    let (sources, camera) = (ball_views(80), target(80));
    let picture = rendered(&sources, &camera).expect("a picture");
    assert_shows_an_object(&picture);
    let footprint = f64::from(1.3 / camera.pinhole.focal()[0]);
    let (mut squares, mut signed, mut count, mut union) = (0.0, 0.0, 0, 0);
    for (index, (colour, depth)) in picture.colours.iter().zip(&picture.depths).enumerate() {
        let expected = closed_form(&camera, index as u32 % picture.width, index as u32 / picture.width);
        let seen = colour[3] >= 0.5;
        union += usize::from(seen || expected.is_some());
        if let (Some(expected), true) = (expected, seen) {
            let error = (f64::from(*depth) - expected) / footprint;
            squares += error * error;
            signed += error;
            count += 1;
        }
    }
    let (rms, mean) = ((squares / f64::from(count)).sqrt(), signed / f64::from(count));
    let overlap = f64::from(count) / union as f64;
    println!("ball: depth {rms:.2} footprints RMS, {mean:+.2} on average; overlap of silhouettes {overlap:.4}");
    assert!(rms < 2.5, "depth is off by {rms} footprints RMS");
    assert!(overlap > 0.97, "silhouettes overlap by {overlap}");
}

/// The camera in a world that is turned, moved by `shift` and scaled. A turn is `angle` about z and then a quarter
/// about x.
fn moved(camera: &Camera, angle: Option<f32>, shift: Vec3, scale: f32) -> Camera {
    let turn = |v: Vec3| {
        angle.map_or(v, |angle| {
            let (sine, cosine) = sin_cos(angle);
            Vec3::new(cosine * v.x - sine * v.y, -v.z, sine * v.x + cosine * v.y)
        })
    };
    let pose = camera.pose;
    let (r, d, f) = (turn(pose.right_world()), turn(pose.down_world()), turn(pose.forward_world()));
    let c = (turn(pose.centre_world()) + shift) * scale;
    let matrix = [[r.x, d.x, f.x, c.x], [r.y, d.y, f.y, c.y], [r.z, d.z, f.z, c.z], [0.0, 0.0, 0.0, 1.0]];
    Camera { pose: Pose::from_opencv(&matrix).expect("a rigid pose"), ..*camera }
}

fn moved_views(sources: &SourceImages, angle: Option<f32>, shift: Vec3, scale: f32) -> SourceImages {
    let image = |image: &SourceImage| SourceImage {
        camera: moved(&image.camera, angle, shift, scale),
        texels: image.texels.clone(),
    };
    SourceImages { images: sources.images.iter().map(image).collect(), ..sources.clone() }
}

#[test]
fn moving_and_scaling_the_world_changes_next_to_nothing() {
    let (sources, camera) = (lorry_views(48), target(48));
    let still = rendered(&sources, &camera).expect("a picture");
    assert_shows_an_object(&still);
    let shift = Vec3::new(0.3, -0.7, 0.2);
    let cases = [
        ("scaled by 1000", None, Vec3::ZERO, 1000.0, 0.99),
        ("scaled by 0.001", None, Vec3::ZERO, 0.001, 0.99),
        ("shifted", None, shift, 1.0, 0.99),
        // A quarter about x: the axes change places, and with them the object's box.
        ("turned by a quarter", Some(0.0), Vec3::ZERO, 1.0, 0.99),
        ("turned by a quarter, shifted and scaled by 1000", Some(0.0), shift, 1000.0, 0.99),
    ];
    let mut failures = Vec::new();
    for (what, angle, shift, scale, least) in cases {
        let there = moved_views(&sources, angle, shift, scale);
        let picture = rendered(&there, &moved(&camera, angle, shift, scale)).expect("a picture");
        let (same, largest) = (
            share_within(&still.colours, &picture.colours, 1.0 / 255.0),
            largest_difference(&still.colours, &picture.colours),
        );
        println!("{what}: {same:.4} of the pixels within 1/255, largest difference {largest:.4}");
        if !(same >= least) {
            failures.push(format!("{what}: only {same}"));
        }
    }
    assert!(failures.is_empty(), "{failures:?}");

    // A turn that is no multiple of a quarter gives the object another box, hence other planes and steps: another
    // picture of the same quality.
    let truth = scenes::sources(&lorry(), &[camera]);
    let psnr = |picture: &Rendered| {
        let over_white = truth.images[0].texels.iter().map(|t| [0, 1, 2].map(|c| t[c] + 1.0 - t[3]));
        let squares =
            picture.colours.iter().zip(over_white).flat_map(|(a, b)| [0, 1, 2].map(|c| (a[c] - b[c]).powi(2)));
        -10.0 * (squares.sum::<f32>() / (3 * picture.colours.len()) as f32).log10()
    };
    let quality = psnr(&still);
    for angle in [0.2, 0.4, 0.8] {
        let there = moved_views(&sources, Some(angle), shift, 1.0);
        let picture = rendered(&there, &moved(&camera, Some(angle), shift, 1.0)).expect("a picture");
        let (turned, same) = (psnr(&picture), share_within(&still.colours, &picture.colours, 1.0 / 255.0));
        println!("turned by {angle}: {same:.4} of the pixels within 1/255; {turned:.2} dB, {quality:.2} dB still");
        assert!((turned - quality).abs() < 1.0, "turned by {angle}: {turned} dB, {quality} dB still");
    }
    let elsewhere = moved_views(&sources, Some(0.4), shift, 1.0);
    let wrong = rendered(&elsewhere, &camera);
    assert!(
        wrong.map_or(0.0, |wrong| share_within(&still.colours, &wrong.colours, 1.0 / 255.0)) < 0.95,
        "a still target passes"
    );
}

#[test]
fn silhouettes_that_do_not_meet_are_no_object() {
    let sources = ball_views(32);
    let wandering = |(index, image): (usize, &SourceImage)| {
        // The ball, cut to a few pixels, in another corner of each picture.
        let mut texels = vec![[0.0; 4]; image.texels.len()];
        let (x, y) = ([4, 24][index % 2], [4, 24][index / 2 % 2]);
        for row in y..y + 4 {
            texels[row * 32 + x..row * 32 + x + 4].fill([0.5, 0.2, 0.1, 1.0]);
        }
        SourceImage { camera: image.camera, texels }
    };
    let images = sources.images.iter().step_by(2).enumerate().map(wandering).collect();
    let outcome = rendered(&SourceImages { images, ..sources }, &target(32));
    assert!(outcome.as_ref().is_err_and(|error| error.is::<NoObject>()), "{:?}", outcome.map(|picture| picture.width));
}

#[test]
fn a_target_that_sees_nothing_shows_the_background() {
    let sources = SourceImages { background: [0.25, 0.5, 1.0], ..ball_views(32) };
    let camera = target(32);
    let away = camera.pose.centre_world() * 2.0;
    let pose = Pose::look_at(camera.pose.centre_world(), away, Vec3::Z).expect("a pose");
    let picture = rendered(&sources, &Camera { pose, ..camera }).expect("a picture");
    assert!(picture.colours.iter().all(|colour| *colour == [0.25, 0.5, 1.0, 0.0]), "not all background");
    assert!(picture.depths.iter().all(|depth| *depth == 0.0), "background has a depth");
    for centre in [Vec3::ZERO, Vec3::new(0.1, 0.05, 0.0), Vec3::new(200.0, 10.0, 3.0)] {
        let pose = Pose::look_at(centre, Vec3::new(0.3, 0.9, 0.1), Vec3::Z).expect("a pose");
        assert_sound(&rendered(&sources, &Camera { pose, ..camera }).expect("a picture"));
    }
}
