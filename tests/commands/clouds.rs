//! `viewfuse points`, read by another program's reader.

use super::{assert_refused, assert_wrong_arguments, done};
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use viewfuse::core::Vec3;
use viewfuse::scene::Scene;
use viewfuse_tests::command::toy;

viewfuse_tests::trials![the_lorry_as_points, too_much_agreement_is_refused, another_format_is_refused_before_the_work];

struct Point {
    position: Vec3,
    normal: Vec3,
    colour: [u8; 3],
}

fn points(path: &Path) -> Vec<Point> {
    let mut file = BufReader::new(File::open(path).expect("a file"));
    let ply = Parser::<DefaultElement>::new().read_ply(&mut file).expect("PLY");
    let number = |element: &DefaultElement, name: &str| match element.get(name) {
        Some(Property::Float(value)) => *value,
        other => panic!("{name} is {other:?}"),
    };
    let level = |element: &DefaultElement, name: &str| match element.get(name) {
        Some(Property::UChar(value)) => *value,
        other => panic!("{name} is {other:?}"),
    };
    let vector = |element: &DefaultElement, names: [&str; 3]| Vec3::from(names.map(|name| number(element, name)));
    let point = |element: &DefaultElement| Point {
        position: vector(element, ["x", "y", "z"]),
        normal: vector(element, ["nx", "ny", "nz"]),
        colour: ["red", "green", "blue"].map(|name| level(element, name)),
    };
    ply.payload["vertex"].iter().map(point).collect()
}

fn the_lorry_as_points() {
    let folder = toy();
    let printed = done(&folder, "points toy --size 64x64 --device cpu -o cloud/toy.ply");
    let points = points(&folder.join("cloud/toy.ply"));
    assert!(printed.starts_with(&format!("cloud/toy.ply: {} points of 24 views\n", points.len())), "{printed}");
    assert!(points.len() > 2000, "{printed}");
    let scene = Scene::open(folder.join("toy")).expect("the sample");
    let photographs: Vec<_> = (0..24).map(|view| scene.photograph(view).expect("a photograph").pixels).collect();
    let (mut outside, mut checked, mut close, mut compared) = (0, 0, 0, 0);
    for point in &points {
        assert!((point.normal.length() - 1.0).abs() < 1.0e-4);
        // The lorry is within 0.55 of the origin.
        assert!(point.position.length() < 0.6, "{}", point.position);
        let mut is_outside = false;
        for (view, photograph) in scene.views.iter().zip(&photographs) {
            let seen = view.camera.project(point.position);
            if !seen.in_image {
                continue;
            }
            let pixel = photograph
                .get_pixel((seen.x as u32).min(photograph.width() - 1), (seen.y as u32).min(photograph.height() - 1));
            // Two pixels of the matched size: the photographs are of 128.
            let is_object = (-4..=4).any(|dy: i32| {
                (-4..=4).any(|dx: i32| {
                    let (x, y) = ((seen.x as i32 + dx).clamp(0, 127) as u32, (seen.y as i32 + dy).clamp(0, 127) as u32);
                    photograph
                        .get_pixel_checked(x, y)
                        .is_some_and(|near| near.0[..3] != photograph.get_pixel(0, 0).0[..3])
                })
            });
            is_outside |= !is_object;
            // Of a camera that looks onto the surface, the point has a colour of the photograph or is hidden.
            let towards = (view.camera.pose.centre_world() - point.position).normalize();
            if towards.dot(point.normal) > 0.7 {
                compared += 1;
                close += usize::from((0..3).all(|channel| pixel[channel].abs_diff(point.colour[channel]) < 48));
            }
        }
        checked += 1;
        outside += usize::from(is_outside);
    }
    let (inside, alike) = (1.0 - outside as f64 / checked as f64, close as f64 / compared as f64);
    assert!(inside > 0.95, "{inside}");
    assert!(compared > 2 * points.len() && alike > 0.6, "{alike} of {compared}");
}

fn too_much_agreement_is_refused() {
    let folder = toy();
    let arguments = "points toy --sources 0..1 --agree 3 --size 16x16 --device cpu -o none.ply";
    assert_refused(&folder, arguments, &["toy: no 3 of 2 views agree"]);
}

fn another_format_is_refused_before_the_work() {
    let folder = toy();
    for file in ["toy.obj", "toy", "ply"] {
        let parts = [file, "point clouds are written as .ply"];
        assert_wrong_arguments(&folder, &format!("points toy -o {file}"), &parts);
    }
    done(&folder, "points toy --size 16x16 --sources 0..7 --agree 1 --device cpu -o toy.PLY");
    assert!(folder.join("toy.PLY").exists());
    done(&folder, "points toy --size 16x16 --sources 0..7 --agree 1 --device cpu -o toy.PLY");
}
