//! Files of Gaussians as other programs write and read them: worlds, properties, comments, formats, strict readers.

use super::gaussians::drawn;
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use glam::{DMat3, DVec3};
use serde_json::json;
use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use viewfuse::scene::gaussians::{Gaussian, GaussianFile, GaussianScene};
use viewfuse::scene::{Scene, SceneFrame};
use viewfuse_core::Vec3;
use viewfuse_core::gaussian::colour_along;
use viewfuse_tests::scenes::Folder;

fn read(path: &Path) -> Result<GaussianFile, String> {
    GaussianFile::read(path, &SceneFrame::FILE).map_err(|error| error.to_string())
}

/// The header of a file of Gaussians, with its last line, and the bytes of its rows.
fn parts(path: &Path) -> (String, Vec<u8>) {
    let mut bytes = fs::read(path).expect("a file");
    let end = bytes.windows(11).position(|part| part == b"end_header\n").expect("a header") + 11;
    let rows = bytes.split_off(end);
    (String::from_utf8(bytes).expect("text"), rows)
}

/// The file of a scene, with these replacements in its header.
fn changed(scene: &GaussianScene, changes: &[(&str, &str)]) -> Result<GaussianFile, String> {
    let folder = Folder::new();
    let path = folder.join("a.ply");
    scene.write(&path, &SceneFrame::FILE).expect("a file");
    let (mut header, rows) = parts(&path);
    for (from, to) in changes {
        assert!(header.contains(from), "{from}");
        header = header.replacen(from, to, 1);
    }
    std::fs::write(&path, [header.as_bytes(), &rows].concat()).expect("a file");
    read(&path)
}

#[test]
fn nerfstudios_world_is_undone() {
    let scene = Scene::open("data/room").expect("the sample");
    let turn = DMat3::from_rotation_z(0.6) * DMat3::from_rotation_x(-0.4);
    let (offset, scale) = (DVec3::new(0.2, -0.3, 0.1), 0.31);
    let folder = Folder::new();
    let path = folder.join("splat.ply");
    let gaussians = drawn(20, 3, 8);
    gaussians.write(&path, &SceneFrame::FILE).expect("a file");
    let (header, rows) = parts(&path);
    let foreign = header.replacen("comment viewfuse\n", "", 1);
    assert_ne!(foreign, header, "ours");
    std::fs::write(&path, [foreign.as_bytes(), &rows].concat()).expect("a file");
    let rows: Vec<Vec<f64>> =
        (0..3).map(|row| turn.row(row).to_array().into_iter().chain([offset[row]]).collect()).collect();
    let parser = json!({ "transform": rows, "scale": scale });
    folder.write("dataparser_transforms.json", parser.to_string());
    let file = GaussianFile::open(&path, &scene).expect("a file");
    assert!(file.notes.iter().any(|note| note.contains("dataparser_transforms.json")), "{:?}", file.notes);
    for (index, (new, old)) in file.scene.gaussians.iter().zip(&gaussians.gaussians).enumerate() {
        let position = turn.transpose() * (Vec3::from(old.position).as_dvec3() / scale - offset);
        assert!((Vec3::from(new.position) - position.as_vec3()).length() < 1.0e-4);
        assert!((new.log_scales[1] - old.log_scales[1] + (scale as f32).ln()).abs() < 1.0e-5);
        let (axes, before) = (viewfuse_core::gaussian::axes(new.rotation), viewfuse_core::gaussian::axes(old.rotation));
        for (after, before) in axes.iter().zip(before) {
            assert!((*after - (turn.transpose() * before.as_dvec3()).as_vec3()).length() < 1.0e-4);
        }
        // The same colour along the turned direction.
        for direction in [Vec3::new(0.3, -0.8, 0.5), Vec3::new(-0.9, 0.1, -0.2)] {
            let rest = |scene: &GaussianScene| scene.f_rest[45 * index..45 * (index + 1)].to_vec();
            let expected = colour_along([9.0; 3], &rest(&gaussians)[..], 3, (turn * direction.as_dvec3()).as_vec3());
            let seen = colour_along([9.0; 3], &rest(&file.scene)[..], 3, direction);
            (0..3).for_each(|channel| assert!((seen[channel] - expected[channel]).abs() < 1.0e-4));
        }
    }
    // What viewfuse wrote is in the scene's coordinates, whatever lies beside it; a .splat cannot say so.
    gaussians.write(&path, &SceneFrame::FILE).expect("a file");
    assert_eq!(GaussianFile::open(&path, &scene).expect("a file").scene, gaussians);
    let packed = folder.join("splat.spz");
    GaussianScene::check_place(&packed, &scene).expect("it says so");
    gaussians.write(&packed, &SceneFrame::FILE).expect("a file");
    let near = |file: GaussianFile| {
        let pairs = file.scene.gaussians.iter().zip(&gaussians.gaussians).collect::<Vec<_>>();
        pairs.iter().all(|(new, old)| Vec3::from(new.position).distance(Vec3::from(old.position)) < 1.0e-3)
    };
    assert!(near(GaussianFile::open(&packed, &scene).expect("a file")));
    let bare = folder.join("splat.splat");
    let refused = GaussianScene::check_place(&bare, &scene).expect_err("another world");
    assert!(refused.to_string().contains("dataparser_transforms.json"), "{refused}");
    GaussianScene::check_place(Path::new("splat.splat"), &scene).expect("no other world");
}

#[test]
fn bytes_behind_the_rows_are_told() {
    let (folder, gaussians) = (Folder::new(), drawn(3, 1, 2));
    let path = folder.join("longer.ply");
    gaussians.write(&path, &SceneFrame::FILE).expect("a file");
    let mut bytes = fs::read(&path).expect("a file");
    bytes.extend([0; 40]);
    fs::write(&path, bytes).expect("a file");
    let file = GaussianFile::read(&path, &SceneFrame::FILE).expect("a file");
    assert_eq!(file.scene, gaussians);
    assert!(file.notes.iter().any(|note| note.contains("40 bytes behind the rows are not read")), "{:?}", file.notes);
}

#[test]
fn properties_and_comments_mean_what_their_writers_mean() {
    let scene = drawn(3, 0, 2);
    let by = |to: &str| changed(&scene, &[("comment viewfuse\n", &format!("comment {to}\n"))]);
    for mip in ["SplatRenderMode: mip", "antialiased 1"] {
        assert!(by(mip).expect(mip).scene.is_antialiased);
    }
    assert!(!by("SplatRenderMode: default").expect("the default").scene.is_antialiased);
    for (comment, word) in [
        ("SplatRenderMode: banana", "this way of drawing is not known"),
        ("kernel_size 0.1", "dilated by 0.3"),
        ("ColorSpace: linear", "only sRGB"),
        ("SH order: coefficient-major", "\"SH order: coefficient-major\""),
    ] {
        match by(comment) {
            Err(told) => assert!(told.contains(":66: ") && told.contains(word), "{told}"),
            Ok(file) => assert!(file.notes[0].contains(word), "{:?}", file.notes),
        }
    }
    assert!(by("by nobody").expect("a file").notes[0].contains("\"by nobody\" is not known"));
    // mip-splatting's filter: wider, and as much fainter.
    let folder = Folder::new();
    let path = folder.join("a.ply");
    scene.write(&path, &SceneFrame::FILE).expect("a file");
    let (header, mut rows) = parts(&path);
    rows[12..16].copy_from_slice(&0.05_f32.to_le_bytes());
    let renamed = header.replacen("float nx", "float filter_3D", 1).replacen("comment viewfuse\n", "", 1);
    std::fs::write(&path, [renamed.as_bytes(), &rows].concat()).expect("a file");
    let filtered = read(&path).expect("a file");
    assert!(filtered.scene.is_antialiased, "its splats keep their integral");
    assert!(filtered.notes.iter().any(|note| note.contains("dilate by 0.1 (mip-splatting")), "{:?}", filtered.notes);
    let (new, old) = (filtered.scene.gaussians[0], scene.gaussians[0]);
    let mut share = 1.0;
    for (new, old) in new.log_scales.iter().zip(old.log_scales) {
        let (before, after) = (old.exp(), (old.exp().powi(2) + 0.05 * 0.05).sqrt());
        assert!((new.exp() - after).abs() < 1.0e-5);
        share *= before / after;
    }
    let opacity = viewfuse_core::gaussian::opacity;
    assert!((opacity(new.opacity) - share * opacity(old.opacity)).abs() < 1.0e-5);
    let strange = changed(&scene, &[("float nx", "float motion_0")]).expect("a file");
    assert!(strange.notes[0].contains("motion_0 (not known)"), "{:?}", strange.notes);
    let cloud = changed(
        &scene,
        &[
            ("opacity", "o"),
            ("scale_0", "a"),
            ("scale_1", "b"),
            ("scale_2", "c"),
            ("rot_0", "d"),
            ("rot_1", "e"),
            ("rot_2", "f"),
            ("rot_3", "g"),
        ],
    );
    assert!(cloud.expect_err("points").contains("a point cloud or a mesh, not Gaussians"));
}

#[test]
fn smaller_formats_are_written_and_read() {
    let scene = drawn(300, 1, 4);
    let folder = Folder::new();
    for (name, tolerance) in [("a.splat", 1.0e-6_f32), ("a.spz", 1.0e-5)] {
        let path = folder.join(name);
        scene.write(&path, &SceneFrame::FILE).expect("a file");
        // By content, whatever it is called.
        let renamed = folder.join("b.bin");
        std::fs::copy(&path, &renamed).expect("a copy");
        let found = read(&renamed).expect(name).scene;
        assert_eq!(found.gaussians.len(), 300);
        for (new, old) in found.gaussians.iter().zip(&scene.gaussians) {
            (0..3).for_each(|axis| assert!((new.position[axis] - old.position[axis]).abs() < tolerance, "{name}"));
            (0..3).for_each(|axis| assert!((new.log_scales[axis] - old.log_scales[axis]).abs() < 0.04, "{name}"));
            let (new, old) = (viewfuse_core::gaussian::axes(new.rotation), viewfuse_core::gaussian::axes(old.rotation));
            assert!((new[0] - old[0]).length() < 0.3, "{name}");
        }
        let far = SceneFrame { origin: DVec3::new(4.0e6, 1.0, 2.0), scale: 1.0 };
        // Other numbers are none.
        std::fs::write(
            &renamed,
            [[0.5_f32; 8]; 40].as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>(),
        )
        .expect("a file");
        read(&renamed).expect_err("no Gaussians");
        assert!(scene.write(&path, &far).expect_err(name).to_string().contains("state no origin"));
    }
    // Niantic's axes: y and z point the other way.
    let mut bytes = Vec::new();
    let file = std::fs::File::open(folder.join("a.spz")).expect("a file");
    GzDecoder::new(file).read_to_end(&mut bytes).expect("gzip");
    assert_eq!((&bytes[..4], bytes[12]), (&b"NGSP"[..], 1));
    let y = i32::from_le_bytes([0, bytes[19], bytes[20], bytes[21]]) >> 8;
    assert_eq!(y > 0, scene.gaussians[0].position[1] < 0.0);
    // Extensions stand before the arrays.
    bytes[14] = 2;
    let mut stream = GzEncoder::new(Vec::new(), Compression::fast());
    stream.write_all(&bytes).expect("gzip");
    let path = folder.join("extended.spz");
    std::fs::write(&path, stream.finish().expect("gzip")).expect("a file");
    assert!(read(&path).expect_err("extensions").contains("with extensions (flags 0x2)"));
    // The checksum is that of the arrays.
    let whole = fs::read(folder.join("a.spz")).expect("a file");
    for (name, end) in [("damaged.spz", 1), ("short.spz", 9)] {
        let mut bytes = whole.clone();
        let last = bytes.len() - end;
        match name {
            "short.spz" => bytes.truncate(last),
            _ => bytes[last - 4] ^= 1,
        }
        let path = folder.join(name);
        fs::write(&path, bytes).expect("a file");
        assert!(read(&path).expect_err(name).contains("damaged or ends too early"));
    }
    bytes[14] = 0;
    bytes.extend([7; 50]);
    let mut stream = GzEncoder::new(Vec::new(), Compression::fast());
    stream.write_all(&bytes).expect("gzip");
    let path = folder.join("longer.spz");
    fs::write(&path, stream.finish().expect("gzip")).expect("a file");
    let notes = read(&path).expect("a file").notes;
    assert!(notes.iter().any(|note| note.contains("50 bytes behind the arrays are not read")), "{notes:?}");
    for (name, bytes, word) in [
        ("a.sog", &b"PK\x03\x04"[..], ".sog of PlayCanvas"),
        ("a.ksplat", &b"\x00\x01\x00\x00"[..], ".ksplat"),
        ("a.splat", &[1; 33][..], "not a .splat"),
        ("a.spz", &b"\x1f\x8b\x08"[..], "not a readable .spz"),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, bytes).expect("a file");
        assert!(read(&path).expect_err(name).contains(word));
    }
}

/// In one direction a Gaussian may be as thin as it likes; where many are in two, the format's picture would be another.
#[test]
fn what_spz_has_no_room_for_is_said() {
    let folder = Folder::new();
    let mut scene = drawn(20, 0, 3);
    let mut write = |count: usize, log_scales: [f32; 3]| {
        scene.gaussians[..count].iter_mut().for_each(|gaussian| gaussian.log_scales = log_scales);
        scene.write(&folder.join("a.spz"), &SceneFrame::FILE).map_err(|error| error.to_string())
    };
    write(20, [-20.0, -3.0, -4.0]).expect("discs");
    let told = write(4, [-12.0, -11.0, -3.0]).expect_err("needles");
    assert!(told.contains("from 4.5e-5 to 370; 20 % of the Gaussians here are smaller or larger"), "{told}");
}

/// A .splat begins with the first coordinate, any of whose bytes a page, an archive or a .ply may begin with, too.
#[test]
fn a_splat_is_one_whatever_its_first_coordinate() {
    let folder = Folder::new();
    let path = folder.join("a.splat");
    for first in [*b"<p\x8a\x40", *b"\x1f\x8b\x08\x40", *b" \n<\x40", *b"ply\x40"] {
        let mut scene = drawn(20, 0, 3);
        scene.gaussians[0].position[0] = f32::from_le_bytes(first);
        scene.write(&path, &SceneFrame::FILE).expect("a file");
        let found = read(&path).unwrap_or_else(|error| panic!("{first:x?}: {error}")).scene;
        assert_eq!(found.gaussians[0].position[0].to_le_bytes(), first);
    }
}

/// One chunk as PlayCanvas packs it: the middle of each range, no rotation.
#[test]
fn compressed_ply_is_read() {
    let mut bytes = b"ply\nformat binary_little_endian 1.0\nelement chunk 1\n".to_vec();
    for end in ["min", "max"] {
        ["x", "y", "z"].iter().for_each(|axis| bytes.extend(format!("property float {end}_{axis}\n").bytes()));
    }
    for end in ["min", "max"] {
        ["x", "y", "z"].iter().for_each(|axis| bytes.extend(format!("property float {end}_scale_{axis}\n").bytes()));
    }
    bytes.extend(b"element vertex 1\nproperty uint packed_position\nproperty uint packed_rotation\n");
    bytes.extend(b"property uint packed_scale\nproperty uint packed_color\nend_header\n");
    [-1.0_f32, -2.0, -3.0, 1.0, 2.0, 3.0, -5.0, -5.0, -5.0, -3.0, -3.0, -3.0]
        .iter()
        .for_each(|v| bytes.extend(v.to_le_bytes()));
    let words = [2047_u32 << 21 | 2047, 1 << 30 | 1023 << 20 | 512 << 10 | 512, 0, 255 << 24 | 128];
    words.iter().for_each(|word| bytes.extend(word.to_le_bytes()));
    let folder = Folder::new();
    let path = folder.join("a.ply");
    std::fs::write(&path, bytes).expect("a file");
    let first = read(&path).expect("a file").scene.gaussians[0];
    assert_eq!((first.position, first.log_scales), ([1.0, -2.0, 3.0], [-5.0; 3]));
    let root = std::f32::consts::FRAC_1_SQRT_2;
    let close = |a: f32, b: f32| (a - b).abs() < 2.0e-3;
    // The greatest is x; w is at the end of its range.
    assert!(
        close(first.rotation[0], root) && close(first.rotation[1], root) && close(first.rotation[2], 0.0),
        "{first:?}"
    );
    assert!(close(first.f_dc[0], 0.5 / 0.282_094_8) && close(first.f_dc[1], -0.5 / 0.282_094_8), "{first:?}");
}

/// What strict readers demand of a header, by their documents and sources. `Err` is what they stumble over.
type Rule = fn(&[&str]) -> Result<(), String>;

fn need(is_so: bool, what: &str) -> Result<(), String> {
    if is_so { Ok(()) } else { Err(what.to_owned()) }
}

fn properties<'a>(lines: &[&'a str]) -> Vec<&'a str> {
    lines.iter().filter_map(|line| line.strip_prefix("property ")).collect()
}

/// SIBR (GaussianView.cpp): line 3 is the element's; rows are floats in the published order, with all 45 coefficients.
fn sibr(lines: &[&str]) -> Result<(), String> {
    need(lines[0] == "ply" && lines[2].starts_with("element vertex "), "the third line")?;
    let properties = properties(lines);
    need(properties.len() == 62 && properties.iter().all(|line| line.starts_with("float ")), "62 floats")?;
    need(properties[3] == "float nx" && properties[9] == "float f_rest_0" && properties[54] == "float opacity", "order")
}

/// INRIA's `load_ply`: 45 coefficients are asserted.
fn inria(lines: &[&str]) -> Result<(), String> {
    need(properties(lines).iter().filter(|line| line.contains(" f_rest_")).count() == 45, "45 f_rest")
}

/// antimatter15's converter: little endian, an element vertex; values are looked up by name.
fn antimatter(lines: &[&str]) -> Result<(), String> {
    need(lines.iter().any(|line| line.starts_with("element vertex ")), "vertex")?;
    ["scale_0", "rot_0", "f_dc_0", "opacity", "x"]
        .iter()
        .try_for_each(|name| need(lines.contains(&format!("property float {name}").as_str()), name))
}

/// gsplat.js (PLYLoader.ts): the header is in the first 10 KiB; every property is a float or an int.
fn gsplat(lines: &[&str]) -> Result<(), String> {
    need(lines.iter().map(|line| line.len() + 1).sum::<usize>() < 10 * 1024, "10 KiB")?;
    need(properties(lines).iter().all(|line| line.starts_with("float ") || line.starts_with("int ")), "types")
}

/// PlayCanvas and SuperSplat (the engine's ply.js, read-ply.ts of splat-transform): known words only, a text behind
/// `comment`, three words for an element and a property.
fn supersplat(lines: &[&str]) -> Result<(), String> {
    let is_read = |line: &&str| match line.split(' ').collect::<Vec<_>>()[..] {
        ["ply" | "end_header"] | ["format", ..] | ["comment", _, ..] => true,
        ["element", _, count] => count.parse::<usize>().is_ok(),
        ["property", "float", _] => true,
        _ => false,
    };
    need(lines.iter().all(is_read), "words")
}

/// mkkellogg's three.js (PlyParserUtils.js): the degree by the number of coefficients, counted in every line; the
/// format by words in every line, comments too.
fn three(lines: &[&str]) -> Result<(), String> {
    let comments = lines.iter().filter(|line| line.starts_with("comment"));
    let words = ["packed_", "f_rest_", "end_header", "element chunk"];
    need(!comments.into_iter().any(|line| words.iter().any(|word| line.contains(word))), "comments")?;
    let count = properties(lines).iter().filter(|line| line.contains(" f_rest_")).count();
    need([0, 9, 24, 45].contains(&count) && lines.last() == Some(&"end_header"), "degree")
}

const READERS: [Rule; 6] = [sibr, inria, antimatter, gsplat, supersplat, three];

#[test]
fn strict_readers_open_what_is_written() {
    let folder = Folder::new();
    let path = folder.join("a.ply");
    let far = SceneFrame { origin: DVec3::new(451_234.5, 5_213_456.25, 312.0), scale: 1.0 };
    for (degree, frame) in [(0, SceneFrame::FILE), (1, far), (3, far)] {
        let scene = drawn(9, degree, 3);
        scene.write(&path, &frame).expect("a file");
        let (header, _) = parts(&path);
        let lines: Vec<&str> = header.lines().collect();
        READERS.iter().for_each(|rule| rule(&lines).expect("a reader"));
        let found = GaussianScene::read(&path, &frame).expect("our own file");
        assert_eq!((found.degree, &found.f_rest), (degree, &scene.f_rest));
        let away =
            |index: usize| Vec3::from(found.gaussians[index].position) - Vec3::from(scene.gaussians[index].position);
        (0..9).for_each(|index| assert!(away(index).length() < 1.0e-6));
    }
    // As it was written before: what stumbles.
    let old = ["ply", "format binary_little_endian 1.0", "comment viewfuse", "element vertex 9", "property double x"];
    assert!(sibr(&old).is_err() && inria(&old).is_err() && antimatter(&old).is_err() && gsplat(&old).is_err());
}

/// What no reader takes is not written, in any format.
#[test]
fn what_cannot_be_read_back_is_refused() {
    let folder = Folder::new();
    let gaussian = Gaussian {
        position: [0.1; 3],
        log_scales: [-3.0; 3],
        rotation: [1.0, 0.0, 0.0, 0.0],
        opacity: 0.5,
        f_dc: [0.2; 3],
    };
    let scene = GaussianScene { gaussians: vec![gaussian; 3], degree: 0, f_rest: Vec::new(), is_antialiased: false };
    let mut wrong = [0, 1, 2, 3].map(|_| scene.clone());
    wrong[0].gaussians[1].position[2] = f32::NAN;
    wrong[1].gaussians[1].f_dc[0] = f32::INFINITY;
    wrong[2].degree = 9;
    (wrong[3].degree, wrong[3].f_rest) = (1, vec![f32::NAN; 27]);
    for name in ["a.ply", "a.splat", "a.spz"] {
        for (scene, part) in wrong.iter().zip(["Gaussian 1 ", "Gaussian 1 ", "degree 9", "coefficient 0 of f_rest"]) {
            let error = scene.write(&folder.file(name), &SceneFrame::FILE).expect_err(part).to_string();
            assert!(error.contains(part) && error.contains(name), "{name}: {error}");
            assert!(!folder.file(name).exists(), "{name}");
        }
        scene.write(&folder.file(name), &SceneFrame::FILE).expect(name);
    }
}

#[test]
fn no_gaussians_are_said() {
    let (folder, scene) = (Folder::new(), Scene::open("data/room").expect("the sample"));
    let path = folder.join("a.ply");
    GaussianScene::default().write(&path, &SceneFrame::FILE).expect("a file");
    let told = GaussianFile::open(&path, &scene).expect_err("nothing").to_string();
    assert!(told.ends_with("the file has no Gaussians: there is nothing to show"), "{told}");
}
