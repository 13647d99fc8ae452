//! Scene folders: what is written is what was asked for, whole or not at all.

use super::{camera, orbit, sphere};
use std::fs;
use std::path::Path;
use viewfuse::job::progress::Silent;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_lab::scenes::{WriteError, render, write_scene};
use viewfuse_tests::scenes::Folder;

/// Every pose file reads back as exactly the camera it was written from.
pub(crate) fn assert_poses(folder: &Path, cameras: &[Camera]) {
    assert_eq!(fs::read_dir(folder.join("pose")).expect("pose folder").count(), cameras.len());
    for (index, camera) in cameras.iter().enumerate() {
        let path = folder.join(format!("pose/{index:06}.txt"));
        let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert_eq!(text.lines().count(), 1, "{}", path.display());
        let numbers: Vec<f32> = text.split_whitespace().map(|word| word.parse().expect("a number")).collect();
        assert_eq!(numbers, camera.pose.to_opencv().as_flattened(), "{}", path.display());
    }
}

#[test]
fn a_scene_folder_appears_whole_and_is_never_overwritten() {
    let place = Folder::new();
    let folder = place.join("deep/scene");
    let cameras = orbit(16).spiral(3, [0.2, 0.8]).expect("cameras");
    write_scene(&folder, &sphere(), &cameras, 4, &Silent).expect("a scene");
    assert_poses(&folder, &cameras);
    let intrinsics = fs::read_to_string(folder.join("intrinsics.txt")).expect("intrinsics.txt");
    assert_eq!(intrinsics, "16. 8. 8. 0.\n0. 0. 0.\n1.\n16 16\n");
    let stored = image::open(folder.join("rgb/000002.png")).expect("the last picture").into_rgba8();
    assert_eq!(stored, render(&sphere(), &cameras[2]));
    let beside = fs::read_dir(place.join("deep")).expect("the parent").count();
    assert_eq!(beside, 1, "nothing but the scene is left");

    let refused = write_scene(&folder, &sphere(), &cameras[..1], 4, &Silent);
    assert!(matches!(refused, Err(WriteError::Exists { .. })), "{refused:?}");
    assert_poses(&folder, &cameras);
}

#[test]
fn scenes_that_the_layout_can_not_hold_are_refused_with_the_path() {
    let place = Folder::new();
    let folder = place.join("scene");
    let mut cameras = orbit(16).spiral(2, [0.2, 0.8]).expect("cameras");
    let no_views = write_scene(&folder, &sphere(), &[], 4, &Silent).expect_err("no views");
    assert!(matches!(no_views, WriteError::ViewCount { count: 0, .. }), "{no_views:?}");
    cameras[1].pinhole = orbit(32).pinhole;
    let mixed = write_scene(&folder, &sphere(), &cameras, 4, &Silent).expect_err("two sets of intrinsics");
    assert!(matches!(mixed, WriteError::Intrinsics { view: 1, .. }), "{mixed:?}");
    let pinhole = Pinhole::new([16.0, 17.0], [8.0, 8.0], 16, 16).expect("sound intrinsics");
    cameras.truncate(1);
    cameras[0].pinhole = pinhole;
    let oblong = write_scene(&folder, &sphere(), &cameras, 4, &Silent).expect_err("two focal lengths");
    assert!(matches!(oblong, WriteError::Intrinsics { view: 0, .. }), "{oblong:?}");
    let file = place.join("file");
    fs::write(&file, "").expect("a file");
    let blocked =
        write_scene(&file.join("scene"), &sphere(), &[camera(16)], 4, &Silent).expect_err("a file in the way");
    for error in [no_views, mixed, oblong, blocked] {
        let message = error.to_string();
        assert!(message.contains(&place.display().to_string()), "no path in: {message}");
    }
    assert_eq!(fs::read_dir(&place).expect("the folder").count(), 1, "only the file is there");
}
