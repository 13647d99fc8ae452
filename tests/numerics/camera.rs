//! Cameras and poses: conventions of axes, what cannot be seen is masked, what is not a camera is refused.

use glam::Vec3;
use viewfuse::check::poses::Random;
use viewfuse_core::camera::{Camera, Pinhole, PinholeError};
use viewfuse_core::pose::{MAX_COORDINATE, Pose, PoseError};
use viewfuse_core::sources::{Sources, SourcesError};

const UNIT: [[f32; 4]; 4] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

fn camera(pose: Pose) -> Camera {
    let pinhole = Pinhole::new([131.25, 97.5], [70.3, 41.8], 160, 90).expect("a usable camera");
    Camera { pose, pinhole }
}

#[test]
fn the_principal_point_looks_forward() {
    let camera = camera(Pose::IDENTITY);
    assert_eq!(camera.ray(70.3, 41.8).direction_world, Vec3::Z);
    let right = camera.project(Vec3::new(1.0, 0.0, 1.0));
    assert_eq!((right.x, right.y, right.depth, right.in_image), (70.3 + 131.25, 41.8, 1.0, false));
    let down = camera.project(Vec3::new(0.0, 0.25, 1.0));
    assert_eq!((down.x, down.y, down.in_image), (70.3, 41.8 + 0.25 * 97.5, true));
}

#[test]
fn what_can_not_be_seen_is_masked() {
    let camera = camera(Pose::IDENTITY);
    for point in [Vec3::ZERO, Vec3::new(1.0, 2.0, 0.0), Vec3::new(0.1, 0.1, -1.0), Vec3::splat(f32::NAN)] {
        let seen = camera.project(point);
        assert!(!seen.in_front && !seen.in_image && seen.x == 0.0 && seen.y == 0.0, "{seen:?}");
    }
    assert_eq!(camera.project(Vec3::new(0.0, 0.0, -2.0)).depth, -2.0);
    for (x, y) in [(-0.5, 40.0), (160.5, 40.0), (80.0, -0.5), (80.0, 90.5)] {
        let seen = camera.project(camera.ray(x, y).at(2.0));
        assert!(seen.in_front && !seen.in_image, "{x} {y}: {seen:?}");
    }
    let corner = camera.project(camera.ray(0.01, 89.99).at(2.0));
    assert!(corner.in_image);
}

#[test]
fn unusable_pinholes_are_refused() {
    let new = |focal: [f32; 2], principal: [f32; 2], width, height| Pinhole::new(focal, principal, width, height);
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(new([bad, 1.0], [0.0; 2], 4, 4), Err(PinholeError::Focal));
        assert_eq!(new([1.0, bad], [0.0; 2], 4, 4), Err(PinholeError::Focal));
    }
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(new([1.0; 2], [bad, 0.0], 4, 4), Err(PinholeError::Principal));
        assert_eq!(new([1.0; 2], [0.0, bad], 4, 4), Err(PinholeError::Principal));
    }
    for (width, height) in [(0, 4), (4, 0), ((1 << 20) + 1, 4), (4, u32::MAX)] {
        assert_eq!(new([1.0; 2], [0.0; 2], width, height), Err(PinholeError::Size));
    }
    let pinhole = new([100.0, 50.0], [32.0, 20.0], 64, 40).expect("a usable camera");
    assert_eq!(pinhole.resized(128, 20), new([200.0, 25.0], [64.0, 10.0], 128, 20));
    assert_eq!(pinhole.resized(0, 20), Err(PinholeError::Size));
}

#[test]
fn what_is_not_a_pose_is_refused() {
    for row in 0..4 {
        for column in 0..4 {
            for bad in [f32::NAN, f32::INFINITY] {
                let mut m = UNIT;
                m[row][column] = bad;
                let expected = PoseError::NotFinite { row: row as u32, column: column as u32 };
                assert_eq!(Pose::from_opencv(&m), Err(expected));
                assert_eq!(Pose::from_opengl(&m), Err(expected));
            }
        }
    }
    let changed = |row: usize, column: usize, value: f32| {
        let mut m = UNIT;
        m[row][column] = value;
        Pose::from_opencv(&m)
    };
    assert_eq!(changed(0, 3, 1.1 * MAX_COORDINATE), Err(PoseError::TooFar));
    assert!(changed(0, 3, MAX_COORDINATE).is_ok());
    assert_eq!(changed(3, 3, 2.0), Err(PoseError::LastRow));
    assert_eq!(changed(3, 0, 0.1), Err(PoseError::LastRow));
    assert_eq!(changed(2, 2, -1.0), Err(PoseError::Mirrored));
    for (row, column, value) in [(0, 0, 1.01), (0, 1, 0.01), (1, 2, -0.01), (0, 0, 0.0), (0, 0, 1.0e30)] {
        let result = changed(row, column, value);
        assert!(matches!(result, Err(PoseError::NotRigid { deviation }) if deviation > 1.0e-3), "{result:?}");
    }
    assert!(changed(0, 1, 0.0005).is_ok(), "four decimals pass");
}

#[test]
fn opengl_and_opencv_differ_by_the_sign_of_two_axes() {
    let mut random = Random::new(42);
    for _ in 0..100 {
        let pose = random.pose(2.0);
        assert_eq!(Pose::from_opengl(&pose.to_opengl()), Ok(pose));
        assert_eq!(Pose::from_opencv(&pose.to_opencv()), Ok(pose));
        let (cv, gl) = (pose.to_opencv(), pose.to_opengl());
        for row in 0..3 {
            assert_eq!(
                (gl[row][0], -gl[row][1], -gl[row][2], gl[row][3]),
                (cv[row][0], cv[row][1], cv[row][2], cv[row][3])
            );
        }
    }
    let gl = Pose::from_opengl(&UNIT).expect("a pose");
    assert_eq!((gl.forward_world(), gl.down_world(), gl.right_world()), (-Vec3::Z, -Vec3::Y, Vec3::X));
}

#[test]
fn look_at_looks_at() {
    let mut random = Random::new(43);
    for _ in 0..2_000 {
        let point = |random: &mut Random| Vec3::from_array(random.vector().map(|c| c as f32));
        let (centre, target) = (point(&mut random), point(&mut random));
        let pose = Pose::look_at(centre, target, Vec3::Z).expect("not degenerate");
        let seen = pose.to_camera(target);
        let distance = centre.distance(target);
        assert!(
            seen.x.abs() <= 2.0e-6 && seen.y.abs() <= 2.0e-6 && (seen.z - distance).abs() <= 2.0e-6 * (1.0 + distance)
        );
        assert!(pose.down_world().z <= 1.0e-6 && pose.right_world().z.abs() <= 1.0e-6, "up is up");
    }
    for (centre, target, up) in [
        (Vec3::ONE, Vec3::ONE, Vec3::Z),
        (Vec3::ZERO, Vec3::Z, Vec3::Z),
        (Vec3::ZERO, Vec3::Z, -Vec3::Z),
        (Vec3::ZERO, Vec3::X, Vec3::ZERO),
        (Vec3::splat(f32::NAN), Vec3::X, Vec3::Z),
        (Vec3::ZERO, Vec3::splat(f32::INFINITY), Vec3::Z),
    ] {
        assert_eq!(Pose::look_at(centre, target, up), Err(PoseError::NoDirection), "{centre} {target} {up}");
    }
    // Nearly parallel: a camera, or no direction; never one that is skewed.
    for _ in 0..20_000 {
        let [ahead, aside] = [0, 1].map(|_| Vec3::from_array(random.vector().map(|c| c as f32)));
        let up = ahead + aside * random.log_range(1.0e-7, 1.0e-1) as f32;
        match Pose::look_at(Vec3::ZERO, ahead, up) {
            Ok(pose) => {
                let (right, forward) = (pose.right_world(), pose.forward_world());
                assert!(right.dot(forward).abs() <= 3.0e-6, "{ahead} {up}");
                assert!((right.length() - 1.0).abs() <= 2.0e-7, "{ahead} {up}");
                assert!((pose.down_world().length() - 1.0).abs() <= 4.0e-7, "{ahead} {up}");
            }
            Err(error) => {
                assert_eq!(error, PoseError::NoDirection);
                let across = ahead.as_dvec3().normalize().cross(up.as_dvec3().normalize()).length();
                assert!(across < 2.0e-6, "{ahead} {up}: {across}");
            }
        }
    }
    // Parallel up to rounding: what is across is noise.
    for _ in 0..20_000 {
        let [up, centre] = [0, 1].map(|_| Vec3::from_array(random.vector().map(|c| c as f32)));
        for (centre, target) in [(Vec3::ZERO, up), (Vec3::ZERO, 2.0 * up), (centre, centre + 8.0 * up)] {
            let found = Pose::look_at(centre, target, up);
            // What is far from the line of sight by more than rounding is up.
            let across = (target - centre).as_dvec3().normalize().cross(up.as_dvec3().normalize()).length();
            assert!(found.is_err() || across > 0.5e-6, "{centre} {target} {up}: {found:?}");
        }
    }
}

#[test]
fn sources_are_counted() {
    let pose = Pose::IDENTITY;
    assert_eq!(Sources::<2>::new(&[]), Err(SourcesError::Empty));
    assert_eq!(Sources::<2>::new(&[pose; 3]), Err(SourcesError::TooMany { count: 3, capacity: 2 }));
    assert_eq!(Sources::<2>::new(&[pose; 2]).map(|sources| sources.count()), Ok(2));
}
