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
    // A part whose photographs are not there costs the others nothing.
    folder.remove("test/r_0.png");
    let without = open(&folder);
    assert_eq!(names(&without), ["train_r_0", "val_r_0"]);
    assert!(without.warnings[0].ends_with("none of its photographs is there: 'test' has no views"));
    folder.image("test/r_0.png", 16, 12);
    // That for training is the scene, and what is only elsewhere is not missing.
    folder.remove("train/r_0.png");
    assert_refused(&folder, "transforms_train.json", &["train/r_0"]);
    folder.image("train/r_0.png", 16, 12);
    // One of the files by its name is that part alone.
    let test = Scene::open(folder.join("transforms_test.json")).expect("a part");
    assert_eq!((names(&test), test.views[0].split), (vec!["r_0"], Some(Split::Test)));
    // A whole scene's file wins.
    folder.write("transforms.json", json!({ "camera_angle_x": angle, "frames": [frame("val/r_0.png")] }).to_string());
    assert_eq!((names(&open(&folder)), open(&folder).views[0].split), (vec!["r_0"], None));
}

/// Intrinsics that name no size are those of the photographs that the file names.
#[test]
fn reduced_photographs_have_reduced_intrinsics() {
    let transforms = |names: &[&str]| {
        let frames: Vec<Value> = names.iter().map(|name| frame(name)).collect();
        json!({ "fl_x": 20, "cx": 8, "cy": 6, "frames": frames }).to_string()
    };
    let folder = Folder::new();
    folder.image("images_2/a.png", 8, 6).write("transforms.json", transforms(&["images/a.png"]));
    let pinhole = open(&folder).views[0].camera.pinhole;
    assert_eq!((pinhole.width(), pinhole.focal(), pinhole.principal()), (8, [10.0; 2], [4.0, 3.0]));
    // A file that names the reduced ones speaks of them.
    folder.write("transforms.json", transforms(&["images_2/a.png"]));
    assert_eq!(open(&folder).views[0].camera.pinhole.focal(), [20.0; 2]);
    folder.image("images/a.png", 16, 12).write("transforms.json", transforms(&["images/a.png"]));
    assert_eq!(open(&folder).views[0].camera.pinhole.focal(), [20.0; 2]);
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
    let scene = Scene::open(folder.join("poses")).expect("a scene");
    assert_eq!(names(&scene), ["1", "2"]);
    assert_eq!(scene.views[1].image.as_deref(), Some(elsewhere.file("2.png").as_path()));
    // What is no picture is not read.
    folder.write("notes.txt", "private");
    transforms["frames"] = json!([frame("../notes.txt")]);
    folder.write("poses/transforms.json", transforms.to_string());
    let error = Scene::open(folder.join("poses")).expect_err("no picture").to_string();
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
fn a_photograph_beside_a_list_from_another_machine_is_named() {
    let moved = with_frames(json!([frame("/home/anna/desk/1.png")]), &["images/1.png"]);
    let found = format!("but {} is there: make the path relative", moved.file("images/1.png").display());
    let begins = "transforms.json: frames[0].file_path: this pose has no photograph";
    assert_refused(&moved, begins, &["/home/anna/desk/1.png", &found]);
}

#[test]
fn photographs_may_be_smaller_and_paths_those_of_another_system() {
    let mut frames: Vec<Value> = ["images/1.png", "images/2.png"].map(frame).into();
    frames[1]["file_path"] = json!("images\\2.png");
    let folder = with_frames(frames.into(), &["images_4/1.png", "images_4/2.png"]);
    let scene = open(&folder);
    assert_eq!((names(&scene), scene.warnings.len()), (vec!["1", "2"], 0));
    assert_eq!(scene.views[1].image, Some(folder.join("images_4/2.png")));
}

/// COLMAP's mask of a photograph that is not there is no photograph; nor is instant-ngp's alpha channel.
#[test]
fn what_stands_beside_a_photograph_is_not_taken_for_it() {
    let folder = with_frames(json!([frame("images/a.jpg"), frame("images/b.jpg")]), &["images/a.jpg"]);
    folder.image("images/b.jpg.png", 16, 12);
    let scene = open(&folder);
    assert_eq!(names(&scene), ["a"]);
    assert!(scene.warnings[0].contains("1 of 2 photographs are not there"), "{:?}", scene.warnings);
    folder.image("images/a.alpha.png", 16, 12);
    let told = open(&folder).warnings;
    let alpha = "a.alpha.png: 1 file with alpha channels of photographs is not read";
    assert!(told.iter().any(|warning| warning.contains(alpha)), "{told:?}");
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
    // A fifth of what it has elsewhere.
    let level = |x, _| image::Luma([if x == 15 { 255 } else { 51 }]);
    image::GrayImage::from_fn(16, 12, level).save(folder.file("masks/2.png.png")).expect("a mask");
    mask("masks/3.jpg", 255, 32, 24);
    let scene = Scene::open_masked(&folder, MaskChoice::Object).expect("a scene");
    let found: Vec<_> = scene.views.iter().map(|view| view.mask.as_ref().map(|mask| mask.file_name())).collect();
    let named = |name: &'static str| Some(Some(std::ffi::OsStr::new(name)));
    assert_eq!(found, [named("m.png"), named("2.png.png"), named("3.jpg"), None]);
    assert_eq!(scene.warnings.len(), 1);
    assert!(scene.warnings[0].contains("1 of 4 photographs are excluded (4.png is the first)"), "{:?}", scene.warnings);
    for (view, alpha) in [(0, 0), (1, 51), (2, 255)] {
        let photograph = scene.photograph(view).expect("a photograph");
        assert!(
            photograph.has_alpha
                && photograph
                    .pixels
                    .enumerate_pixels()
                    .filter(|(x, ..)| *x < 15)
                    .all(|(.., pixel)| pixel.0 == [10, 20, 30, alpha]),
            "{view}"
        );
    }
    assert!(scene.views[3].image.is_none());
    mask("masks/3.jpg", 255, 16, 13);
    let scene = Scene::open_masked(&folder, MaskChoice::Object).expect("a scene");
    let error = scene.photograph(2).expect_err("another shape").to_string();
    assert!(error.contains("masks/3.jpg: the image is 16 x 13, but the photograph that it is for"), "{error}");
}

#[test]
fn lenses_are_told_by_model_and_flag() {
    let lens = |entries: &[(&str, Value)]| {
        let mut transforms = scenes::transforms();
        let is_listed = entries.iter().any(|(key, _)| *key == "distortion_params");
        let keys = ["k1", "k2", "k3", "k4", "p1", "p2"];
        keys.iter().filter(|_| is_listed).for_each(|key| transforms[*key] = Value::Null);
        transforms["k1"] = json!(0.1);
        entries.iter().for_each(|(key, value)| transforms[*key] = value.clone());
        let scene = Scene::open(scenes::transforms_folder(&transforms).path()).expect("a scene");
        scene.views[0].lens.map(|lens| (lens.projection(), lens.coefficients()))
    };
    let coefficients = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (perspective, fisheye) =
        (Some((Projection::Perspective, coefficients)), Some((Projection::Fisheye, coefficients)));
    assert_eq!(lens(&[]), perspective);
    assert_eq!(lens(&[("camera_model", json!("OPENCV"))]), perspective);
    assert_eq!(lens(&[("camera_model", json!("OPENCV_FISHEYE"))]), fisheye);
    assert_eq!(lens(&[("is_fisheye", json!(true))]), fisheye);
    assert_eq!(lens(&[("k1", json!(0))]), None);
    let all = [("k2", 0.2), ("k3", 0.3), ("k4", 0.4), ("k5", 0.5), ("k6", 0.6), ("p1", 0.7), ("p2", 0.8)];
    let mut all: Vec<(&str, Value)> = all.map(|(key, value)| (key, json!(value))).into();
    all.push(("camera_model", json!("FULL_OPENCV")));
    assert_eq!(lens(&all), Some((Projection::Perspective, [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.0])));
    // nerfstudio's list, at the top or in a frame, which may be short, and says the same as keys beside it.
    let list = |numbers: Value| [("distortion_params", numbers)];
    let whole = [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.7, 0.8, 0.4];
    assert_eq!(lens(&list(json!([0.1, 0.2, 0.3, 0.4, 0.7, 0.8]))), Some((Projection::Perspective, whole)));
    assert_eq!(lens(&list(json!([0.1, 0.2]))).map(|(_, all)| all[..2].to_vec()), Some(vec![0.1, 0.2]));
    // The same number, saved in single precision in one of the places.
    assert!(lens(&list(json!([f64::from(0.1_f32)]))).is_some());
    let mut fisheye_list = list(json!([0.1, -0.2, 0.3, 0.4, 0.0, 0.0])).to_vec();
    fisheye_list.push(("camera_model", json!("OPENCV_FISHEYE")));
    assert_eq!(lens(&fisheye_list), Some((Projection::Fisheye, [0.1, -0.2, 0.3, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0])));
    let mut frames = json!([frame("./images/0001.png")]);
    frames[0]["distortion_params"] = json!([0.1, 0.25]);
    assert_eq!(lens(&[("frames", frames)]).map(|(_, all)| all[1]), Some(0.25));
    for (numbers, said) in [
        (json!([0.3]), "distortion_params[0] 0.3 and k1 0.1 contradict each other"),
        (json!([0.1, "x"]), "distortion_params: "),
        (json!([0.1, 0, 0, 0, 0, 0, 0]), "(k1 k2 k3 k4 p1 p2) instead of 6"),
        (json!(0.1), "distortion_params"),
    ] {
        let mut transforms = scenes::transforms();
        (transforms["k1"], transforms["distortion_params"]) = (json!(0.1), numbers);
        assert_refused(&scenes::transforms_folder(&transforms), "transforms.json: ", &[said]);
    }
    // A frame's own lens wins.
    let mut frames = json!([frame("./images/0001.png")]);
    frames[0]["k1"] = json!(-0.25);
    assert_eq!(lens(&[("frames", frames)]).map(|(_, all)| all[0]), Some(-0.25));
}

#[test]
fn the_fourth_coefficient_goes_on_with_the_polynomial() {
    for model in [None, Some("OPENCV"), Some("PINHOLE"), Some("RADIAL")] {
        let mut transforms = scenes::transforms();
        let numbers = [("k1", 0.1), ("k2", 0.2), ("k3", 0.3), ("k4", 0.4), ("p1", 0.5), ("p2", 0.6), ("k5", 0.0)];
        numbers.into_iter().for_each(|(key, value)| transforms[key] = json!(value));
        model.into_iter().for_each(|model| transforms["camera_model"] = json!(model));
        let lens = open(&scenes::transforms_folder(&transforms)).views[0].lens.expect("a lens");
        assert_eq!(lens.coefficients(), [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 0.5, 0.6, 0.4], "{model:?}");
        let [x, y] = lens.distort([0.5, 0.0]);
        let radius = 1.0 + 0.1 / 4.0 + 0.2 / 16.0 + 0.3 / 64.0 + 0.4 / 256.0;
        assert!((x - (0.5 * radius + 0.6 * 0.75)).abs() < 1e-15 && (y - 0.5 * 0.25).abs() < 1e-15, "{x} {y}");
    }
}

#[test]
fn opening_angles_in_degrees() {
    let mut transforms = scenes::transforms();
    let top = transforms.as_object_mut().expect("an object");
    top.retain(|key, _| key == "frames");
    top.insert("x_fov".into(), json!((2.0 * (8.0f64 / 20.0).atan()).to_degrees()));
    top.insert("y_fov".into(), json!((2.0 * (6.0f64 / 24.0).atan()).to_degrees()));
    assert_pixel(&open(&scenes::transforms_folder(&transforms)), 0, [8.0 + 5.0, 6.0 - 3.0]);
    transforms["x_fov"] = json!(180.5);
    assert_refused(&scenes::transforms_folder(&transforms), "transforms.json: x_fov: opening angle", &[]);
}

/// The sample with what `change` makes of its frames and its top.
fn changed(count: usize, change: impl Fn(&mut Value)) -> Folder {
    let names: Vec<String> = (1..=count).map(|index| format!("images/{index}.png")).collect();
    let mut transforms = scenes::transforms();
    transforms["frames"] = names.iter().map(|name| frame(name)).collect();
    change(&mut transforms);
    let folder = Folder::new();
    names.iter().for_each(|name| _ = folder.image(name, 16, 12));
    folder.write("transforms.json", transforms.to_string());
    folder
}

#[test]
fn names_in_lists_are_compared_as_paths() {
    let folder = changed(3, |transforms| {
        transforms["frames"][1]["file_path"] = json!("./images/2.png");
        transforms["frames"][2]["file_path"] = json!("images\\3.png");
        transforms["train_filenames"] = json!(["./images/1.png", "images/2.png"]);
        transforms["test_filenames"] = json!([".\\images\\3.png"]);
    });
    let scene = open(&folder);
    let splits: Vec<_> = scene.views.iter().map(|view| view.split).collect();
    assert_eq!(splits, [Some(Split::Train), Some(Split::Train), Some(Split::Test)]);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let folder = changed(1, |transforms| transforms["val_filenames"] = json!(["images/1.png", "images/7.png"]));
    let [warning] = &open(&folder).warnings[..] else { panic!("one warning") };
    assert!(warning.contains("no frame has 1 of the 2 names in train_filenames"), "{warning}");
    assert!(warning.contains("images/7.png"), "{warning}");
}

#[test]
fn what_is_not_read_is_said() {
    // What instant-ngp's and nerfstudio's own scripts write besides changes nothing.
    let scene = open(&changed(2, |transforms| {
        transforms["ply_file_path"] = json!("sparse_pc.ply");
        transforms["rolling_shutter"] = json!([0, 0, 0, 0]);
        transforms["white_transparent"] = json!(false);
        transforms["frames"][1]["sharpness"] = json!(20.0);
        transforms["frames"][1]["colmap_im_id"] = json!(2);
    }));
    assert_eq!((&scene.warnings[..], scene.unused.len()), (&[][..], 1), "{:?}", scene.unused);
    let keys = "transforms.json: aabb_scale, ply_file_path, rolling_shutter, white_transparent, colmap_im_id of 1 \
                frames, sharpness of 1 frames";
    assert!(scene.unused[0].ends_with(keys), "{}", scene.unused[0]);
    // What changes pictures is a warning.
    let scene = open(&changed(3, |transforms| {
        transforms["white_transparent"] = json!(true);
        transforms["frames"][0]["rolling_shutter"] = json!([0, 0, 0.5, 0]);
        (0..3).for_each(|index| transforms["frames"][index]["time"] = json!(0.5 * index as f64));
        transforms["camera_model"] = json!("OPENCV");
        transforms["frames"][2]["camera_model"] = json!("PINHOLE");
        transforms["frames"][2]["k1"] = json!(0.25);
        transforms["frames"][2]["fl_x"] = json!(20);
    }));
    let [telling, moving] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    let [overriding] = &scene.conventions[..] else { panic!("{:?}", scene.conventions) };
    assert!(
        overriding.contains("1 of 3 frames state camera_model, k1 otherwise than the top of the file: each frame's"),
        "{overriding}"
    );
    assert!(telling.contains("rolling_shutter, white_transparent change pictures and are not read"), "{telling}");
    assert!(moving.contains("different times (time): the scene moves"), "{moving}");
    // The dark rim of a fisheye, which nerfstudio cuts off.
    let rim = open(&changed(2, |transforms| transforms["fisheye_crop_radius"] = json!(5.0)));
    assert!(rim.warnings.iter().any(|told| told.contains("counts as picture: give masks of it")), "{:?}", rim.warnings);
    // One time is a still scene.
    let still = changed(2, |transforms| (0..2).for_each(|index| transforms["frames"][index]["time"] = json!(0.5)));
    assert!(open(&still).warnings.is_empty());
}

#[test]
fn photographs_that_no_frame_names_are_counted() {
    let folder = changed(2, |_| {});
    folder.image("images/3.png", 16, 12).image("images/10.png", 16, 12);
    // Pictures that belong to a photograph are none.
    for name in ["1_depth_0001", "2_normal", "1.depth", "mask_1"] {
        folder.image(&format!("images/{name}.png"), 16, 12);
    }
    let [warning] = &open(&folder).warnings[..] else { panic!("one warning") };
    assert!(warning.ends_with("images: 2 photographs have no pose and are not used, 2 have one (without is 3.png)"));
    folder.remove("images/3.png").remove("images/10.png");
    assert!(open(&folder).warnings.is_empty());
    // In folders beside those of the photographs, too; other files beside the lists are named.
    folder.image("images/left/7.png", 16, 12).write("notes.txt", "a note").write("sparse_pc.ply", "points");
    let scene = open(&folder);
    assert!(scene.warnings.is_empty(), "images itself holds photographs: {:?}", scene.warnings);
    assert!(scene.unused.iter().any(|line| line.ends_with(": notes.txt, sparse_pc.ply")), "{:?}", scene.unused);
    let mut transforms = scenes::transforms();
    transforms["frames"] = json!([frame("images/left/1.png")]);
    let folder =
        with_frames(transforms["frames"].clone(), &["images/left/1.png", "images/right/1.png", "images/2.png"]);
    let [warning] = &open(&folder).warnings[..] else { panic!("one warning") };
    assert!(warning.contains("2 photographs have no pose and are not used, 1 have one"), "{warning}");
}
