//! Scenes written out in every layout that can hold them, and read back the same.

use super::made::*;
use serde_json::json;
use viewfuse::job::progress::{Progress, Silent};
use viewfuse::scene::write::{Layout, WriteSceneError, Written, write};
use viewfuse::scene::{Scene, Split, View};
use viewfuse_tests::scenes::{self, Folder};

fn written(scene: &Scene, layout: Layout) -> (Folder, Scene, Written) {
    let folder = Folder::new();
    let path = folder.path().join("out");
    let written = write(scene, layout, &path, &Silent).unwrap_or_else(|error| panic!("{error}"));
    let read = Scene::open(&path).unwrap_or_else(|error| panic!("{layout}: {error}"));
    assert_eq!(read.layout, layout.to_string());
    assert_eq!(read.warnings, Vec::<String>::new());
    (folder, read, written)
}

/// The cameras are the same to rounding in f32, the photographs to the bit.
#[track_caller]
fn assert_same(layout: Layout, scene: &Scene, read: &Scene) {
    assert_eq!(names(read), names(scene), "{layout}");
    for (index, (a, b)) in scene.views.iter().zip(&read.views).enumerate() {
        let numbers = |view: &View| {
            let pinhole = view.camera.pinhole;
            let pose = view.camera.pose.to_opencv().into_iter().flatten();
            pose.chain(pinhole.focal()).chain(pinhole.principal()).collect::<Vec<f32>>()
        };
        for (a, b) in numbers(a).into_iter().zip(numbers(b)) {
            assert!((a - b).abs() <= 2e-7 * (1.0 + a.abs()), "{layout}: {a} and {b}");
        }
        assert_eq!(a.image.is_some(), b.image.is_some(), "{layout}");
        if a.image.is_some() {
            assert_eq!(scene.photograph(index).expect("one"), read.photograph(index).expect("the other"), "{layout}");
        }
    }
}

#[test]
fn every_layout_that_can_hold_a_scene_gives_it_back() {
    // One focal length, the principal point in the centre, near and far: all layouts hold it.
    let folder = llff();
    let mut second = llff_row();
    (second[3], second[8]) = (1.25, 2.5);
    folder.write("poses_bounds.npy", npy(&[2, 17], &[llff_row(), second].concat()));
    let scene = open(&folder);
    for layout in Layout::ALL {
        let (_folder, read, written) = written(&scene, layout);
        assert_same(layout, &scene, &read);
        assert_eq!(written.photograph_count, 2);
        let kept = read.views[1].near_far == Some([0.5, 9.5]);
        assert_eq!(kept, layout == Layout::Llff);
        assert_eq!(written.left_out.iter().any(|line| line.contains("near and far depths of 2 views")), !kept);
    }
}

#[test]
fn points_and_poses_without_photographs() {
    let folder = colmap_text();
    let scene = open(&folder);
    let (_folder, read, written) = self::written(&scene, Layout::Colmap);
    assert_same(Layout::Colmap, &scene, &read);
    assert_eq!((&read.points, written.left_out), (&scene.points, vec![]));
    let (_folder, read, written) = self::written(&scene, Layout::Transforms);
    assert_same(Layout::Transforms, &scene, &read);
    assert_eq!((read.points.len(), written.left_out), (0, vec!["2 reconstructed points".to_owned()]));

    let folder = scenes::srn();
    let scene = open(&folder);
    let (_folder, read, _) = self::written(&scene, Layout::Srn);
    assert_same(Layout::Srn, &scene, &read);
}

/// A photograph of its own at each place, through a lens and with a mask.
fn through_a_lens(model: &str, coefficient: f64) -> Folder {
    let folder = Folder::new();
    let pixels = image::RgbImage::from_fn(16, 12, |x, y| image::Rgb([15 * x as u8, 20 * y as u8, 77]));
    pixels.save(folder.file("images/1.png")).expect("a photograph");
    let mask = image::GrayImage::from_fn(16, 12, |x, _| image::Luma([if x < 8 { 0 } else { 255 }]));
    mask.save(folder.file("masks/1.png")).expect("a mask");
    let transforms = json!({
        "camera_model": model, "k1": coefficient, "k2": 0.01, "k3": 0.002, "fl_x": 20, "fl_y": 20, "cx": 8, "cy": 6,
        "w": 16, "h": 12, "train_filenames": ["images/1.png"],
        "frames": [{ "file_path": "images/1.png", "transform_matrix": scenes::opengl_matrix() }],
    });
    folder.write("transforms.json", transforms.to_string());
    folder
}

#[test]
fn lenses_and_masks() {
    for (model, coefficient) in [("OPENCV", 0.15), ("FULL_OPENCV", -0.1), ("OPENCV_FISHEYE", 0.05)] {
        let folder = through_a_lens(model, coefficient);
        let scene = open(&folder);
        assert!(scene.views[0].lens.is_some() && scene.views[0].mask.is_some());
        for layout in [Layout::Transforms, Layout::Colmap] {
            let (_folder, read, written) = written(&scene, layout);
            assert_same(layout, &scene, &read);
            assert_eq!(read.views[0].lens, scene.views[0].lens);
            let split = (layout == Layout::Transforms).then_some(Split::Train);
            assert_eq!((read.views[0].split, written.left_out.is_empty()), (split, split.is_some()));
        }
        // Others hold the pinhole's picture.
        let (_folder, read, written) = written(&scene, Layout::Srn);
        let (before, after) = (scene.photograph(0).expect("one"), read.photograph(0).expect("the other"));
        assert_eq!((before.pixels, before.has_alpha), (after.pixels, after.has_alpha));
        assert!(read.views[0].lens.is_none() && read.views[0].mask.is_none());
        assert!(written.left_out.iter().any(|line| line.contains("the lens of 1 photographs")));
    }
}

#[test]
fn what_a_layout_cannot_hold_is_refused_and_leaves_nothing() {
    let folder = Folder::new();
    let path = folder.path().join("out");
    let refused = |scene: &Scene, layout: Layout, part: &str| {
        let error = write(scene, layout, &path, &Silent).expect_err("unfit");
        assert!(matches!(error, WriteSceneError::Unfit { .. }), "{error}");
        let message = error.to_string();
        assert!(message.contains(part) && message.contains(&format!("the layout {layout} cannot hold")), "{message}");
        assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    };
    let (srn, colmap) = (scenes::srn(), colmap_text());
    for layout in [Layout::Transforms, Layout::Colmap, Layout::Middlebury, Layout::Llff] {
        refused(&open(&srn), layout, "view \"target_1\" is a pose without a photograph");
    }
    refused(&open(&colmap), Layout::Srn, "two focal lengths, 20 and 24");
    refused(&open(&colmap), Layout::Middlebury, "has a blank in it");
    refused(&open(&colmap), Layout::Llff, "not in the order of their names");
    refused(&open(&scenes::middlebury()), Layout::Llff, "two focal lengths");
    // A photograph that cannot be read leaves nothing either.
    let broken = through_a_lens("OPENCV", 0.1);
    let scene = open(&broken);
    broken.write("images/1.png", "no image");
    assert!(matches!(write(&scene, Layout::Srn, &path, &Silent), Err(WriteSceneError::Scene(_))));
    struct Stopped;
    impl Progress for Stopped {
        fn is_cancelled(&self) -> bool {
            true
        }
    }
    let scene = open(&colmap);
    assert!(matches!(write(&scene, Layout::Colmap, &path, &Stopped), Err(WriteSceneError::Interrupted(_))));
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 0);
    // What is there stays; an empty folder is filled.
    folder.write("out/mine.txt", "mine");
    assert!(matches!(write(&scene, Layout::Colmap, &path, &Silent), Err(WriteSceneError::Occupied { .. })));
    folder.remove("out/mine.txt");
    assert_eq!(write(&scene, Layout::Colmap, &path, &Silent).expect("written").photograph_count, 2);
    for layout in Layout::ALL {
        assert_eq!(layout.to_string().parse(), Ok(layout));
    }
    assert!("nerf".parse::<Layout>().expect_err("none").to_string().contains("transforms, colmap, srn"));
}
