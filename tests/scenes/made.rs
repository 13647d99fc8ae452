//! Small scenes in layouts of photogrammetry, made byte by byte. All cameras are that of [`scenes::WORLD_FROM_CAMERA`]
//! unless a test moves them; photographs are 16 x 12.

use viewfuse::scene::{Scene, SceneError};
use viewfuse_core::Vec3;
use viewfuse_tests::scenes::{Folder, POINT_WORLD};
pub(super) use viewfuse_tests::scenes::{npy, npy_of};

/// The rotation from world to camera, `w x y z`.
pub(super) const QUATERNION: [f64; 4] = [0.5, -0.5, -0.5, -0.5];
/// The translation from world to camera.
pub(super) const TRANSLATION: [f64; 3] = [-2.0, -3.0, -1.0];

pub(super) fn open(folder: &Folder) -> Scene {
    Scene::open(folder).unwrap_or_else(|error| panic!("{error}"))
}

pub(super) fn names(scene: &Scene) -> Vec<&str> {
    scene.views.iter().map(|view| view.name.as_str()).collect()
}

/// Where a view sees the point is where it must be, to 1e-4 of a pixel.
#[track_caller]
pub(super) fn assert_pixel(scene: &Scene, view: usize, expected: [f64; 2]) {
    let seen = scene.views[view].camera.project(Vec3::from_array(POINT_WORLD));
    assert!(seen.in_front && (f64::from(seen.depth) - 2.0).abs() < 1e-6, "{seen:?}");
    let error = (f64::from(seen.x) - expected[0]).abs().max((f64::from(seen.y) - expected[1]).abs());
    assert!(error < 1e-4, "{seen:?} instead of {expected:?}");
}

/// The error is one line that begins with the path in the folder and holds each of the parts.
#[track_caller]
pub(super) fn assert_message(error: &SceneError, folder: &Folder, begins: &str, parts: &[&str]) {
    let message = error.to_string();
    let relative = message.strip_prefix(&folder.display().to_string()).unwrap_or_default();
    assert!(relative.trim_start_matches('/').starts_with(begins), "{message:?} does not begin with {begins:?}");
    assert!(!message.contains('\n') && message.len() < 700, "{message:?}");
    for part in parts {
        assert!(message.contains(part), "{message:?} does not hold {part:?}");
    }
}

/// The scene in the folder is refused so.
#[track_caller]
pub(super) fn assert_refused(folder: &Folder, begins: &str, parts: &[&str]) {
    assert_message(&Scene::open(folder).expect_err("a bad scene"), folder, begins, parts);
}

/// A camera of COLMAP's: number, model's number and name, parameters; for images of 32 x 24.
pub(super) struct Camera(pub(super) u32, pub(super) u32, pub(super) &'static str, pub(super) Vec<f64>);

/// Focal lengths 20 and 24, centre (7.5, 6.5) for the photographs at half the size.
pub(super) fn pinhole() -> Camera {
    Camera(7, 1, "PINHOLE", vec![40.0, 48.0, 15.0, 13.0])
}

pub(super) fn cameras_text(cameras: &[Camera]) -> String {
    let line = |Camera(id, _, name, parameters): &Camera| {
        format!("{id} {name} 32 24 {}\n", viewfuse_tests::scenes::words(parameters))
    };
    format!("# a comment\n{}", cameras.iter().map(line).collect::<String>())
}

pub(super) fn cameras_binary(cameras: &[Camera]) -> Vec<u8> {
    let mut bytes = (cameras.len() as u64).to_le_bytes().to_vec();
    for Camera(id, model, _, parameters) in cameras {
        bytes.extend(id.to_le_bytes());
        bytes.extend(model.to_le_bytes());
        bytes.extend([32_u64, 24].into_iter().flat_map(u64::to_le_bytes));
        bytes.extend(parameters.iter().copied().flat_map(f64::to_le_bytes));
    }
    bytes
}

/// Images of COLMAP's: number, camera, name.
pub(super) const IMAGES: [(u32, u32, &str); 2] = [(11, 7, "b 10.png"), (12, 7, "b 2.png")];

pub(super) fn images_text(images: &[(u32, u32, &str)]) -> String {
    let numbers: Vec<f64> = QUATERNION.into_iter().chain(TRANSLATION).collect();
    let pose = viewfuse_tests::scenes::words(&numbers);
    let lines = |(id, camera, name): &(u32, u32, &str)| format!("{id} {pose} {camera} {name}\n1.5 2.5 -1 3 4 1\n");
    format!("# a comment\n{}", images.iter().map(lines).collect::<String>())
}

pub(super) fn images_binary(images: &[(u32, u32, &str)]) -> Vec<u8> {
    let mut bytes = (images.len() as u64).to_le_bytes().to_vec();
    for (id, camera, name) in images {
        bytes.extend(id.to_le_bytes());
        bytes.extend(QUATERNION.into_iter().chain(TRANSLATION).flat_map(f64::to_le_bytes));
        bytes.extend(camera.to_le_bytes());
        bytes.extend(name.bytes().chain([0]));
        bytes.extend(1_u64.to_le_bytes());
        bytes.extend([3.0_f64, 4.0].into_iter().flat_map(f64::to_le_bytes));
        bytes.extend(1_i64.to_le_bytes());
    }
    bytes
}

/// A point that both images saw, one of them twice, and one that a third image saw, which is not there.
pub(super) fn points_text() -> String {
    let [x, y, z] = POINT_WORLD;
    format!("# a comment\n1 {x} {y} {z} 10 20 30 0.25 12 0 11 0 12 1\n5 0 0 0 1 2 3 -1 99 0\n")
}

pub(super) fn points_binary() -> Vec<u8> {
    let mut bytes = 2_u64.to_le_bytes().to_vec();
    let mut point = |id: u64, position: [f64; 3], colour: [u8; 3], error: f64, track: &[[u32; 2]]| {
        bytes.extend(id.to_le_bytes());
        bytes.extend(position.into_iter().flat_map(f64::to_le_bytes));
        bytes.extend(colour);
        bytes.extend(error.to_le_bytes());
        bytes.extend((track.len() as u64).to_le_bytes());
        bytes.extend(track.iter().flatten().copied().flat_map(u32::to_le_bytes));
    };
    point(1, POINT_WORLD.map(f64::from), [10, 20, 30], 0.25, &[[12, 0], [11, 0], [12, 1]]);
    point(5, [0.0; 3], [1, 2, 3], -1.0, &[[99, 0]]);
    bytes
}

/// A binary model in `sparse/0` and photographs of half its size in `images`.
pub(super) fn colmap_binary() -> Folder {
    let folder = Folder::new();
    IMAGES.iter().for_each(|(_, _, name)| _ = folder.image(&format!("images/{name}"), 16, 12));
    folder.write("sparse/0/cameras.bin", cameras_binary(&[pinhole()]));
    folder.write("sparse/0/images.bin", images_binary(&IMAGES)).write("sparse/0/points3D.bin", points_binary());
    folder
}

/// The same as text.
pub(super) fn colmap_text() -> Folder {
    let folder = Folder::new();
    IMAGES.iter().for_each(|(_, _, name)| _ = folder.image(&format!("images/{name}"), 16, 12));
    folder.write("sparse/0/cameras.txt", cameras_text(&[pinhole()]));
    folder.write("sparse/0/images.txt", images_text(&IMAGES)).write("sparse/0/points3D.txt", points_text());
    folder
}

/// A row of `poses_bounds.npy` for photographs of 128 x 96 and a focal length of 160: at an eighth, 20.
pub(super) fn llff_row() -> [f64; 17] {
    // Axes down, right, backwards; centre; height, width, focal.
    [
        0.0, 0.0, -1.0, 1.0, 96.0, //
        0.0, 1.0, 0.0, 2.0, 128.0, //
        1.0, 0.0, 0.0, 3.0, 160.0, //
        0.5, 9.5,
    ]
}

/// Two photographs in `images_8`.
pub(super) fn llff() -> Folder {
    let folder = Folder::new();
    folder.image("images_8/a.png", 16, 12).image("images_8/b.png", 16, 12);
    folder.write("poses_bounds.npy", npy(&[2, 17], &[llff_row(), llff_row()].concat()));
    folder
}

/// The projection of focal lengths 20 and 24 and the principal point (7, 6) between centres of pixels: `K [R | t]`.
pub(super) const PROJECTION: [f64; 16] = {
    let (x, y, z) = ([0.0, 1.0, 0.0, -2.0], [0.0, 0.0, 1.0, -3.0], [1.0, 0.0, 0.0, -1.0]);
    let mut p = [0.0; 16];
    let mut i = 0;
    while i < 4 {
        p[i] = 20.0 * x[i] + 7.0 * z[i];
        p[4 + i] = 24.0 * y[i] + 6.0 * z[i];
        p[8 + i] = z[i];
        i += 1;
    }
    p[15] = 1.0;
    p
};

/// A `cameras_sphere.npz` of these entries.
pub(super) fn npz(entries: &[(String, Vec<u8>)], deflated: bool) -> Vec<u8> {
    use std::io::Write;
    use zip::write::SimpleFileOptions;
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let method = if deflated { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
    for (name, bytes) in entries {
        archive.start_file(name.as_str(), SimpleFileOptions::default().compression_method(method)).expect("an entry");
        archive.write_all(bytes).expect("an entry");
    }
    archive.finish().expect("an archive").into_inner()
}

/// Photographs 3 and 5 of four that the archive knows; the unit sphere has radius 1/2 around (3, 2, 3).
pub(super) fn neus() -> Folder {
    let folder = Folder::new();
    folder.image("image/003.png", 16, 12).image("image/005.png", 16, 12).image("mask/03.png", 16, 12);
    folder.write("cameras_sphere.npz", npz(&neus_entries(), false));
    folder
}

pub(super) fn neus_entries() -> Vec<(String, Vec<u8>)> {
    let sphere = [0.5, 0.0, 0.0, 3.0, 0.0, 0.5, 0.0, 2.0, 0.0, 0.0, 0.5, 3.0, 0.0, 0.0, 0.0, 1.0];
    // A projection means the same at any scale and sign.
    let negative = PROJECTION.map(|entry| -3.0 * entry);
    let mut entries = Vec::new();
    for number in [2, 3, 4, 5] {
        let projection = if number == 5 { negative } else { PROJECTION };
        entries.push((format!("world_mat_{number}.npy"), npy(&[4, 4], &projection)));
        entries.push((format!("scale_mat_{number}.npy"), npy(&[4, 4], &sphere)));
        entries.push((format!("world_mat_inv_{number}.npy"), b"not looked at".to_vec()));
    }
    entries
}
