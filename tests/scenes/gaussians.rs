//! Files of Gaussians: what is written is read again, by our reader and another one; other orders and types; what is
//! refused.

use glam::DVec3;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Property};
use std::path::{Path, PathBuf};
use viewfuse::check::poses::Random;
use viewfuse::scene::SceneFrame;
use viewfuse::scene::gaussians::{Gaussian, GaussianScene, MAX_LOGARITHM};
use viewfuse_core::Vec3;
use viewfuse_core::gaussian::{REST_COUNTS, SH_0};
use viewfuse_tests::scenes::Folder;

/// Gaussians of random parameters.
pub(super) fn drawn(count: usize, degree: u32, seed: u32) -> GaussianScene {
    let mut random = Random::new(seed);
    let mut number = || random.normal() as f32;
    let gaussian = |_| Gaussian {
        position: [number(), number(), number()],
        log_scales: [number() - 3.0, number() - 3.0, number() - 3.0],
        rotation: [number(), number(), number(), number()],
        opacity: number(),
        f_dc: [number(), number(), number()],
    };
    let gaussians: Vec<Gaussian> = (0..count).map(gaussian).collect();
    let f_rest = (0..count * 3 * REST_COUNTS[degree as usize] as usize).map(|_| number()).collect();
    GaussianScene { gaussians, degree, f_rest, is_antialiased: false }
}

fn written(scene: &GaussianScene, frame: &SceneFrame) -> (Folder, PathBuf) {
    let folder = Folder::new();
    let path = folder.join("scene.ply");
    scene.write(&path, frame).expect("a file");
    (folder, path)
}

#[test]
fn what_is_written_is_read() {
    for degree in 0..=3 {
        let scene = drawn(17, degree, 5 + degree);
        let (_folder, path) = written(&scene, &SceneFrame::FILE);
        assert_eq!(GaussianScene::read(&path, &SceneFrame::FILE).expect("our own file"), scene);
    }
    let (_folder, path) = written(&GaussianScene::default(), &SceneFrame::FILE);
    assert_eq!(GaussianScene::read(&path, &SceneFrame::FILE).expect("no Gaussians"), GaussianScene::default());
}

/// What no reader takes is not written, whatever a caller made of it.
#[test]
fn what_would_not_be_read_is_not_written() {
    type Change = fn(&mut GaussianScene);
    let cases: [(&str, Change, &str); 5] = [
        ("a.ply", |scene| scene.f_rest.truncate(17), "17 harmonics of degree 1 for 2 Gaussians"),
        ("a.ply", |scene| scene.gaussians[1].position[2] = 1.0e35, "Gaussian 1 is further than 1e30"),
        ("a.splat", |scene| scene.gaussians[1].position[0] = -1.0e35, "Gaussian 1 is further than 1e30"),
        ("a.splat", |scene| scene.gaussians[0].log_scales[1] = 100.0, "Gaussian 0 is larger"),
        ("a.splat", |scene| *scene = GaussianScene::default(), "there are no Gaussians"),
    ];
    for (name, change, words) in cases {
        let (folder, mut scene) = (Folder::new(), drawn(2, 1, 3));
        scene.write(&folder.join(name), &SceneFrame::FILE).expect("two Gaussians");
        std::fs::remove_file(folder.join(name)).expect("it was written");
        change(&mut scene);
        // Other formats have the logarithm.
        if name == "a.splat" && words.ends_with("larger") {
            scene.write(&folder.join("a.ply"), &SceneFrame::FILE).expect("a large one");
        }
        let error = scene.write(&folder.join(name), &SceneFrame::FILE).expect_err(words).to_string();
        assert!(error.contains(words) && !folder.join(name).exists(), "{name}: {error}");
    }
}

/// Coordinates of a survey: `f32` would hold them to a quarter of a unit.
#[test]
fn a_scene_that_was_moved_and_scaled_keeps_its_place_in_its_files() {
    let scene = drawn(40, 1, 9);
    let frame = SceneFrame { origin: DVec3::new(4.0e6, -7.0e6, 120.0), scale: 250.0 };
    let (_folder, path) = written(&scene, &frame);
    let file = GaussianScene::read(&path, &frame).expect("our own file");
    assert_eq!(file.f_rest, scene.f_rest);
    for (read, kept) in file.gaussians.iter().zip(&scene.gaussians) {
        assert_eq!((read.f_dc, read.rotation, read.opacity), (kept.f_dc, kept.rotation, kept.opacity));
        (0..3).for_each(|axis| assert!((read.position[axis] - kept.position[axis]).abs() < 1.0e-6));
        (0..3).for_each(|axis| assert!((read.log_scales[axis] - kept.log_scales[axis]).abs() < 1.0e-6));
    }
    let in_file = GaussianScene::read(&path, &SceneFrame::FILE).expect("our own file").gaussians[3];
    let place = frame.file(Vec3::from(scene.gaussians[3].position).as_dvec3());
    // Rounded about the origin, then in the file's coordinates.
    let rounded = f32::EPSILON * (place.as_vec3().abs() + frame.scale as f32);
    assert!((Vec3::from(in_file.position) - place.as_vec3()).abs().cmple(rounded).all(), "{in_file:?}, {place}");
    assert!((in_file.log_scales[1] - scene.gaussians[3].log_scales[1] - 250.0_f32.ln()).abs() < 1.0e-5);
}

/// The vertices of a file by a reader that is not ours.
fn elsewhere(path: &Path) -> Vec<DefaultElement> {
    let mut bytes = std::io::BufReader::new(std::fs::File::open(path).expect("a file"));
    let mut ply = Parser::<DefaultElement>::new().read_ply(&mut bytes).expect("PLY");
    ply.payload.swap_remove("vertex").expect("vertices")
}

#[test]
fn another_reader_finds_the_published_layout() {
    let scene = drawn(30, 3, 3);
    let (_folder, path) = written(&scene, &SceneFrame::FILE);
    let vertices = elsewhere(&path);
    assert_eq!(vertices.len(), 30);
    for (index, (vertex, gaussian)) in vertices.iter().zip(&scene.gaussians).enumerate() {
        let float = |name: &str| match vertex.get(name) {
            Some(Property::Float(value)) => *value,
            other => panic!("{name} is {other:?}"),
        };
        assert_eq!(["x", "y", "z"].map(float), gaussian.position);
        assert_eq!(["nx", "ny", "nz"].map(float), [0.0; 3]);
        assert_eq!(["f_dc_0", "f_dc_1", "f_dc_2"].map(float), gaussian.f_dc);
        assert_eq!(["scale_0", "scale_1", "scale_2"].map(float), gaussian.log_scales);
        assert_eq!(["rot_0", "rot_1", "rot_2", "rot_3"].map(float), gaussian.rotation);
        assert_eq!(float("opacity"), gaussian.opacity);
        let rest: Vec<f32> = (0..45).map(|number| float(&format!("f_rest_{number}"))).collect();
        assert_eq!(rest, scene.f_rest[45 * index..45 * (index + 1)]);
    }
    // The order of the published code's columns, which some viewers expect.
    let names: Vec<&String> = vertices[0].keys().collect();
    assert_eq!(
        (names[0], names[5], names[6], names[9], names[54]),
        (&"x".into(), &"nz".into(), &"f_dc_0".into(), &"f_rest_0".into(), &"opacity".into())
    );
    assert_eq!((names[55], names[61], names.len()), (&"scale_0".into(), &"rot_3".into(), 62));
}

/// A file of one Gaussian: its columns as type, name, value.
fn file(columns: &[(&str, &str, f64)]) -> Vec<u8> {
    let mut bytes =
        b"ply\nformat binary_little_endian 1.0\nelement other 2\nproperty short a\nelement vertex 1\n".to_vec();
    columns.iter().for_each(|(kind, name, _)| bytes.extend(format!("property {kind} {name}\n").bytes()));
    bytes.extend(b"element face 1\nproperty list uchar int vertex_indices\nend_header\n\x01\x02\x03\x04");
    for (kind, _, value) in columns {
        match *kind {
            "double" | "float64" => bytes.extend(value.to_le_bytes()),
            "uchar" => bytes.push(*value as u8),
            _ => bytes.extend((*value as f32).to_le_bytes()),
        }
    }
    bytes.extend(b"\x00");
    bytes
}

/// The columns that a file needs, in no usual order.
fn columns() -> Vec<(&'static str, &'static str, f64)> {
    vec![
        ("float", "rot_3", 0.5),
        ("double", "x", 1.0),
        ("float", "y", 2.0),
        ("uchar", "red", 9.0),
        ("float", "z", 3.0),
        ("float", "scale_2", -1.0),
        ("float", "scale_0", -3.0),
        ("double", "scale_1", -2.0),
        ("float32", "opacity", 0.25),
        ("float", "f_dc_2", 0.75),
        ("float", "f_dc_1", 0.5),
        ("float64", "f_dc_0", 0.25),
        ("float", "rot_0", 1.0),
        ("float", "rot_1", 0.125),
        ("float", "rot_2", 0.25),
        ("uchar", "class", 1.0),
    ]
}

fn read(bytes: &[u8]) -> Result<GaussianScene, String> {
    let folder = Folder::new();
    let path = folder.write("scene.ply", bytes).join("scene.ply");
    GaussianScene::read(&path, &SceneFrame::FILE).map_err(|error| {
        let message = error.to_string();
        message.strip_prefix(&path.display().to_string()).expect("the file").to_owned()
    })
}

#[test]
fn any_order_and_further_properties_are_read() {
    let scene = read(&file(&columns())).expect("a file");
    let expected = Gaussian {
        position: [1.0, 2.0, 3.0],
        log_scales: [-3.0, -2.0, -1.0],
        rotation: [1.0, 0.125, 0.25, 0.5],
        opacity: 0.25,
        f_dc: [0.25, 0.5, 0.75],
    };
    assert_eq!((&scene.gaussians[..], scene.degree), (&[expected][..], 0));
    // Infinite logits and flat Gaussians are what some programs write for "opaque" and "no thickness".
    let set = |changes: &[(&str, f64)]| {
        let mut columns = columns();
        for (name, value) in changes {
            columns.iter_mut().find(|column| column.1 == *name).expect("a column").2 = *value;
        }
        read(&file(&columns))
    };
    let flat = set(&[("opacity", f64::INFINITY), ("scale_2", f64::NEG_INFINITY)]).expect("a file").gaussians[0];
    assert_eq!((flat.opacity, flat.log_scales[2]), (MAX_LOGARITHM, -MAX_LOGARITHM));
    let refused = [
        ("opacity", f64::NAN, ": vertex[0].opacity: \"NaN\" is not a finite number"),
        ("scale_1", f64::INFINITY, ": vertex[0].scale_1: \"inf\" is not a finite number"),
        ("rot_2", f64::INFINITY, ": vertex[0].rot_2: \"inf\" is not a finite number"),
        ("f_dc_0", 1.0e300, ": vertex[0].f_dc_0: \"1000000"),
        ("x", f64::NAN, ": vertex[0]: the point (NaN, 2, 3) is not finite, or further than 1e30 from the origin"),
        ("x", 1.0e31, ": vertex[0]: the point (1e31, 2, 3)"),
    ];
    for (name, value, message) in refused {
        let told = set(&[(name, value)]).expect_err(name);
        assert!(told.starts_with(message), "{told}");
    }
}

#[test]
fn what_is_no_file_of_gaussians_is_refused() {
    let whole = file(&columns());
    let text = |from: &str, to: &str| {
        let place = whole.windows(from.len()).position(|part| part == from.as_bytes()).expect(from);
        [&whole[..place], to.as_bytes(), &whole[place + from.len()..]].concat()
    };
    let cases = [
        (b"solid\n".to_vec(), ":1: not a readable PLY file: the first line is not ply"),
        (Vec::new(), ": the file is empty"),
        (
            text("binary_little_endian", "ascii"),
            ":2: not a readable PLY file: the format is \"ascii 1.0\"; binary_little_endian 1.0 is read",
        ),
        (
            text("element vertex 1\n", "element vertex -1\n"),
            ":5: not a readable PLY file: \"element vertex -1\" is no line of a header",
        ),
        (
            text("element vertex 1\n", "element vertex 2\n"),
            ": element vertex: announces 2 rows; the file has room for 1",
        ),
        (
            text("vertex 1\n", "vertex 18446744073709551615\n"),
            ": element vertex: announces 18446744073709551615 rows; the file has room for 1",
        ),
        (
            text("vertex 1\n", "point 1\n"),
            ": not a readable PLY file: element face has a list; rows of one length are read",
        ),
        (
            text("property short a\n", "property list uchar int a\n"),
            ": not a readable PLY file: element other has a list",
        ),
        (text("float32 opacity", "float density"), ": property opacity is missing"),
        (text("float32 opacity", "int opacity"), ": property opacity must be float or double"),
        (text("uchar red", "float y"), ":9: not a readable PLY file: property y is there twice"),
        (
            text("uchar class", "uchar f_rest_0"),
            ": not a readable PLY file: there are 1 properties f_rest_; degrees 0 to 3 have 0, 9, 24 or 45",
        ),
        (text("uchar red", "quad red"), ":9: not a readable PLY file: there is no type \"quad\""),
        (text("element other 2\n", ""), ":3: not a readable PLY file: a property before the first element"),
    ];
    for (bytes, message) in cases {
        let told = read(&bytes).expect_err(message);
        assert!(told.starts_with(message), "{told}");
    }
    // However much of it is there, a part is an error. Behind the row of the Gaussian lies only what nobody asks for.
    for length in 0..whole.len() - 1 {
        assert!(read(&whole[..length]).is_err(), "{length} bytes of {}", whole.len());
    }
    assert!(read(&whole[..whole.len() - 1]).is_ok());
    let missing = GaussianScene::read(Path::new("none.ply"), &SceneFrame::FILE).expect_err("no file");
    assert_eq!(missing.to_string(), "none.ply: no such file or folder");
}

#[test]
fn blocks_have_the_colours_of_degree_0() {
    let scene = drawn(60, 2, 4);
    let level = |value: f32| 0.5 + SH_0 * value;
    assert!(scene.gaussians.iter().any(|gaussian| gaussian.f_dc.into_iter().any(|value| level(value) < 0.0)));
    let flat = GaussianScene { degree: 0, f_rest: Vec::new(), ..scene.clone() };
    for (scene, least) in [(&scene, f32::MIN), (&flat, 0.0)] {
        for (block, gaussian) in scene.blocks().iter().zip(&scene.gaussians) {
            assert_eq!(block.colour, gaussian.f_dc.map(|value| level(value).max(least)));
            assert_eq!((block.position, block.rotation), (gaussian.position, gaussian.rotation));
            assert_eq!((block.log_scales, block.opacity), (gaussian.log_scales, gaussian.opacity));
        }
    }
}
