//! Pictures that need no field: copies and warps of the nearest sources.

use image::{Rgb, RgbImage};
use viewfuse::evaluate::baseline::plane::{MIN_POINTS, depth_of_bounds, depth_of_focus, plane_depth};
use viewfuse::evaluate::baseline::{BLENDED, Baseline, Shot};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;

viewfuse_tests::trials![
    a_source_at_the_targets_place_is_the_picture,
    a_painted_plane_is_exact_at_its_depth,
    what_no_source_shows_is_the_nearest_pixel,
    more_sources_than_are_blended_change_nothing,
    sources_of_another_size_are_resampled,
    points_come_before_bounds_and_bounds_before_the_focus,
];

const SIZE: [u32; 2] = [64, 48];
/// How far the painted plane is from the target.
const DEPTH: f64 = 4.0;

fn camera(centre: Vec3, towards: Vec3) -> Camera {
    let pinhole = Pinhole::new([70.0, 66.0], [31.0, 25.0], SIZE[0], SIZE[1]).expect("sound intrinsics");
    Camera { pose: Pose::look_at(centre, towards, Vec3::new(0.0, -1.0, 0.0)).expect("a pose"), pinhole }
}

/// The camera of every test's target: at the origin, looking along z, so that the plane is at z = [`DEPTH`].
fn target() -> Camera {
    camera(Vec3::ZERO, Vec3::Z)
}

/// Sources around the target, the nearest first, turned a little.
fn around() -> Vec<Camera> {
    let places = [(0.2, 0.05), (-0.25, 0.1), (0.1, -0.4), (-0.3, -0.45)];
    places.map(|(x, y)| camera(Vec3::new(x, y, -0.3 * x), Vec3::new(0.4 * x, 0.2, 4.0))).to_vec()
}

/// What is painted on a plane: smooth, so that bilinear look-ups err by less than a level, and nowhere the same.
fn paint(x: f64, y: f64) -> [f64; 3] {
    let wave = |phase: f64, along: f64, across: f64| 128.0 + 90.0 * (phase + along * x + across * y).sin();
    [wave(0.3, 0.9, 0.4), wave(1.7, -0.5, 1.0), wave(2.9, 0.7, -0.8)]
}

/// The plane at z = `depth` as a camera sees it.
fn painted(camera: Camera, depth: f64) -> Shot {
    let picture = RgbImage::from_fn(SIZE[0], SIZE[1], |column, row| {
        let ray = camera.ray(column as f32 + 0.5, row as f32 + 0.5);
        let (origin, direction) = (ray.origin_world.as_dvec3(), ray.direction_world.as_dvec3());
        let point = origin + direction * ((depth - origin.z) / direction.z);
        Rgb(paint(point.x, point.y).map(|level| level.round() as u8))
    });
    Shot { camera, picture }
}

/// Largest difference of any channel over the pixels whose point on the plane all of these sources show; and how many
/// such pixels there are.
fn largest_difference(picture: &RgbImage, truth: &RgbImage, sources: &[Shot]) -> (u8, usize) {
    let (mut largest, mut count) = (0, 0);
    for (x, y, pixel) in picture.enumerate_pixels() {
        let ray = target().ray(x as f32 + 0.5, y as f32 + 0.5);
        let point = ray.at((DEPTH as f32) / ray.direction_world.z);
        if sources.iter().all(|shot| shot.camera.project(point).in_image) {
            count += 1;
            let differences = pixel.0.iter().zip(truth.get_pixel(x, y).0).map(|(a, b)| a.abs_diff(b));
            largest = differences.fold(largest, u8::max);
        }
    }
    (largest, count)
}

fn a_source_at_the_targets_place_is_the_picture() {
    let shot = painted(target(), 3.0);
    for depth in [0.5, DEPTH, f64::INFINITY] {
        for baseline in Baseline::ALL {
            assert_eq!(baseline.picture(&[&shot], &target(), depth), shot.picture, "{baseline} at {depth}");
        }
    }
}

fn a_painted_plane_is_exact_at_its_depth() {
    let sources: Vec<Shot> = around().into_iter().map(|camera| painted(camera, DEPTH)).collect();
    let nearest: Vec<&Shot> = sources.iter().collect();
    let truth = painted(target(), DEPTH).picture;
    let error = |baseline: Baseline, depth: f64| {
        let picture = baseline.picture(&nearest, &target(), depth);
        largest_difference(&picture, &truth, &sources)
    };
    for baseline in [Baseline::WarpedCopy, Baseline::WarpedBlend] {
        let (largest, count) = error(baseline, DEPTH);
        assert!(count > 1500, "only {count} pixels are shown by all");
        // A rounding of the source, one of the result, and the curvature of the paint.
        assert!(largest <= 2, "{baseline}: {largest} levels");
        for wrong in [0.6 * DEPTH, 2.0 * DEPTH, f64::INFINITY] {
            assert!(error(baseline, wrong).0 > 2, "{baseline} at {wrong} is as good as at {DEPTH}");
        }
    }
    assert!(error(Baseline::NearestCopy, DEPTH).0 > 2, "the copy is exact as well");
    // The order in which sources are given decides which is copied, not what the blend is.
    let reversed: Vec<&Shot> = sources.iter().rev().collect();
    let blends = [&nearest, &reversed].map(|order| Baseline::WarpedBlend.picture(order, &target(), DEPTH));
    assert_eq!(blends[0].get_pixel(32, 24), blends[1].get_pixel(32, 24));
}

fn what_no_source_shows_is_the_nearest_pixel() {
    // A source far to the right: the left of the target is outside it.
    let side = camera(Vec3::new(1.5, 0.0, 0.0), Vec3::new(1.5, 0.0, 1.0));
    let shot = Shot { camera: side, picture: painted(side, DEPTH).picture };
    let copy = Baseline::WarpedCopy.picture(&[&shot], &target(), DEPTH);
    for row in 0..SIZE[1] {
        assert_eq!(copy.get_pixel(0, row), shot.picture.get_pixel(0, row), "row {row}");
    }
    // In the blend, another source that shows it takes its place entirely.
    let front = painted(target(), DEPTH);
    let blend = Baseline::WarpedBlend.picture(&[&shot, &front], &target(), DEPTH);
    assert_eq!(blend.get_pixel(0, 24), front.picture.get_pixel(0, 24));
    assert_ne!(blend.get_pixel(0, 24), shot.picture.get_pixel(0, 24));
    // Where nobody shows anything, the first's border; also behind the source's back.
    let back = camera(Vec3::ZERO, Vec3::new(0.0, 0.0, -1.0));
    let behind = Shot { camera: back, picture: RgbImage::from_pixel(SIZE[0], SIZE[1], Rgb([9, 8, 7])) };
    for baseline in [Baseline::WarpedCopy, Baseline::WarpedBlend] {
        let picture = baseline.picture(&[&behind], &target(), DEPTH);
        assert!(picture.pixels().all(|pixel| pixel.0 == [9, 8, 7]), "{baseline}");
    }
    let blend = Baseline::WarpedBlend.picture(&[&behind, &front], &target(), DEPTH);
    assert_eq!(blend, front.picture);
}

fn more_sources_than_are_blended_change_nothing() {
    let mut sources: Vec<Shot> = around().into_iter().map(|camera| painted(camera, DEPTH)).collect();
    let black = RgbImage::new(SIZE[0], SIZE[1]);
    sources.push(Shot { camera: target(), picture: black.clone() });
    let all: Vec<&Shot> = sources.iter().collect();
    for baseline in Baseline::ALL {
        let few = &all[..baseline.source_count()];
        assert_eq!(baseline.picture(&all, &target(), DEPTH), baseline.picture(few, &target(), DEPTH), "{baseline}");
        assert_eq!(baseline.picture(&[], &target(), DEPTH), black, "{baseline} of nothing");
    }
    assert_eq!(all.len(), BLENDED + 1);
}

fn sources_of_another_size_are_resampled() {
    let pinhole = target().pinhole.resized(2 * SIZE[0], 2 * SIZE[1]).expect("a larger camera");
    let large = Shot {
        camera: Camera { pinhole, ..target() },
        picture: RgbImage::from_fn(2 * SIZE[0], 2 * SIZE[1], |x, _| Rgb([x as u8; 3])),
    };
    for baseline in Baseline::ALL {
        let picture = baseline.picture(&[&large], &target(), DEPTH);
        assert_eq!(picture.dimensions(), (SIZE[0], SIZE[1]), "{baseline}");
        let level = picture.get_pixel(20, 10)[0];
        assert!((40..=41).contains(&level), "{baseline}: {level}");
    }
}

fn points_come_before_bounds_and_bounds_before_the_focus() {
    let looked_at = Vec3::new(0.1, 0.2, 4.0);
    let cameras: Vec<Camera> = around().into_iter().map(|view| camera(view.pose.centre_world(), looked_at)).collect();
    let view = target();
    // Half of the points at 2, half at 6: the mean disparity is that of 3. Those outside the picture do not count.
    let seen = |z: f32| Vec3::new(0.0, 0.1, z);
    let points: Vec<Vec3> = [2.0, 6.0].repeat(MIN_POINTS / 2).into_iter().map(seen).collect();
    let outside = [Vec3::new(0.0, 0.0, -5.0), Vec3::new(90.0, 0.0, 1.0)];
    let all = || points.iter().copied().chain(outside);
    let near = |value: f64, expected: f64| assert!((value / expected - 1.0).abs() < 1.0e-5, "{value}, not {expected}");
    near(plane_depth(&view, all(), Some([10.0, 30.0]), &cameras), 3.0);
    near(plane_depth(&view, all().skip(1), Some([10.0, 30.0]), &cameras), 15.0);
    let focus = depth_of_focus(&view, &cameras).expect("they look at one place");
    assert!((focus - 4.0).abs() < 1.0e-3, "{focus}");
    near(plane_depth(&view, [], None, &cameras), focus);
    // Parallel axes, and a focus behind the target: nothing is known.
    let parallel = [-1.0, 1.0].map(|x| camera(Vec3::new(x, 0.0, 0.0), Vec3::new(x, 0.0, 1.0)));
    assert_eq!(plane_depth(&view, [], None, &parallel), f64::INFINITY);
    let away = camera(Vec3::ZERO, Vec3::new(0.0, 0.0, -1.0));
    assert_eq!(depth_of_focus(&away, &cameras), None);

    near(depth_of_bounds([2.0, f32::INFINITY]).expect("a depth"), 4.0);
    for bounds in [[0.0, 1.0], [-1.0, 1.0], [3.0, 2.0], [f32::NAN, 1.0], [1.0, f32::NAN]] {
        assert_eq!(depth_of_bounds(bounds), None, "{bounds:?}");
    }
}
