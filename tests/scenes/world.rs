//! Where the world is put: ordinary scenes keep their numbers, surveyed coordinates come near to the origin in f64.

use super::made::*;
use glam::DVec3;
use viewfuse::scene::{Scene, SceneFrame};
use viewfuse_core::Vec3;
use viewfuse_tests::scenes::{self, Folder, words};

/// An SRN scene of three cameras that look along world x, at these centres.
fn at(centres: [[f64; 3]; 3]) -> Folder {
    let folder = Folder::new();
    for (index, centre) in centres.into_iter().enumerate() {
        let mut pose = scenes::WORLD_FROM_CAMERA;
        (pose[3], pose[7], pose[11]) = (centre[0], centre[1], centre[2]);
        folder.image(&format!("rgb/{index}.png"), 16, 12).write(&format!("pose/{index}.txt"), words(&pose));
    }
    folder.write("intrinsics.txt", "20. 8. 6. 0.\n0. 0. 0.\n1.\n12 16\n");
    folder
}

fn centres(scene: &Scene) -> Vec<Vec3> {
    scene.views.iter().map(|view| view.camera.pose.centre_world()).collect()
}

#[test]
fn ordinary_scenes_keep_their_numbers() {
    for centres_file in [
        [[1.1, 0.0, 0.0], [0.0, 1.2, 0.0], [0.0, 0.0, 1.3]],
        // Almost 16 times its spread away.
        [[15.0, 0.0, 0.0], [15.0, 1.7, 0.0], [15.0, 0.0, 1.7]],
        [[9e3, 0.0, 0.0], [0.0, 9e3, 0.0], [0.0, 0.0, 9e3]],
    ] {
        let scene = open(&at(centres_file));
        assert_eq!(scene.frame, SceneFrame::FILE);
        let expected = centres_file.map(|centre| DVec3::from_array(centre).as_vec3());
        assert_eq!(centres(&scene), expected);
    }
}

#[test]
fn surveyed_coordinates_keep_their_millimetres() {
    // Metres of a map, where f32 has steps of half a metre.
    let origin = DVec3::new(4_468_123.0, 5_333_987.0, 512.0);
    let near = [DVec3::new(0.001, 0.0, 0.0), DVec3::new(0.0, 1.002, 0.0), DVec3::new(0.0, 0.0, -1.003)];
    let scene = open(&at(near.map(|offset| (origin + offset).to_array())));
    assert_eq!(scene.frame.scale, 1.0);
    assert!(scene.frame.origin.distance(origin) < 1.0);
    for (world, offset) in centres(&scene).into_iter().zip(near) {
        let file = scene.frame.file(world.as_dvec3());
        assert!(file.distance(origin + offset) < 1e-7, "{file}");
        assert!(scene.frame.world(file).distance(world.as_dvec3()) < 1e-8);
    }
}

#[test]
fn the_origin_is_what_the_cameras_look_at() {
    // A ring of cameras around a point of a map, looking at it; the point is no centroid of theirs.
    let subject = DVec3::new(4_468_123.37, -5_333_987.91, 512.253);
    let folder = at([[0.0; 3]; 3]);
    for index in 0..3 {
        let (sine, cosine) = (2.0 * f64::from(index)).sin_cos();
        let forward = -DVec3::new(0.8 * cosine, 0.8 * sine, 0.6);
        let right = forward.cross(DVec3::Z).normalize();
        let down = forward.cross(right);
        let centre = subject - 1.3 * forward;
        let rows = [0, 1, 2].map(|row| [right[row], down[row], forward[row], centre[row]]);
        folder.write(&format!("pose/{index}.txt"), words(&[rows.as_flattened(), &[0.0, 0.0, 0.0, 1.0]].concat()));
    }
    let scene = open(&folder);
    assert!(scene.frame.origin.distance(subject) < 1e-8, "{:?}", scene.frame);
    assert!(centres(&scene).into_iter().all(|centre| (centre.length() - 1.3).abs() < 1e-6));
}

#[test]
fn a_single_place_far_away_is_the_origin() {
    for (place, is_moved) in [(1.0e6, true), (1.0e3, false)] {
        let scene = open(&at([[place, 0.5, 0.25]; 3]));
        assert_eq!(scene.frame.origin.length() > 1.0, is_moved);
        assert!(scene.frame.file(centres(&scene)[1].as_dvec3()).distance(DVec3::new(place, 0.5, 0.25)) < 1e-9);
    }
}

#[test]
fn numbers_that_cannot_hold_the_distances_are_told() {
    let warned = |far: f64| {
        let scene = open(&at([[far, 0.0, 0.0], [far, 1.0, 0.0], [far, 0.0, 1.0]]));
        scene.warnings.iter().any(|warning| warning.contains("of their distances; subtract the offset"))
    };
    assert_eq!([1.0e3, 1.0e7, 1.0e11].map(warned), [false, false, true]);
}

#[test]
fn extreme_units_become_usual_ones() {
    for factor in [1e-9, 1e12] {
        let scene = open(&at([[factor, 0.0, 0.0], [0.0, factor, 0.0], [0.0, 0.0, factor]]));
        let spread = centres(&scene)[0].distance(centres(&scene)[1]);
        // Parallel axes: the unit is of the spread, the root of two thirds of the factor; the gap is the root of 2 of
        // it.
        assert!((spread - 1.3 * 3.0_f32.sqrt()).abs() < 1e-4, "{spread}");
        assert!((scene.frame.scale / (factor * (2.0_f64 / 3.0).sqrt() / 1.3) - 1.0).abs() < 1e-6);
        assert_eq!(scene.frame.origin, DVec3::ZERO);
        let file = scene.frame.file(centres(&scene)[0].as_dvec3());
        assert!(file.distance(DVec3::X * factor) < 1e-6 * factor, "{file}");
    }
}

#[test]
fn points_and_depths_move_with_the_cameras() {
    // The cameras of a COLMAP model far away and in thousandths of thousandths.
    let (far, unit) = (1e6, 1e-6);
    let folder = colmap_text();
    folder.image("images/c.png", 16, 12);
    let mut images = String::new();
    for (id, name, shift) in [(11, "b 10.png", 0.0), (12, "b 2.png", 1.0), (13, "c.png", 2.0)] {
        // The camera's y axis in the world is z: -R C for a centre (far + shift, 0, 0) is (0, 0, -far - shift).
        let line = format!("{id} {} 0 0 {} 7 {name}\n\n", words(&QUATERNION), unit * (-far - shift));
        images.push_str(&line);
    }
    folder.write("sparse/0/images.txt", images);
    folder.write("sparse/0/points3D.txt", format!("1 {} 0 0 1 2 3 0.5 11 0\n", unit * (far + 5.0)));
    let scene = open(&folder);
    assert!((scene.frame.scale / (unit * (2.0f64 / 3.0).sqrt() / 1.3) - 1.0).abs() < 1e-6, "{}", scene.frame.scale);
    let gap = centres(&scene)[0].distance(scene.points[0].position_world);
    // Views are in the order of names: b 2 stands at 1, the point at 5.
    assert!((f64::from(gap) * scene.frame.scale / unit - 4.0).abs() < 1e-6, "{gap}");
    let folder = llff();
    let row = llff_row();
    let mut other = row;
    other[3] += 1e6;
    folder.write("poses_bounds.npy", npy(&[2, 17], &[row, other].concat()));
    let scene = open(&folder);
    let scale = scene.frame.scale as f32;
    assert!((scale / (5.0e5 / 1.3) - 1.0).abs() < 1e-5, "{scale}");
    let [near, far] = scene.views[1].near_far.expect("bounds");
    assert!((near * scale - 0.5).abs() < 1e-5 && (far * scale - 9.5).abs() < 1e-4, "{near}, {far}");
}

#[test]
fn what_overflows_is_refused() {
    let folder = colmap_text();
    folder.write("sparse/0/points3D.txt", "1 1e35 0 0 1 2 3 0.5 11 0\n");
    assert_refused(&folder, "sparse/0/points3D.txt:1: the point (1e35, 0, 0) is not finite", &["further than 1e30"]);
}
