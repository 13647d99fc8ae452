//! Tests of the generated scenes: geometry against closed forms in `f64`, pictures against the checked-in sample,
//! folders against what was asked for.

mod cameras;
mod collections;
mod folders;
mod kinds;
mod prisms;
mod rooms;

use image::RgbaImage;
use std::fs;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::random::uniform;
use viewfuse_lab::scenes::toy::{lorry, test_cameras, training_cameras};
use viewfuse_lab::scenes::{Finish, Object, Orbit, Part, Placement, Shape, Texture, render, trace};

const RED: Vec3 = Vec3::new(1.0, 0.0, 0.0);
const CENTRE: [f32; 3] = [0.05, -0.1, 0.08];
const RADIUS: f32 = 0.3;

fn part(shape: Shape) -> Part {
    let finish = Finish { texture: Texture::Plain { colour: RED }, gloss: 0.0 };
    Part { shape, placement: Placement::at(CENTRE[0], CENTRE[1], CENTRE[2]), finish }
}

fn sphere() -> Object {
    Object::new(vec![part(Shape::Sphere { radius: RADIUS })])
}

fn orbit(side: u32) -> Orbit {
    let pinhole = Pinhole::new([side as f32; 2], [side as f32 / 2.0; 2], side, side).expect("sound intrinsics");
    Orbit { radius: 1.3, pinhole }
}

fn camera(side: u32) -> Camera {
    orbit(side).camera(0.7, 0.4).expect("a camera off the pole")
}

/// What `f64` says about the sphere and the ray through an image coordinate.
struct Reference {
    /// `r^2 - d^2` with `d` the distance of the ray from the centre: positive where the ray hits.
    margin: f64,
    /// Distance along the ray to the sphere; NaN where it misses.
    depth: f64,
}

fn reference(camera: &Camera, x: f64, y: f64) -> Reference {
    let matrix = camera.pose.to_opencv().map(|row| row.map(f64::from));
    let [focal, principal] = [camera.pinhole.focal().map(f64::from), camera.pinhole.principal().map(f64::from)];
    let in_camera = [(x - principal[0]) / focal[0], (y - principal[1]) / focal[1], 1.0];
    let direction: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| matrix[i][j] * in_camera[j]).sum());
    let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
    let to_centre: [f64; 3] = std::array::from_fn(|i| f64::from(CENTRE[i]) - matrix[i][3]);
    let along = (0..3).map(|i| to_centre[i] * direction[i] / length).sum::<f64>();
    let distance_squared = to_centre.iter().map(|d| d * d).sum::<f64>() - along * along;
    let margin = f64::from(RADIUS).powi(2) - distance_squared;
    Reference { margin, depth: along - margin.sqrt() }
}

/// Rays with a smaller margin pass the rim so closely that `f32` and the arrival distance decide.
const UNDECIDED: f64 = 2.0e-5;

#[test]
fn sphere_silhouette_and_depth_match_the_closed_form() {
    let (object, camera) = (sphere(), camera(96));
    let (mut hits, mut misses) = (0, 0);
    for row in 0..96 {
        for column in 0..96 {
            let (x, y) = (f64::from(column) + 0.5, f64::from(row) + 0.5);
            let expected = reference(&camera, x, y);
            if expected.margin.abs() < UNDECIDED {
                continue;
            }
            let hit = trace(&object, &camera.ray(x as f32, y as f32));
            assert_eq!(hit.is_some(), expected.margin > 0.0, "pixel ({column}, {row}), margin {}", expected.margin);
            let Some(hit) = hit else {
                misses += 1;
                continue;
            };
            hits += 1;
            // The ray stops 1e-5 above the surface; at a slant, with cosine sqrt(margin) / r, that is longer along it.
            let slant = f64::from(RADIUS) / expected.margin.sqrt();
            let error = (f64::from(hit.distance) - expected.depth).abs();
            assert!(error <= 1.2e-5 * slant + 1.0e-6, "pixel ({column}, {row}): depth is off by {error}");
            let outward = hit.point_local.normalize().dot(hit.normal_local);
            assert!(outward > 0.99999, "pixel ({column}, {row}): cosine of the normal's error {outward}");
        }
    }
    assert!(hits > 1000 && misses > 1000, "{hits} hits and {misses} misses: the camera does not look at the sphere");
}

#[test]
fn alpha_is_the_fraction_of_rays_that_hit_and_fractional_only_at_the_rim() {
    let (object, camera) = (sphere(), camera(64));
    let picture = render(&object, &camera);
    let mut fractional = 0;
    for (column, row, pixel) in picture.enumerate_pixels() {
        let rays = (0..16).map(|k| {
            let (i, j) = (f64::from(k % 4), f64::from(k / 4));
            reference(&camera, f64::from(column) + (i + 0.5) / 4.0, f64::from(row) + (j + 0.5) / 4.0)
        });
        let margins: Vec<f64> = rays.map(|ray| ray.margin).collect();
        let sure = margins.iter().filter(|&&margin| margin > UNDECIDED).count();
        let possible = margins.iter().filter(|&&margin| margin > -UNDECIDED).count();
        let alpha = pixel[3];
        let allowed = (sure..=possible).any(|count| alpha == ((count * 255) as f64 / 16.0).round() as u8);
        assert!(allowed, "pixel ({column}, {row}): alpha {alpha}, {sure} to {possible} of 16 rays hit");
        fractional += usize::from(alpha != 0 && alpha != 255);
    }
    // The rim is a circle of about 15 pixels' radius: about 8 r pixels are cut by it, the disc has 700.
    assert!((60..200).contains(&fractional), "{fractional} pixels with fractional alpha");
}

#[test]
fn colour_is_straight_without_a_fringe() {
    let picture = render(&sphere(), &camera(64));
    for pixel in picture.pixels() {
        if pixel[3] == 0 {
            assert_eq!(pixel.0, [255, 255, 255, 0], "an empty pixel is white and transparent");
        } else {
            // White or black mixed in would show as green and blue above 0, or as a dark red.
            assert_eq!([pixel[1], pixel[2]], [0, 0], "a pure red object has fringes");
            assert!(pixel[0] > 100, "a face is nearly black: {pixel:?}");
        }
    }
}

/// Largest `|f(p) - f(q)| / |p - q|` over pairs of random points, near and far.
fn largest_slope(seed: u64, distance: impl Fn(Vec3) -> f32) -> f32 {
    let number = |index: u32, axis: u32| 1.4 * uniform(seed, index, axis) - 0.7;
    let point =
        |index: u32, first: u32| Vec3::new(number(index, first), number(index, first + 1), number(index, first + 2));
    let mut largest = 0.0_f32;
    for index in 0..4000 {
        let p = point(index, 0);
        let reach = if index % 2 == 0 { 1.0 } else { 0.02 };
        let q = p + point(index, 3) * reach;
        largest = largest.max((distance(p) - distance(q)).abs() / (p - q).length());
    }
    largest
}

fn shapes() -> [Shape; 6] {
    [
        Shape::Sphere { radius: 0.3 },
        Shape::Ellipsoid { radii: Vec3::new(0.1, 0.2, 0.4) },
        Shape::Block { half_size: Vec3::new(0.1, 0.2, 0.3), rounding: 0.05 },
        Shape::Cylinder { radius: 0.2, half_height: 0.1, rounding: 0.03 },
        Shape::Torus { ring_radius: 0.3, tube_radius: 0.1 },
        Shape::Capsule { half_length: 0.2, radius: 0.1 },
    ]
}

#[test]
fn distances_never_grow_faster_than_the_way_so_that_tracing_never_oversteps() {
    for (index, shape) in shapes().into_iter().enumerate() {
        let slope = largest_slope(index as u64, |p| shape.distance(p));
        assert!(slope <= 1.001, "{shape:?}: slope {slope}");
        let doubled = largest_slope(index as u64, |p| 2.0 * shape.distance(p));
        assert!(!(doubled <= 1.001), "{shape:?}: the check lets a doubled distance pass");
    }
}

#[test]
fn shapes_lie_inside_their_bounding_balls_and_touch_them() {
    for shape in shapes() {
        let (mut outside, mut touched) = (f32::MAX, f32::MAX);
        for index in 0..20_000 {
            let number = |axis: u32| 2.0 * uniform(9, index, axis) - 1.0;
            let direction = Vec3::new(number(0), number(1), number(2)).normalize_or(Vec3::Z);
            let value = shape.distance(direction * shape.bounding_radius());
            outside = outside.min(value);
            touched = touched.min(value.abs());
        }
        assert!(outside > -1.0e-6, "{shape:?} reaches {outside} beyond its ball");
        assert!(touched < 0.003, "{shape:?} stays {touched} inside its ball");
    }
}

#[test]
fn turning_a_placement_turns_the_shape_and_keeps_it_rigid() {
    let quarter = std::f32::consts::FRAC_PI_2;
    let standing = Placement::at(1.0, 2.0, 3.0);
    let near = |a: Vec3, b: Vec3| (a - b).length() < 1.0e-6;
    assert!(near(standing.turned_about_x(quarter).rotate_to_world(Vec3::Y), Vec3::Z));
    assert!(near(standing.turned_about_y(quarter).rotate_to_world(Vec3::Z), Vec3::X));
    assert!(near(standing.turned_about_z(quarter).rotate_to_world(Vec3::X), Vec3::Y));
    let placement = standing.turned_about_x(0.3).turned_about_y(-1.1).turned_about_z(2.5);
    let p = Vec3::new(0.2, -0.5, 0.9);
    assert!(near(placement.to_local(placement.rotate_to_world(p) + placement.origin_world()), p));
}

#[test]
fn test_views_are_not_near_any_training_view() {
    let training = training_cameras().expect("training cameras");
    for camera in test_cameras().expect("test cameras") {
        let nearest = training.iter().map(|other| camera.pose.axis_angle(&other.pose)).fold(f32::MAX, f32::min);
        let degrees = nearest.to_degrees();
        assert!((15.0..25.0).contains(&degrees), "a test view is {degrees} degrees from its nearest training view");
    }
}

/// Photographs and poses of the lorry that the command `check` has, as `picture.rs` of its crate tells them.
fn lorry_of_check() -> (RgbaImage, String) {
    let cameras = training_cameras().expect("cameras").into_iter().step_by(2);
    let (lorry, mut poses) = (lorry(), String::new());
    let mut photographs = RgbaImage::new(64, 11 * 64);
    for (view, camera) in (0..).zip(cameras.chain(test_cameras().expect("cameras").into_iter().take(1))) {
        let camera = Camera { pinhole: camera.pinhole.resized(64, 64).expect("a size"), ..camera };
        assert_eq!((camera.pinhole.focal(), camera.pinhole.principal()), ([65.625; 2], [32.0; 2]), "its intrinsics");
        image::imageops::replace(&mut photographs, &render(&lorry, &camera), 0, 64 * view);
        let numbers = camera.pose.to_opencv().map(|row| row.map(|number| number.to_string()).join(" "));
        poses += &(numbers.join(" ") + "\n");
    }
    (photographs, poses)
}

/// `VIEWFUSE_WRITE_TABLES=1` writes it.
#[test]
fn the_lorry_of_check_is_what_the_code_makes() {
    let (photographs, poses) = lorry_of_check();
    let folder = viewfuse_tests::places::repository().join("host/check/src/picture");
    if std::env::var("VIEWFUSE_WRITE_TABLES").is_ok_and(|value| value == "1") {
        photographs.save(folder.join("lorry.png")).expect("photographs");
        fs::write(folder.join("lorry.txt"), &poses).expect("poses");
    }
    let stored = image::open(folder.join("lorry.png")).expect("photographs").into_rgba8();
    assert!(stored == photographs && fs::read_to_string(folder.join("lorry.txt")).expect("poses") == poses);
}
