//! Layouts with NumPy's arrays: LLFF and NeuS, and the arrays' own forms; what is written of nothing.

use super::made::*;
use image::{GrayImage, Luma};
use viewfuse::job::progress::Silent;
use viewfuse::output::depth::{DepthFormat, write_depth};
use viewfuse::output::rate::FrameRate;
use viewfuse::output::video::{VideoError, VideoFormat, VideoWriter};
use viewfuse::output::webp::stated_size;
use viewfuse::scene::Scene;
use viewfuse::scene::photographs::{Album, BackgroundChoice};
use viewfuse_core::Vec3;
use viewfuse_tests::scenes::Folder;

#[test]
fn llff_at_an_eighth() {
    let folder = llff();
    let scene = open(&folder);
    assert_eq!((scene.layout, names(&scene)), ("llff", vec!["a", "b"]));
    for view in 0..2 {
        assert_pixel(&scene, view, [8.0 + 5.0, 6.0 - 2.5]);
        assert_eq!(scene.views[view].near_far, Some([0.5, 9.5]));
    }
    let file = Scene::open(folder.path().join("poses_bounds.npy")).expect("the file itself");
    assert_eq!(file.views, scene.views);
}

#[test]
fn the_largest_whole_folder_of_photographs_is_taken() {
    let folder = llff();
    for (name, scale) in [("images_4", 2), ("images", 8)] {
        for image in ["a.png", "b.png"] {
            folder.image(&format!("{name}/{image}"), 16 * scale, 12 * scale);
        }
        assert_eq!(open(&folder).views[0].camera.pinhole.width(), 16 * scale);
    }
    // A folder that is not whole is passed over.
    folder.remove("images/b.png");
    let scene = open(&folder);
    assert_eq!(scene.views[0].camera.pinhole.width(), 32);
    let told =
        |warning: &String| warning.contains("images: 1 photographs for the 2 rows") && warning.contains("images_4");
    assert!(scene.warnings.iter().any(told), "{:?}", scene.warnings);
    folder.remove("images_4/b.png").remove("images_8/b.png");
    assert_refused(&folder, "images: found 1 photographs (rows of poses_bounds.npy) instead of 2", &[]);
    let folder = llff();
    folder.remove("images_8/a.png").remove("images_8/b.png");
    assert_refused(&folder, ": the scene has no photographs", &["images_8"]);
}

#[test]
fn llff_with_the_model_that_it_was_made_from() {
    let folder = llff();
    folder
        .write("sparse/0/cameras.bin", cameras_binary(&[pinhole()]))
        .write("sparse/0/images.bin", images_binary(&IMAGES));
    folder.write("sparse/0/points3D.bin", points_binary());
    let scene = open(&folder);
    assert_eq!((scene.layout, scene.points.len(), scene.warnings.len()), ("llff", 2, 0));
    // By character, "b 10" stands before "b 2": image 11 is the first row.
    assert_eq!((scene.points[0].error, &scene.points[0].views[..]), (Some(0.25), &[0, 1][..]));
    // Where photographs have the names of the model's images, they have their places, too.
    folder.remove("images_8/a.png").remove("images_8/b.png");
    folder.image("images_8/b 10.png", 16, 12).image("images_8/b 2.png", 16, 12);
    assert_eq!(names(&open(&folder)), ["b 10", "b 2"]);
    folder.remove("images_8/b 10.png").image("images_8/z.png", 16, 12);
    let parts = ["row 0, of 'b 10' by the COLMAP model beside it, and the photograph 'b 2' in its place contradict"];
    assert_refused(&folder, "poses_bounds.npy: ", &parts);
    folder.remove("images_8/b 2.png").remove("images_8/z.png");
    // Numbered anew, all by the same number.
    let one = [(11, 7, "1.png"), (12, 7, "2.png")];
    folder.write("sparse/0/images.bin", images_binary(&one));
    folder.image("images_8/0.png", 16, 12).image("images_8/1.png", 16, 12);
    assert_eq!(names(&open(&folder)), ["0", "1"]);
    folder.write("sparse/0/images.bin", images_binary(&IMAGES));
    folder.remove("images_8/0.png").remove("images_8/1.png");
    folder.image("images_8/a.png", 16, 12).image("images_8/b.png", 16, 12);
    // Another model, or a damaged one, costs the points and a warning.
    folder.write("sparse/0/images.bin", images_binary(&IMAGES[..1]));
    let other = open(&folder);
    assert!(other.points.is_empty() && other.warnings[0].contains("are not the images of the COLMAP model"));
    folder.write("sparse/0/images.bin", [0; 9]);
    let damaged = open(&folder);
    assert!(damaged.points.is_empty() && damaged.warnings[0].contains("images.bin: byte 8: 1 bytes are left over"));
    assert_eq!(damaged.views, scene.views);
}

#[test]
fn arrays_have_several_forms() {
    let rows = [llff_row(), llff_row()].concat();
    let single: Vec<u8> = rows.iter().flat_map(|number| (*number as f32).to_le_bytes()).collect();
    let columns: Vec<u8> =
        (0..17).flat_map(|column| [rows[column], rows[17 + column]]).flat_map(f64::to_le_bytes).collect();
    let mut version_2 = npy(&[2, 17], &rows);
    version_2[6] = 2;
    version_2.splice(10..10, [0, 0]);
    for bytes in [npy_of("<f4", false, &[2, 17], &single), npy_of("<f8", true, &[2, 17], &columns), version_2] {
        let folder = llff();
        folder.write("poses_bounds.npy", bytes);
        assert_pixel(&open(&folder), 1, [13.0, 3.5]);
    }
}

#[test]
fn damaged_arrays_are_told() {
    let rows = [llff_row(), llff_row()].concat();
    let refused = |bytes: Vec<u8>, parts: &[&str]| {
        let folder = llff();
        folder.write("poses_bounds.npy", bytes);
        assert_refused(&folder, "poses_bounds.npy: ", parts);
    };
    let whole = npy(&[2, 17], &rows);
    refused(whole[..whole.len() - 1].to_vec(), &["ends too early"]);
    refused(whole[..9].to_vec(), &["ends too early"]);
    refused(b"PK\x03\x04".to_vec(), &["does not begin with"]);
    refused(npy_of("<i8", false, &[2, 17], &[0; 272]), &["\"<i8\"", "<f8"]);
    refused(npy_of(">f8", false, &[2, 17], &[0; 272]), &["\">f8\""]);
    refused(npy(&[34], &rows), &["found 34 numbers in a row instead of 17"]);
    refused(npy(&[1 << 40, 1 << 40], &rows), &["ends too early"]);
    let mut version = whole.clone();
    version[6] = 9;
    refused(version, &["version 9"]);
    let mut nan = rows.clone();
    nan[20] = f64::NAN;
    refused(npy(&[2, 17], &nan), &["element 20 is NaN"]);
    let with = |index: usize, value: f64| {
        let mut rows = rows.clone();
        rows[17 + index] = value;
        npy(&[2, 17], &rows)
    };
    refused(with(15, -1.0), &["row 1: near -1 and far 9.5"]);
    refused(with(4, 96.5), &["row 1: image size 128 x 96.5"]);
    refused(with(14, 0.0), &["row 1: focal lengths 0"]);
    refused(with(0, 0.5), &["row 1: not a camera pose"]);
}

#[test]
fn neus_by_the_numbers_of_the_names() {
    let folder = neus();
    for deflated in [false, true] {
        folder.write("cameras_sphere.npz", npz(&neus_entries(), deflated));
        let scene = open(&folder);
        assert_eq!((scene.layout, names(&scene)), ("neus", vec!["003", "005"]));
        for view in &scene.views {
            // In the unit sphere's world: twice as large, around (3, 2, 3).
            let seen = view.camera.project(Vec3::new(0.0, 1.0, -0.5));
            assert!((seen.x - 12.5).abs() < 1e-4 && (seen.y - 3.5).abs() < 1e-4, "{seen:?}");
            assert!((seen.depth - 4.0).abs() < 1e-5, "{seen:?}");
            assert!(view.camera.pose.centre_world().distance(Vec3::new(-4.0, 0.0, 0.0)) < 1e-6);
            assert_eq!(view.near_far, Some([3.0, 5.0]));
        }
        assert_eq!(scene.views[0].mask, Some(folder.path().join("mask/03.png")));
        assert_eq!(scene.views[1].mask, None);
        assert!(scene.warnings.iter().any(|warning| warning.contains("2 of 4 photographs")), "{:?}", scene.warnings);
    }
}

#[test]
fn neus_by_position_and_without_a_sphere() {
    let folder = neus();
    folder.image("image/101.png", 16, 12).image("image/102.png", 16, 12);
    let entries: Vec<_> = neus_entries().into_iter().filter(|(name, _)| name.starts_with("world_mat_")).collect();
    folder.write("cameras_sphere.npz", npz(&entries, false));
    let scene = open(&folder);
    assert_eq!((names(&scene), scene.views[0].near_far), (vec!["003", "005", "101", "102"], None));
    assert_pixel(&scene, 3, [12.5, 3.5]);
    folder.remove("image/102.png");
    assert_refused(&folder, "cameras_sphere.npz: found 4 matrices world_mat_N", &["instead of 3"]);
}

/// Photographs that are numbered from 1 and of which the last was removed have the matrix of the one before.
#[test]
fn neus_that_lacks_the_first_number_is_doubtful() {
    let folder = neus();
    let told = |folder: &Folder| {
        let warnings = open(folder).warnings;
        warnings.iter().any(|warning| warning.contains("where names count from 1, each photograph has the next one's"))
    };
    assert!(!told(&folder), "some of many");
    let numbers = [2, 3, 4, 5];
    folder.remove("image/003.png").remove("image/005.png");
    numbers[1..].iter().for_each(|number| _ = folder.image(&format!("image/{number:03}.png"), 16, 12));
    assert!(told(&folder));
    folder.image("image/002.png", 16, 12);
    assert!(!told(&folder), "each has its matrix");
}

/// The sphere is the object's: photographs without masks show more.
#[test]
fn a_sphere_bounds_masked_photographs_alone() {
    let near_far = |folder: &Folder| {
        let (scene, views) = (open(folder), [0, 1]);
        let album = Album::open(&scene, views, &Silent).expect("photographs");
        album.sources(&views, 16, BackgroundChoice::Auto, &Silent).expect("sources").near_far
    };
    let folder = neus();
    let whole = GrayImage::from_pixel(16, 12, Luma([255]));
    for name in ["mask/03.png", "mask/05.png"] {
        let mut mask = whole.clone();
        mask.put_pixel(0, 0, Luma([0]));
        mask.save(folder.file(name)).expect("a mask");
    }
    assert!(near_far(&folder).is_some(), "the object is cut out");
    folder.remove("mask/03.png").remove("mask/05.png");
    assert_eq!(near_far(&folder), None);
    assert!(open(&folder).views[0].near_far.is_some(), "they are of the layout all the same");
}

#[test]
fn damaged_archives_are_told() {
    let refused = |entries: &[(String, Vec<u8>)], begins: &str, parts: &[&str]| {
        let folder = neus();
        folder.write("cameras_sphere.npz", npz(entries, false));
        assert_refused(&folder, &format!("cameras_sphere.npz: {begins}"), parts);
    };
    let mut entries = neus_entries();
    entries[3].1 = npy(&[4, 4], &[0.0; 16]);
    refused(&entries, "world_mat_3: the projection is singular", &[]);
    let mut skewed = PROJECTION;
    for column in 0..4 {
        skewed[column] += 0.5 * [0.0, 0.0, 1.0, -3.0][column];
    }
    entries[3].1 = npy(&[4, 4], &skewed);
    refused(&entries, "world_mat_3: the skew 0.5", &[]);
    entries[3].1 = npy(&[2, 4], &[1.0; 8]);
    refused(&entries, "world_mat_3: found 8 numbers (4 x 4) instead of 16", &[]);
    entries[3].1 = b"\x93NUMPY".to_vec();
    refused(&entries, "world_mat_3: not a readable NumPy array", &["ends too early"]);
    refused(&[("other.npy".to_owned(), Vec::new())], "the scene has no photographs", &["world_mat_0"]);
    let folder = neus();
    folder.write("cameras_sphere.npz", "no archive");
    assert_refused(&folder, "cameras_sphere.npz: not a readable zip archive", &[]);
}

/// A header of a shape without its numbers would be a file that nobody reads.
#[test]
fn depths_are_one_a_pixel() {
    let folder = Folder::new();
    for format in DepthFormat::ALL {
        let path = folder.join("depth");
        for count in [0, 15, 100] {
            let error = write_depth(&path, format, &vec![1.0; count], [4, 4]).expect_err("not 16").to_string();
            assert!(error.contains(&format!("{count} depths for 4x4 pixels")) && !path.exists(), "{error}");
        }
        write_depth(&path, format, &[1.0; 16], [4, 4]).expect("one a pixel");
        std::fs::remove_file(&path).expect("it was written");
    }
}

/// Sizes in a WebP file have 32 bits.
#[test]
fn a_webp_of_four_gib_is_none() {
    const HEAD: u64 = 36;
    let stated = |frame_bytes: u64| stated_size(frame_bytes).ok();
    let most = (1 << 32) - 10 - HEAD;
    assert_eq!((stated(0), stated(most)), (Some(36), Some(u32::MAX - 9)));
    for frame_bytes in [most + 1, most + 10, 1 << 33, u64::MAX] {
        assert_eq!(stated(frame_bytes), None, "{frame_bytes}");
    }
}

#[test]
fn a_video_of_no_frames_is_none() {
    let folder = Folder::new();
    for format in [VideoFormat::Webp, VideoFormat::Gif, VideoFormat::Y4m] {
        let path = folder.join(format!("video.{format}"));
        let video = VideoWriter::begin(&path, format, [4, 4], FrameRate::DEFAULT, [0; 3]).expect("a video");
        assert!(matches!(video.finish(&Silent), Err(VideoError::NoFrames(_))), "{format}");
        assert!(!path.exists(), "{format}");
    }
}
