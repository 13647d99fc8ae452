//! Each layout is recognised, and a known point lands on the pixel that follows by hand.
//!
//! The camera sees the point at (0.5, -0.25, 2): the pixel is `focal * (0.25, -0.125) + principal`.

use super::made::{assert_pixel, assert_refused, names, open};
use serde_json::json;
use viewfuse::scene::{ImageFault, Scene, SceneFault, Split};
use viewfuse_tests::scenes::{self, Folder};

#[test]
fn srn_folder() {
    let scene = open(&scenes::srn());
    assert_eq!(scene.layout, "srn");
    assert_eq!(names(&scene), ["2", "10", "target_1"]);
    assert_eq!(scene.views.iter().map(|view| view.image.is_some()).collect::<Vec<_>>(), [true, true, false]);
    for view in 0..3 {
        assert_pixel(&scene, view, [8.0 + 5.0, 6.0 - 2.5]);
    }
}

#[test]
fn srn_photographs_at_another_scale() {
    let folder = scenes::srn();
    folder.write("intrinsics.txt", "40. 17. 11. 0.\n0. 0. 0.\n0.5\n1.\n24 32\n");
    let scene = open(&folder);
    // Half of everything, for the target pose too.
    assert_pixel(&scene, 0, [8.5 + 5.0, 5.5 - 2.5]);
    assert_pixel(&scene, 2, [8.5 + 5.0, 5.5 - 2.5]);
    assert_eq!((scene.views[2].camera.pinhole.width(), scene.views[2].camera.pinhole.height()), (16, 12));
}

#[test]
fn srn_pose_on_four_lines_and_world_to_camera() {
    let folder = scenes::srn();
    let by_row: Vec<String> = scenes::WORLD_FROM_CAMERA.chunks(4).map(scenes::words).collect();
    folder.write("pose/2.txt", by_row.join("\r\n") + "\r\n\r\n");
    assert_pixel(&open(&folder), 0, [13.0, 3.5]);

    let inverse = "0 1 0 -2  0 0 1 -3  1 0 0 -1  0 0 0 1";
    for name in ["pose/2.txt", "pose/10.txt", "target_pose/1.txt"] {
        folder.write(name, inverse);
    }
    folder.write("intrinsics.txt", "20. 8. 6.\n0. 0. 0.\n0.\n1.\n12 16\n1\n");
    for view in 0..3 {
        assert_pixel(&open(&folder), view, [13.0, 3.5]);
    }
}

#[test]
fn nsvf_intrinsics() {
    let folder = Folder::new();
    for name in ["0_train_0001", "1_val_0002", "2_test_0010"] {
        folder.image(&format!("rgb/{name}.png"), 16, 12);
        folder.write(&format!("pose/{name}.txt"), scenes::words(&scenes::WORLD_FROM_CAMERA));
    }
    folder.write("bbox.txt", "-1 -1 -1 1 1 1 0.1\n");
    let rows = ["20 0 7.5", "0 24 6.5", "0 0 1"];
    let wide = rows.map(|row| format!("{row} 0")).join("\n") + "\n0 0 0 1\n";
    for text in [wide.clone(), wide.replace('\n', " "), rows.join("\n"), rows.join(" ")] {
        folder.write("intrinsics.txt", &text);
        let scene = open(&folder);
        assert_pixel(&scene, 2, [7.5 + 5.0, 6.5 - 3.0]);
        let splits: Vec<_> = scene.views.iter().map(|view| view.split).collect();
        assert_eq!(splits, [Some(Split::Train), Some(Split::Validation), Some(Split::Test)]);
        assert!(scene.conventions.len() == 2 && scene.conventions[0].contains("NSVF"), "{:?}", scene.conventions);
        assert!(scene.unused.len() == 1 && scene.unused[0].ends_with(": bbox.txt"), "{:?}", scene.unused);
    }
    for (from, to, said) in [("20 0", "20 0.5", "the skew 0.5"), ("0 0 0 1", "0 0 0 2", "the form fx 0 cx")] {
        folder.write("intrinsics.txt", wide.replace(from, to));
        let error = Scene::open(&folder).expect_err("no K").to_string();
        assert!(error.contains("intrinsics.txt:1: ") && error.contains(said), "{error}");
    }
}

#[test]
fn blender_transforms() {
    let folder = Folder::new();
    // A focal length of 20 at a width of 16.
    let angle = 2.0 * (8.0f64 / 20.0).atan();
    let frame = json!({ "file_path": "./train/r_0", "rotation": 0.01, "transform_matrix": scenes::opengl_matrix() });
    folder.image("train/r_0.png", 16, 12);
    folder.write("transforms_train.json", json!({ "camera_angle_x": angle, "frames": [frame] }).to_string());
    let scene = open(&folder);
    assert_eq!((scene.layout, names(&scene)), ("transforms", vec!["r_0"]));
    assert_pixel(&scene, 0, [8.0 + 5.0, 6.0 - 2.5]);
}

#[test]
fn instant_ngp_transforms() {
    let folder = scenes::transforms_folder(&scenes::transforms());
    assert_pixel(&open(&folder), 0, [7.5 + 5.0, 6.5 - 3.0]);
    let file = Scene::open(folder.join("transforms.json")).expect("the file itself");
    assert_eq!(file.views, open(&folder).views);

    // A photograph of half the size, rounded down as resampling tools do.
    let mut halved = scenes::transforms();
    (halved["w"], halved["h"]) = (json!(33), json!(25));
    assert_pixel(&open(&scenes::transforms_folder(&halved)), 0, [12.5 * 16.0 / 33.0, 3.5 * 12.0 / 25.0]);
}

#[test]
fn opening_angles_give_both_focal_lengths() {
    let mut transforms = scenes::transforms();
    let top = transforms.as_object_mut().expect("an object");
    top.retain(|key, _| key == "frames");
    top.insert("camera_angle_x".into(), json!(2.0 * (8.0f64 / 20.0).atan()));
    top.insert("camera_angle_y".into(), json!(2.0 * (6.0f64 / 24.0).atan()));
    assert_pixel(&open(&scenes::transforms_folder(&transforms)), 0, [8.0 + 5.0, 6.0 - 3.0]);
}

#[test]
fn nerfstudio_transforms() {
    let mut transforms = scenes::transforms();
    transforms["camera_model"] = json!("OPENCV");
    transforms["applied_transform"] = json!([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]]);
    transforms["ply_file_path"] = json!("sparse_pc.ply");
    let frame = transforms["frames"][0].as_object_mut().expect("a frame");
    // A frame's own numbers win over those at the top.
    for (key, value) in [("fl_x", 40.0), ("fl_y", 48.0), ("cx", 8.0), ("cy", 6.0), ("w", 16.0), ("k3", 0.0)] {
        frame.insert(key.into(), json!(value));
    }
    let scene = open(&scenes::transforms_folder(&transforms));
    assert_pixel(&scene, 0, [8.0 + 10.0, 6.0 - 6.0]);
}

#[test]
fn middlebury_list() {
    let folder = scenes::middlebury();
    let scene = open(&folder);
    assert_eq!((scene.layout, names(&scene)), ("middlebury", vec!["toy0001", "toy0002"]));
    // Half a pixel more than K says: there, (0, 0) is a pixel's centre.
    assert_pixel(&scene, 1, [7.5 + 5.0, 5.5 - 3.0]);
    let list = Scene::open(folder.join("toy_par.txt")).expect("the list itself");
    assert_eq!(list.views, scene.views);
}

#[test]
fn a_view_is_found_by_name_or_by_its_number() {
    let scene = open(&scenes::middlebury());
    assert_eq!(scene.view_named("toy0002"), Some(1));
    assert_eq!(scene.view_named("2"), Some(1));
    assert_eq!(["0001", "0", "#0", "#1"].map(|text| scene.view_named(text)), [Some(0), Some(0), Some(0), Some(1)]);
    // The number of one and the index of the other.
    assert_eq!((scene.views_meant("1"), scene.view_named("1")), (vec![0, 1], None));
    let error = viewfuse::scene::few_shot::view_list(&scene, "2,1").expect_err("two views").to_string();
    let said = "'1' may be the view 'toy0001' (index 0) or 'toy0002' (index 1): write the name, or the index as '#0'";
    assert!(error.ends_with(said), "{error}");
    for nobody in ["3", "", "toy", "toy2", "-1", "+1", "#2", "##0", "1.0", "99999999999999999999999999"] {
        assert!(scene.views_meant(nobody).is_empty(), "{nobody}");
    }

    let folder = scenes::srn();
    let scene = open(&folder);
    assert_eq!(
        (scene.view_named("1"), scene.view_named("target_1"), scene.view_named("02")),
        (Some(2), Some(2), Some(0))
    );
    // Where names are numbers, a number is no index.
    assert_eq!(scene.view_named("0"), None);
    // An exact name wins; of a photograph and a target pose of one number the photograph is meant.
    folder.write("target_pose/2.txt", scenes::words(&scenes::WORLD_FROM_CAMERA));
    let scene = open(&folder);
    assert_eq!((scene.view_named("2"), scene.view_named("02")), (Some(0), Some(0)));
    // A number that two photographs end in finds neither.
    folder.image("rgb/car2.png", 16, 12).write("pose/car2.txt", scenes::words(&scenes::WORLD_FROM_CAMERA));
    let scene = open(&folder);
    assert_eq!((scene.view_named("2"), scene.view_named("02"), scene.view_named("car2")), (Some(0), None, Some(2)));
    // Without numbers in the names, a number is an index.
    let mut scene = scene;
    for (view, name) in scene.views.iter_mut().zip(["front", "left", "5 right", "back", "top"]) {
        view.name = name.to_owned();
    }
    assert_eq!(["0", "2", "5", "9"].map(|number| scene.view_named(number)), [Some(0), Some(2), None, None]);
    // A name that looks like an index is one, too: where they differ it may be either.
    (scene.views[0].name, scene.views[3].name) = ("#2".to_owned(), "#3".to_owned());
    assert_eq!(
        (scene.views_meant("#2"), scene.view_named("#3"), scene.view_named("#0")),
        (vec![0, 2], Some(3), Some(0))
    );
}

#[test]
fn photographs_of_every_kind_become_rgba8() {
    use image::{DynamicImage, ImageBuffer, Luma, LumaA, Rgba};
    let cases: [(&str, DynamicImage, [u8; 4], bool); 5] = [
        // An alpha channel that is 255 everywhere, as SRN's photographs have, says nothing.
        ("png", DynamicImage::ImageRgba8(ImageBuffer::from_pixel(16, 12, Rgba([1, 2, 3, 255]))), [1, 2, 3, 255], false),
        ("png", DynamicImage::ImageLuma8(ImageBuffer::from_pixel(16, 12, Luma([7]))), [7, 7, 7, 255], false),
        ("png", DynamicImage::ImageLumaA8(ImageBuffer::from_pixel(16, 12, LumaA([7, 9]))), [7, 7, 7, 9], true),
        // 16 bits: 257 per step of 8 bits, rounded to the nearest; colour under alpha 0 is kept (straight alpha).
        (
            "png",
            DynamicImage::ImageRgba16(ImageBuffer::from_pixel(16, 12, Rgba([257 * 3 + 128, 257 * 3 + 129, 65535, 0]))),
            [3, 4, 255, 0],
            true,
        ),
        ("jpg", DynamicImage::ImageLuma8(ImageBuffer::from_pixel(16, 12, Luma([128]))), [128, 128, 128, 255], false),
    ];
    for (extension, image, expected, has_alpha) in cases {
        let folder = scenes::srn();
        let name = format!("rgb/2.{extension}");
        folder.remove("rgb/2.png");
        image.save(folder.file(&name)).expect("an image");
        let photograph = open(&folder).photograph(0).expect("a photograph");
        assert_eq!(photograph.has_alpha, has_alpha, "{image:?}");
        assert_eq!(photograph.pixels.dimensions(), (16, 12));
        assert!(photograph.pixels.pixels().all(|pixel| pixel.0 == expected), "{:?}", photograph.pixels.get_pixel(0, 0));
    }
}

#[test]
fn pixels_that_are_not_there() {
    let folder = scenes::srn();
    let scene = open(&folder);
    let fault = |view| scene.photograph(view).expect_err("no picture").fault;
    assert!(matches!(*fault(2), SceneFault::NoPhotograph(name) if name == "target_1"));
    assert!(matches!(*fault(3), SceneFault::NoSuchView(3, 3)));
    folder.image("rgb/2.png", 12, 16);
    assert!(matches!(*fault(0), SceneFault::Image(ImageFault::SizeMismatch { size: [12, 16], .. })));
}

#[test]
fn views_numbered_alike_in_two_folders_are_told_apart() {
    let mut transforms = scenes::transforms();
    let frame = |path: &str| json!({ "file_path": path, "transform_matrix": scenes::opengl_matrix() });
    transforms["frames"] = json!([frame("left/0001.png"), frame("right/0001.png"), frame("left/0002.png")]);
    let folder = scenes::transforms_folder(&transforms);
    for name in ["left/0001.png", "right/0001.png", "left/0002.png"] {
        folder.image(name, 16, 12);
    }
    let scene = open(&folder);
    assert_eq!(names(&scene), ["left_0001", "right_0001", "0002"]);
}

/// Photographs without poses beside something that has them.
#[test]
fn where_poses_are_is_said() {
    let folder = Folder::new();
    folder.image("1.png", 16, 12).image("2.png", 16, 12);
    assert_refused(&folder, ": 2 photographs, and nothing that gives their poses", &[]);
    for (file, said) in [
        ("sfm_data.json", "sfm_data.json is OpenMVG's, which is not read"),
        ("cams/00000000_cam.txt", "00000000_cam.txt is MVSNet's, which is not read"),
        ("Barn_COLMAP_SfM.log", "Barn_COLMAP_SfM.log is Tanks and Temples's, which is not read"),
        ("cameras.xml", "cameras.xml is Metashape's, which is not read"),
    ] {
        folder.write(file, "{}");
        assert_refused(&folder, ": 2 photographs without poses; ", &[said, "as a COLMAP model (text or binary)"]);
        folder.remove(file);
    }
    for other in ["cameras_old.json", "bundle_adjustment.out", "IMG_cam.txt", "pose.log", "1.xmp"] {
        folder.write(other, "{}");
        assert_refused(&folder, ": 2 photographs, and nothing that gives their poses", &[]);
    }
    // A folder rgb alone makes no scene of the one above.
    let bare = Folder::new();
    bare.image("rgb/1.png", 16, 12);
    let error = Scene::open(bare.path().join("rgb")).expect_err("no poses").to_string();
    assert!(error.ends_with("1 photographs, and nothing that gives their poses"), "{error}");
    // Those of a scene's folder of photographs.
    let scene = scenes::transforms_folder(&scenes::transforms());
    let error = Scene::open(scene.path().join("images")).expect_err("no poses").to_string();
    assert!(error.ends_with("is a scene: give that"), "{error}");
}
