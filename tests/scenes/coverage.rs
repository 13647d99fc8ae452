//! Where photographs are, and what they show: the arc of an orbit, and the share of a picture that was seen.

use std::f32::consts::TAU;
use viewfuse::scene::coverage::Coverage;
use viewfuse::scene::path::arc::Arc;
use viewfuse::scene::path::generated::orbit;
use viewfuse::scene::rig::Rig;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;

/// A camera 4 from the origin, which it looks at, at these degrees around and above.
fn camera(around: f32, above: f32) -> Camera {
    let (around, above) = (around.to_radians(), above.to_radians());
    let centre = 4.0 * Vec3::new(above.cos() * around.cos(), above.cos() * around.sin(), above.sin());
    let pinhole = Pinhole::new([200.0; 2], [80.0, 60.0], 160, 120).expect("a pinhole");
    Camera { pose: Pose::look_at(centre, Vec3::ZERO, Vec3::Z).expect("a pose"), pinhole }
}

fn cameras(around: &[f32]) -> Vec<Camera> {
    around.iter().map(|around| camera(*around, 20.0)).collect()
}

/// Degrees around the origin.
fn around(camera: &Camera) -> f32 {
    let centre = camera.pose.centre_world();
    centre.y.atan2(centre.x).to_degrees()
}

#[track_caller]
fn assert_around(cameras: &[Camera], count: usize, expected: &[f32]) {
    let orbit = orbit(cameras, &Arc::covered(cameras), cameras[0].pinhole, count).expect("an orbit");
    let found: Vec<f32> = orbit.iter().map(around).collect();
    // The mean of the cameras' up directions leans to where they are: not the angles, but their order and their gaps
    // are as given.
    let is_near = |(a, b): (&f32, &f32)| ((a - b + 540.0).rem_euclid(360.0) - 180.0).abs() < 6.0;
    assert!(found.len() == expected.len() && found.iter().zip(expected).all(is_near), "{found:?} {expected:?}");
    for camera in orbit {
        let centre = camera.pose.centre_world();
        let towards = camera.pose.forward_world().dot(-centre.normalize());
        assert!((centre.length() - 4.0).abs() < 1.0e-2 && towards > 0.9999, "{centre} {towards}");
    }
}

#[test]
fn an_orbit_is_the_arc_from_photograph_to_photograph() {
    // In any order, and over the place where angles begin anew.
    assert_around(&cameras(&[0.0, 40.0, -50.0, 20.0]), 4, &[-50.0, -20.0, 10.0, 40.0]);
    assert_around(&cameras(&[170.0, -150.0]), 3, &[170.0, -170.0, -150.0]);
    // The larger group of two; one frame is in its middle.
    assert_around(&cameras(&[0.0, 180.0, 200.0, 230.0]), 1, &[205.0]);
    // One place has room to move.
    let alone = Arc::covered(&cameras(&[30.0]));
    assert!((alone.width.to_degrees() - 20.0).abs() < 0.01 && (alone.start + 0.5 * alone.width).abs() < 1.0e-4);
    assert_around(&cameras(&[30.0, 36.0, 32.0]), 2, &[23.0, 43.0]);
    // Less than 60 degrees apart they are a circle, which begins at the first and does not come there twice.
    let circle = [90.0, 45.0, 135.0, 180.0, 225.0, 270.0, 315.0, 0.0];
    assert_around(&cameras(&circle), 3, &[90.0, 210.0, 330.0]);
    assert!(Arc::covered(&cameras(&circle)).is_full() && !Arc::covered(&cameras(&circle[..5])).is_full());
    let full = Arc::full(&cameras(&circle[..2]));
    assert!(full.is_full() && full.width == TAU);
}

/// Cameras that look at a point, which all have in sight, and cameras that do not.
#[test]
fn a_point_that_cameras_look_at_is_no_chance() {
    let circle = cameras(&[0.0, 90.0, 180.0, 270.0]);
    let focus = Rig::meeting_point(&circle).expect("the middle");
    assert!(focus.distance(Rig::of(&circle).focus) < 1.0e-5);
    assert!(Rig::meeting_point(&circle[..1]).is_none(), "one");
    let turned = |to: fn(Vec3) -> Vec3| -> Vec<Camera> {
        let look = |camera: &Camera| {
            let centre = camera.pose.centre_world();
            Camera { pose: Pose::look_at(centre, to(centre), Vec3::Z).expect("a pose"), ..*camera }
        };
        circle.iter().map(look).collect()
    };
    assert!(Rig::meeting_point(&turned(|centre| 2.0 * centre)).is_none(), "outwards");
    assert!(Rig::meeting_point(&turned(|centre| centre - Vec3::Y)).is_none(), "all alike");
    // Axes that pass one another by as much as lies between the cameras.
    let beside = turned(|centre| 2.0 * centre.cross(Vec3::Z).normalize() + 0.2 * centre);
    assert!(Rig::meeting_point(&beside).is_none(), "beside one another");
}

/// Cameras that were turned on their sides, or over, do not tilt what the others call up.
#[test]
fn a_few_rolled_cameras_tilt_nothing() {
    let upright = cameras(&[0.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0]);
    let up = Rig::of(&upright).up;
    let mut rolled = upright.clone();
    for (camera, turns) in [(1, 1), (3, 1), (5, 2)] {
        let matrix = upright[camera].pose.to_opencv();
        let turned = matrix.map(|[right, down, forward, centre]| match turns {
            1 => [down, -right, forward, centre],
            _ => [-right, -down, forward, centre],
        });
        rolled[camera].pose = Pose::from_opencv(&turned).expect("a pose");
    }
    let tilt = Rig::of(&rolled).up.dot(up).clamp(-1.0, 1.0).acos().to_degrees();
    assert!(tilt < 6.0, "{tilt} degrees");
    // What all agree on is their mean, to the bit.
    let mean = upright.iter().map(|camera| -camera.pose.down_world()).sum::<Vec3>() / 7.0;
    assert_eq!(up, mean.normalize());
}

#[test]
fn what_photographs_show() {
    let coverage = Coverage::of(&cameras(&[-20.0, 0.0, 20.0]));
    assert!(coverage.seen(&camera(10.0, 20.0)) > 0.95);
    assert!(coverage.seen(&camera(40.0, 20.0)) > 0.8, "in reach of the last one");
    for (around, above) in [(180.0, 20.0), (90.0, 20.0), (0.0, 80.0)] {
        assert_eq!(coverage.seen(&camera(around, above)), 0.0, "{around} {above}");
    }
    // It looks away from all of them, to the side that no photograph shows.
    let away = Pose::look_at(Vec3::new(4.0, 0.0, 1.0), Vec3::new(8.0, 0.0, 2.0), Vec3::Z).expect("a pose");
    assert_eq!(coverage.seen(&Camera { pose: away, ..camera(0.0, 20.0) }), 0.0);
    // From farther away the photographs do not fill the picture.
    let near = camera(0.0, 20.0);
    let far = Pose::look_at(3.0 * near.pose.centre_world(), Vec3::ZERO, Vec3::Z).expect("a pose");
    let share = coverage.seen(&Camera { pose: far, ..near });
    assert!(0.05 < share && share < 0.5, "{share}");
}

#[test]
fn a_depth_map_says_where_the_surfaces_are() {
    let coverage = Coverage::of(&cameras(&[-20.0, 0.0, 20.0]));
    let camera = camera(10.0, 20.0);
    let size = [40, 30];
    let map = |depth: f32| vec![depth; 40 * 30];
    assert!(coverage.seen_surfaces(&camera, size, &map(4.0), false).expect("surfaces") > 0.95);
    // Just in front of this camera nothing is in another one's picture.
    assert_eq!(coverage.seen_surfaces(&camera, size, &map(0.2), false), Some(0.0));
    // The left half has no surface: only the right one counts.
    let half: Vec<f32> = (0..40 * 30).map(|pixel| if pixel % 40 < 20 { 0.0 } else { 4.0 }).collect();
    assert!(coverage.seen_surfaces(&camera, size, &half, false).expect("surfaces") > 0.95);
    assert_eq!(coverage.seen_surfaces(&camera, size, &map(0.0), false), None);
    // What has no surface counts as without a depth map, where that is no known background.
    assert_eq!(coverage.seen_surfaces(&camera, size, &map(0.0), true), Some(coverage.seen(&camera)));
    let away = Pose::look_at(4.0 * camera.pose.centre_world(), Vec3::ZERO, Vec3::Z).expect("a pose");
    let away = Camera { pose: away, ..camera };
    let middle = |pixel: usize| (15..25).contains(&(pixel % 40)) && (10..20).contains(&(pixel / 40));
    let object: Vec<f32> = (0..40 * 30).map(|pixel| if middle(pixel) { 16.0 } else { 0.0 }).collect();
    assert_eq!(coverage.seen_surfaces(&away, size, &object, false), Some(1.0));
    assert!(coverage.seen_surfaces(&away, size, &object, true).expect("gaps") < 0.3);
    assert_eq!(coverage.seen_surfaces(&camera, size, &map(4.0)[1..], false), None);
    assert_eq!(coverage.seen_in(&camera, size, &[], false), coverage.seen(&camera));
}

#[test]
fn a_warning_names_the_pictures() {
    let coverage = Coverage::of(&cameras(&[-20.0, 0.0, 20.0]));
    let warning = |around: &[f32]| {
        let pictures: Vec<(String, Camera)> =
            cameras(around).into_iter().enumerate().map(|(index, camera)| (format!("p{index}"), camera)).collect();
        coverage.warning(pictures.iter().map(|(name, camera)| (name.as_str(), camera)))
    };
    assert_eq!(warning(&[0.0, 10.0]), None);
    assert_eq!(warning(&[]), None);
    let one = warning(&[0.0, 180.0]).expect("a warning");
    let text =
        "1 of 2 pictures leave what was photographed: p1; of p1, 0 % is in a photograph taken from within 30 degrees";
    assert_eq!(one, text);
    let runs = warning(&[90.0, 120.0, 0.0, 180.0, 0.0, 100.0, 0.0, 100.0]).expect("a warning");
    assert!(
        runs.starts_with("5 of 8 pictures leave what was photographed: p0 to p1, p3, p5 and others; of p0, 0 %"),
        "{runs}"
    );
}
