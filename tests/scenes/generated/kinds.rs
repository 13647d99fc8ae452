//! Cars: every one fits into its pictures, and is another one.

use image::RgbaImage;
use viewfuse_lab::scenes::cameras::{random_views, sphere};
use viewfuse_lab::scenes::kinds::{MAX_RADIUS, car as object};
use viewfuse_lab::scenes::{Light, Object, Orbit, render_with};

const SIDE: u32 = 64;

#[test]
fn every_object_fits_into_its_pictures() {
    // A ball that touches the picture's edge: its sine is that of half the field of view.
    let widest = 1.3 * (64.0_f32 / 131.25).atan().sin();
    assert!(MAX_RADIUS < widest, "{MAX_RADIUS} is cut off at {widest}");
    for index in 0..500 {
        let object = object(1, index);
        let radius = object.bounding_radius();
        assert!((0.2..=MAX_RADIUS).contains(&radius), "car {index} reaches {radius}");
        assert!(object.parts().len() >= 2, "car {index} has {} parts", object.parts().len());
    }
}

#[test]
fn the_diagonal_of_cars_is_that_of_shapenet() {
    let radii: Vec<f32> = (0..200).map(|index| object(2, index).bounding_radius()).collect();
    let within = radii.iter().filter(|radius| (0.38..0.53).contains(*radius)).count();
    assert!(within >= 190, "car: {within} of 200 have about half a unit's radius");
}

#[test]
fn seed_and_index_decide_the_object() {
    let objects: Vec<Object> = (0..60).map(|index| object(3, index)).collect();
    assert_eq!(objects[17], object(3, 17), "the same again");
    assert_ne!(objects[17], object(4, 17), "another seed");
    assert_ne!(objects[17], object(3 + (1 << 32), 17), "another seed in its high word");
    for (index, object) in objects.iter().enumerate() {
        assert!(!objects[..index].contains(object), "car {index} is there twice");
    }
}

/// Pixels that show something.
fn covered(picture: &RgbaImage) -> usize {
    picture.pixels().filter(|pixel| pixel[3] > 0).count()
}

/// Whether something shows at the picture's edge.
fn is_cut(picture: &RgbaImage) -> bool {
    picture.enumerate_pixels().any(|(x, y, pixel)| (x == 0 || y == 0 || x == SIDE - 1 || y == SIDE - 1) && pixel[3] > 0)
}

#[test]
fn objects_are_seen_whole_and_differently_from_everywhere() {
    let sphere = sphere(SIDE).expect("a size");
    let mut cut_from_near = 0;
    for index in 0..10 {
        let object = object(5, index);
        let views = random_views(&sphere, 5, index, 6).expect("cameras");
        let pictures: Vec<RgbaImage> = views.iter().map(|view| render_with(&object, view, 1)).collect();
        for (view, picture) in pictures.iter().enumerate() {
            assert!(!is_cut(picture), "car {index} is cut off in view {view}");
            let share = covered(picture) as f32 / (SIDE * SIDE) as f32;
            assert!((0.01..0.5).contains(&share), "car {index} covers {share} of view {view}");
            assert!(!pictures[..view].contains(picture), "car {index}: view {view} shows nothing new");
        }
        let near = Orbit { radius: 0.7, ..sphere }.camera(0.9, 0.3).expect("a camera");
        cut_from_near += u32::from(is_cut(&render_with(&object, &near, 1)));
    }
    assert!(cut_from_near > 3, "the check finds nothing cut off from near, either");
}

#[test]
fn cars_face_along_x_and_stand_upright() {
    for index in 0..30 {
        let object = object(6, index);
        // The body is the first part.
        let half = object.parts()[0].shape.half_box();
        assert!(half.x > 1.8 * half.y && half.x > 1.8 * half.z, "car {index} is {half}");
    }
}

#[test]
fn lamps_differ() {
    let lights: Vec<Light> = (0..20).map(|index| *object(7, index).light()).collect();
    assert!(lights.iter().enumerate().all(|(index, light)| !lights[..index].contains(light)));
}
