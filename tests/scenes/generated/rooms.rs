//! Rooms: the checked-in sample against what the code makes, exact depth against other views, rays against single
//! parts.

use std::fs;
use std::path::PathBuf;
use viewfuse::scene::Scene;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole, Ray};
use viewfuse_core::pose::Pose;
use viewfuse_core::random::uniform;
use viewfuse_lab::scenes::lamp::Lamp;
use viewfuse_lab::scenes::photograph::{RAYS_PER_SIDE, photograph};
use viewfuse_lab::scenes::room::{CEILING, FLOOR, HALF_LENGTH, HALF_WIDTH};
use viewfuse_lab::scenes::shoot::{Shoot, generate, sample};
use viewfuse_lab::scenes::trace::first;
use viewfuse_lab::scenes::transforms::{file_name, jpeg};
use viewfuse_lab::scenes::{Finish, Object, Part, Placement, Scenery, Shape, Texture, write_shoot};

/// Most that the sample may take in the repository.
const MAX_BYTE_COUNT: u64 = 600_000;

fn folder() -> PathBuf {
    viewfuse_tests::places::data("room")
}

fn small(seed: u64, count: u32) -> Shoot {
    generate(seed, [64, 48], count).expect("a room")
}

#[test]
fn the_sample_room_is_what_the_code_makes() {
    let room = sample().expect("the sample");
    let view = 4;
    let path = folder().join(file_name(view));
    let stored = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let made = jpeg(&room.photograph(view, RAYS_PER_SIDE).expect("a view")).expect("a JPEG");
    assert!(stored == made, "{} is out of date: see tests/data/room.md", path.display());

    let scene = Scene::open(folder()).expect("the sample opens");
    assert_eq!(scene.views.len(), room.cameras().len());
    for (view, camera) in scene.views.iter().zip(room.cameras()) {
        assert_eq!(view.camera.pinhole, camera.pinhole, "{}", view.name);
        assert!(view.camera.pose.distance(&camera.pose) < 1.0e-5, "{}", view.name);
        assert!(view.camera.pose.rotation_angle(&camera.pose) < 1.0e-3, "{}", view.name);
    }
    let length = |path: PathBuf| fs::metadata(path).expect("a file").len();
    let photographs: u64 = (0..room.cameras().len()).map(|view| length(folder().join(file_name(view)))).sum();
    let total = photographs + length(folder().join("transforms.json"));
    assert!(total <= MAX_BYTE_COUNT, "the sample takes {total} bytes");
}

#[test]
fn the_samples_cameras_are_as_far_apart_as_a_person_goes() {
    let room = sample().expect("the sample");
    let towards = |camera: &Camera| camera.pose.centre_world().normalize_or(Vec3::Z);
    for pair in room.cameras().windows(2) {
        let degrees = towards(&pair[0]).dot(towards(&pair[1])).acos().to_degrees();
        assert!((4.0..15.0).contains(&degrees), "{degrees} degrees");
    }
}

#[test]
fn the_sample_is_deep_and_textured_everywhere() {
    let room = sample().expect("the sample");
    let (mut nearest, mut farthest) = (f32::MAX, 0.0_f32);
    for view in 0..room.cameras().len() {
        for depth in room.depth(view).expect("a view") {
            assert!(depth.is_finite(), "view {view} sees out of the room");
            nearest = nearest.min(depth);
            farthest = farthest.max(depth);
        }
        let path = folder().join(file_name(view));
        let pixels = image::open(&path).expect("a photograph").into_luma8();
        let (columns, rows) = (pixels.width() / 16, pixels.height() / 16);
        let flat = (0..columns * rows)
            .filter(|block| {
                let corner = [16 * (block % columns), 16 * (block / columns)];
                let value = |index: u32| f32::from(pixels.get_pixel(corner[0] + index % 16, corner[1] + index / 16)[0]);
                let mean = (0..256).map(value).sum::<f32>() / 256.0;
                let variance = (0..256).map(|index| (value(index) - mean).powi(2)).sum::<f32>() / 256.0;
                variance.sqrt() < 4.0
            })
            .count();
        assert!(flat * 50 <= (columns * rows) as usize, "view {view}: {flat} of {} blocks are flat", columns * rows);
    }
    assert!(farthest > 3.0 * nearest && nearest > 0.5, "depths from {nearest} to {farthest}");
}

#[test]
fn no_view_sees_what_another_views_depth_hides() {
    let room = generate(5, [160, 120], 7).expect("a room");
    let (first, second) = (2, 3);
    let [a, b] = [first, second].map(|view| room.cameras()[view]);
    let [depths, others] = [first, second].map(|view| room.depth(view).expect("a view"));
    let (mut same, mut hidden, mut seen_through) = (0, 0, 0);
    for (index, depth) in depths.iter().enumerate() {
        let ray = a.ray((index % 160) as f32 + 0.5, (index / 160) as f32 + 0.5);
        let point = ray.at(depth / ray.direction_world.dot(a.pose.forward_world()));
        let place = b.project(point);
        if !place.in_front || !(0.0..160.0).contains(&place.x) || !(0.0..120.0).contains(&place.y) {
            continue;
        }
        let other = others[place.y as usize * 160 + place.x as usize];
        let tolerance = 0.06 * place.depth;
        if (other - place.depth).abs() <= tolerance {
            same += 1;
        } else if other < place.depth {
            hidden += 1;
        } else {
            seen_through += 1;
        }
    }
    // Beside edges, the centre of the other view's pixel sees past the point.
    assert!(same > 10_000 && seen_through * 40 < same, "{same} alike, {hidden} hidden, {seen_through} seen through");
}

#[test]
fn boxes_around_parts_change_no_ray() {
    let room = small(3, 2);
    let whole = room.scenery().object();
    let single: Vec<Object> = whole.parts().iter().map(|part| Object::new(vec![*part])).collect();
    for index in 0..400 {
        let number = |axis: u32| 2.0 * uniform(11, index, axis) - 1.0;
        let direction_world = Vec3::new(number(0), number(1), number(2)).normalize_or(Vec3::X);
        let ray = Ray { origin_world: Vec3::new(3.0 * number(3), -2.5, 0.8 + number(4)), direction_world };
        let alone = single.iter().filter_map(|object| first(object, &ray, f32::MAX)).map(|(distance, _)| distance);
        let nearest = alone.fold(f32::MAX, f32::min);
        let found = first(whole, &ray, f32::MAX).map_or(f32::MAX, |(distance, _)| distance);
        assert_eq!(found, nearest, "ray {index}");
        assert!(first(whole, &ray, nearest * 0.999).is_none(), "ray {index}: a limit is not kept");
    }
}

#[test]
fn cameras_stay_in_the_room_and_see_it() {
    for seed in 0..6 {
        let room = small(seed, 9);
        assert_eq!(room.cameras().len(), 9);
        for (view, camera) in room.cameras().iter().enumerate() {
            let centre = camera.pose.centre_world();
            let inside = centre.x.abs() < HALF_WIDTH && centre.y.abs() < HALF_LENGTH;
            assert!(inside && (FLOOR..CEILING).contains(&centre.z), "{seed} {view}: {centre}");
            let free = room.scenery().object().distance(centre, 1.0);
            assert!(free > 0.15, "{seed} {view}: {free} from the nearest part");
        }
    }
}

#[test]
fn photographs_belong_to_the_seed_and_not_to_the_threads() {
    let room = small(1, 2);
    let with_threads = |count| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().expect("a thread pool");
        pool.install(|| room.photograph(0, 2).expect("a view"))
    };
    assert!(with_threads(1) == with_threads(3), "bit for bit");
    assert!(small(1, 2).photograph(0, 2) == room.photograph(0, 2), "bit for bit");
    assert!(small(2, 2).photograph(0, 2) != room.photograph(0, 2), "another seed, another room");
    assert!(room.photograph(1, 2) != room.photograph(0, 2));
    assert!(room.photograph(2, 2).is_none() && room.depth(2).is_none());
}

#[test]
fn a_written_room_opens_as_it_was() {
    let directory = tempfile::tempdir().expect("a folder");
    let folder = directory.path().join("scene");
    let room = small(8, 3);
    write_shoot(&folder, &room, 1, &viewfuse::job::progress::Silent).expect("written");
    let scene = Scene::open(&folder).expect("it opens");
    assert_eq!((scene.layout, scene.views.len()), ("transforms", 3));
    for (index, (view, camera)) in scene.views.iter().zip(room.cameras()).enumerate() {
        assert!(view.camera.pose.distance(&camera.pose) < 1.0e-5);
        assert_eq!(scene.photograph(index).expect("a photograph").pixels.dimensions(), (64, 48));
    }
    let again = write_shoot(&folder, &room, 1, &viewfuse::job::progress::Silent);
    assert!(again.expect_err("it exists").to_string().contains("exists already"));
}

/// A grey floor, and a ball above it.
fn ball_over_floor() -> Vec<Part> {
    let finish = Finish { texture: Texture::Plain { colour: Vec3::splat(0.7) }, gloss: 0.0 };
    let floor = Shape::Block { half_size: Vec3::new(3.0, 3.0, 0.1), rounding: 0.0 };
    vec![
        Part { shape: floor, placement: Placement::at(0.0, 0.0, -0.1), finish },
        Part { shape: Shape::Sphere { radius: 0.3 }, placement: Placement::at(0.0, 0.0, 1.0), finish },
    ]
}

fn lamp(radius: f32) -> Lamp {
    Lamp { centre: Vec3::new(0.0, 0.0, 4.0), radius, light: Vec3::ONE, reach: 4.0 }
}

#[test]
fn a_larger_lamp_throws_a_softer_shadow() {
    let pose = Pose::look_at(Vec3::new(0.0, -2.4, 0.6), Vec3::ZERO, Vec3::Z).expect("a pose");
    let camera = Camera { pose, pinhole: Pinhole::new([80.0; 2], [40.0, 30.0], 80, 60).expect("a pinhole") };
    let shades = |radius: f32| {
        let scenery = Scenery::new(ball_over_floor(), vec![lamp(radius)], [Vec3::ZERO; 2]);
        let picture = photograph(&scenery, &camera, 4, 1);
        // The row that passes through the floor below the ball.
        let row = camera.project(Vec3::ZERO).y as u32;
        let lit = (0..80).map(|column| picture.get_pixel(column, row)[0]).max().expect("pixels");
        (0..80).filter(|&column| (20..lit - 20).contains(&picture.get_pixel(column, row)[0])).count()
    };
    let (sharp, soft) = (shades(0.02), shades(0.8));
    assert!(soft > sharp + 6, "{sharp} pixels between light and shadow, then {soft}");
}

#[test]
fn pictures_without_pixels_are_refused() {
    assert!(generate(0, [0, 48], 1).is_err());
}
