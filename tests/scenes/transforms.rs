//! What `transforms.json` may say beside poses: parts, masks, lenses, depth images, photographs that are missing.

use super::made::{assert_pixel, assert_refused, names, open};
use serde_json::{Value, json};
use viewfuse::scene::few_shot::view_list;
use viewfuse::scene::{MaskChoice, Scene, Split};
use viewfuse_core::lens::Projection;
use viewfuse_tests::scenes::{self, Folder};

fn frame(path: &str) -> Value {
    json!({ "file_path": path, "transform_matrix": scenes::opengl_matrix() })
}

/// The sample with these frames, and photographs of these names.
fn with_frames(frames: Value, photographs: &[&str]) -> Folder {
    let mut transforms = scenes::transforms();
    transforms["frames"] = frames;
    let folder = Folder::new();
    photographs.iter().for_each(|name| _ = folder.image(name, 16, 12));
    folder.write("transforms.json", transforms.to_string());
    folder
}

#[test]
fn parts_in_files_are_one_scene() {
    let folder = Folder::new();
    let angle = 2.0 * (8.0f64 / 20.0).atan();
    for part in ["train", "val", "test"] {
        folder.image(&format!("{part}/r_0.png"), 16, 12);
        let frames = json!([frame(&format!("./{part}/r_0"))]);
        let text = json!({ "camera_angle_x": angle, "frames": frames }).to_string();
        folder.write(&format!("transforms_{part}.json"), text);
    }
    let scene = open(&folder);
    assert_eq!(names(&scene), ["train_r_0", "val_r_0", "test_r_0"]);
    let splits: Vec<_> = scene.views.iter().filter_map(|view| view.split).collect();
    assert_eq!(splits, [Split::Train, Split::Validation, Split::Test]);
    assert_pixel(&scene, 2, [13.0, 3.5]);
    let chosen = |list: &str| view_list(&scene, list).expect("views");
    assert_eq!((chosen("test"), chosen("train,val/2"), chosen("all")), (vec![2], vec![0, 1], vec![0, 1, 2]));
    // One of the files by its name is that part alone.
    let test = Scene::open(folder.path().join("transforms_test.json")).expect("a part");
    assert_eq!((names(&test), test.views[0].split), (vec!["r_0"], Some(Split::Test)));
    // A whole scene's file wins.
    folder.write("transforms.json", json!({ "camera_angle_x": angle, "frames": [frame("val/r_0.png")] }).to_string());
    assert_eq!((names(&open(&folder)), open(&folder).views[0].split), (vec!["r_0"], None));
}

#[test]
fn a_photograph_may_lie_outside_the_folder() {
    let elsewhere = Folder::new();
    elsewhere.image("2.png", 16, 12);
    let absolute = elsewhere.file("2.png").display().to_string();
    let folder = Folder::new();
    folder.image("photographs/1.png", 16, 12);
    let mut transforms = scenes::transforms();
    transforms["frames"] = json!([frame("../photographs/1.png"), frame(&absolute)]);
    folder.write("poses/transforms.json", transforms.to_string());
    let scene = Scene::open(folder.path().join("poses")).expect("a scene");
    assert_eq!(names(&scene), ["1", "2"]);
    assert_eq!(scene.views[1].image.as_deref(), Some(elsewhere.file("2.png").as_path()));
    // What is no picture is not read.
    folder.write("notes.txt", "private");
    transforms["frames"] = json!([frame("../notes.txt")]);
    folder.write("poses/transforms.json", transforms.to_string());
    let error = Scene::open(folder.path().join("poses")).expect_err("no picture").to_string();
    assert!(error.contains("notes.txt") && !error.contains("private"), "{error}");
}

#[test]
fn parts_in_lists() {
    let photographs = ["images/1.png", "images/2.png", "images/3.png"];
    let folder = with_frames(photographs.map(frame).to_vec().into(), &photographs);
    let mut transforms: Value =
        serde_json::from_slice(&std::fs::read(folder.file("transforms.json")).expect("a file")).expect("JSON");
    transforms["train_filenames"] = json!(["images/1.png"]);
    transforms["test_filenames"] = json!(["images/3.png"]);
    folder.write("transforms.json", transforms.to_string());
    let splits: Vec<_> = open(&folder).views.iter().map(|view| view.split).collect();
    assert_eq!(splits, [Some(Split::Train), None, Some(Split::Test)]);
}

#[test]
fn missing_photographs_and_depth_images_are_one_warning_each() {
    let mut frames: Vec<Value> = ["images/1.png", "images/2.png", "images/3.png"].map(frame).into();
    frames[0]["depth_file_path"] = json!("depth/1.png");
    frames[2]["depth_file_path"] = json!("depth/3.png");
    let folder = with_frames(frames.clone().into(), &["images/2.png"]);
    let scene = open(&folder);
    assert_eq!(names(&scene), ["2"]);
    let [missing, depth] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(missing.contains("2 of 3 photographs") && missing.contains("images/1.png"), "{missing}");
    assert!(depth.contains("2 of 3 frames") && depth.contains("depth_file_path"), "{depth}");
    let none = with_frames(frames.into(), &[]);
    assert_refused(&none, "transforms.json: frames[0].file_path: this pose has no photograph", &["images/1.png"]);
}

#[test]
fn photographs_may_be_smaller_and_paths_those_of_another_system() {
    let mut frames: Vec<Value> = ["images/1.png", "images/2.png"].map(frame).into();
    frames[1]["file_path"] = json!("images\\2.png");
    let folder = with_frames(frames.into(), &["images_4/1.png", "images_4/2.png"]);
    let scene = open(&folder);
    assert_eq!((names(&scene), scene.warnings.len()), (vec!["1", "2"], 0));
    assert_eq!(scene.views[1].image, Some(folder.path().join("images_4/2.png")));
}

#[test]
fn masks_are_named_or_stand_beside() {
    let photographs = ["images/1.png", "images/2.png", "images/3.png", "images/4.png"];
    let mut frames: Vec<Value> = photographs.map(frame).into();
    frames[0]["mask_path"] = json!("other/m.png");
    let folder = with_frames(frames.clone().into(), &photographs);
    assert_refused(&folder, "transforms.json: frames[0].mask_path: there is no mask", &["other/m.png"]);
    let mask = |name: &str, level: u8, width: u32, height: u32| {
        image::GrayImage::from_pixel(width, height, image::Luma([level])).save(folder.file(name)).expect("a mask");
    };
    mask("other/m.png", 0, 16, 12);
    mask("masks/1.png", 255, 16, 12);
    mask("masks/2.png.png", 51, 16, 12);
    mask("masks/3.jpg", 255, 32, 24);
    let scene = Scene::open_masked(folder.path(), MaskChoice::Object).expect("a scene");
    let found: Vec<_> = scene.views.iter().map(|view| view.mask.as_ref().map(|mask| mask.file_name())).collect();
    let named = |name: &'static str| Some(Some(std::ffi::OsStr::new(name)));
    assert_eq!(found, [named("m.png"), named("2.png.png"), named("3.jpg"), None]);
    assert_eq!(scene.warnings.len(), 1);
    assert!(scene.warnings[0].contains("1 of 4 photographs have no mask"), "{:?}", scene.warnings);
    for (view, alpha) in [(0, 0), (1, 51), (2, 255)] {
        let photograph = scene.photograph(view).expect("a photograph");
        assert!(
            photograph.has_alpha && photograph.pixels.pixels().all(|pixel| pixel.0 == [10, 20, 30, alpha]),
            "{view}"
        );
    }
    assert!(!scene.photograph(3).expect("a photograph").has_alpha);
    mask("masks/3.jpg", 255, 16, 13);
    let error = open(&folder).photograph(2).expect_err("another shape").to_string();
    assert!(error.contains("masks/3.jpg: the image is 16 x 13, but the photograph that it is for"), "{error}");
}

#[test]
fn lenses_are_told_by_model_and_flag() {
    let lens = |entries: &[(&str, Value)]| {
        let mut transforms = scenes::transforms();
        transforms["k1"] = json!(0.1);
        entries.iter().for_each(|(key, value)| transforms[*key] = value.clone());
        let scene = Scene::open(scenes::transforms_folder(&transforms).path()).expect("a scene");
        scene.views[0].lens.map(|lens| (lens.projection(), lens.coefficients()))
    };
    let coefficients = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (perspective, fisheye) =
        (Some((Projection::Perspective, coefficients)), Some((Projection::Fisheye, coefficients)));
    assert_eq!(lens(&[]), perspective);
    assert_eq!(lens(&[("camera_model", json!("OPENCV"))]), perspective);
    assert_eq!(lens(&[("camera_model", json!("OPENCV_FISHEYE"))]), fisheye);
    assert_eq!(lens(&[("is_fisheye", json!(true))]), fisheye);
    assert_eq!(lens(&[("k1", json!(0))]), None);
    let all = [("k2", 0.2), ("k3", 0.3), ("k4", 0.4), ("k5", 0.5), ("k6", 0.6), ("p1", 0.7), ("p2", 0.8)];
    let all: Vec<(&str, Value)> = all.map(|(key, value)| (key, json!(value))).into();
    assert_eq!(lens(&all), Some((Projection::Perspective, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8])));
    // A frame's own lens wins.
    let mut frames = json!([frame("./images/0001.png")]);
    frames[0]["k1"] = json!(-0.25);
    assert_eq!(lens(&[("frames", frames)]).map(|(_, all)| all[0]), Some(-0.25));
}
