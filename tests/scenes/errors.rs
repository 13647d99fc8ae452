//! Bad scenes: each is refused with one line that names the file, and the line or key, that a person must open.

use super::made::{assert_message, assert_refused, names};
use serde_json::{Value, json};
use std::fs;
use viewfuse::scene::Scene;
use viewfuse_tests::scenes::{self, Folder, MIDDLEBURY_K, middlebury_line, words};

const POSE: [f64; 16] = scenes::WORLD_FROM_CAMERA;

#[track_caller]
fn assert_srn_refused(name: &str, contents: &str, begins: &str, parts: &[&str]) {
    let folder = scenes::srn();
    folder.write(name, contents);
    assert_refused(&folder, begins, parts);
}

/// `transforms.json` with the value at a JSON pointer replaced (or added to an object).
#[track_caller]
fn assert_transforms_refused(object: &str, key: &str, value: Value, parts: &[&str]) {
    let mut transforms = scenes::transforms();
    transforms.pointer_mut(object).expect("an object")[key] = value;
    assert_refused(&scenes::transforms_folder(&transforms), "transforms.json: ", parts);
}

fn with(index: usize, value: f64) -> String {
    let mut pose = POSE;
    pose[index] = value;
    words(&pose)
}

#[test]
fn nothing_to_read() {
    let folder = Folder::new();
    let missing = Scene::open(folder.join("nowhere")).expect_err("no such path");
    assert_message(&missing, &folder, "nowhere: no such file or folder", &[]);
    let forms = ["transforms.json", "*_par.txt", "rgb/", "intrinsics.txt", "poses_bounds.npy", "cameras.bin", ".npz"];
    assert_refused(&folder, ": no scene here; looked for", &forms);
    folder.write("notes.txt", "hello");
    let text = Scene::open(folder.join("notes.txt")).expect_err("not a scene");
    assert_message(&text, &folder, "notes.txt: no scene here", &[]);
    folder.write("a_par.txt", "0").write("b_par.txt", "0");
    assert_refused(&folder, ": holds both a_par.txt and b_par.txt", &[]);
}

#[test]
fn no_views() {
    let folder = Folder::new();
    folder.write("a_par.txt", "0\n");
    assert_refused(&folder, "a_par.txt: the scene has no photographs", &[]);
    folder.write("transforms.json", r#"{"frames": []}"#);
    assert_refused(&folder, "transforms.json: the scene has no photographs", &["frames"]);
    let folder = Folder::new();
    folder.write("rgb/notes.md", "").write("pose/notes.md", "");
    assert_refused(&folder, "rgb: the scene has no photographs", &[]);
}

#[test]
fn partners_missing() {
    let folder = scenes::srn();
    folder.remove("rgb/10.png");
    assert_refused(&folder, "pose/10.txt: this pose has no photograph", &["rgb/10.png"]);
    let folder = scenes::srn();
    folder.remove("pose/2.txt");
    assert_refused(&folder, "rgb/2.png: this photograph has no pose", &["pose/2.txt"]);
    let folder = scenes::srn();
    folder.remove("intrinsics.txt");
    assert_refused(&folder, "intrinsics.txt: no such file", &[]);
    let folder = scenes::srn();
    fs::remove_dir_all(folder.join("pose")).expect("a folder to delete");
    assert_refused(&folder, "pose: no such file", &[]);

    let folder = scenes::middlebury();
    folder.remove("toy0002.png");
    assert_refused(&folder, "toy_par.txt:3: this pose has no photograph", &["toy0002.png"]);
    let file_path = json!("images/0002");
    assert_transforms_refused("/frames/0", "file_path", file_path, &["frames[0].file_path", "no photo", "images/0002"]);
}

#[test]
fn numbers_that_are_none() {
    assert_srn_refused("pose/2.txt", &with(5, f64::NAN), "pose/2.txt:1: \"NaN\" is not a finite number", &[]);
    assert_srn_refused("pose/2.txt", &with(5, f64::INFINITY), "pose/2.txt:1: \"inf\" is not a finite number", &[]);
    assert_srn_refused("pose/2.txt", "1 0 0 0\n0 1 0 O\n", "pose/2.txt:2: \"O\" is not a number", &[]);
    assert_srn_refused("target_pose/1.txt", "one", "target_pose/1.txt:1: \"one\" is not a number", &[]);
    assert_srn_refused("pose/2.txt", &"x".repeat(9999), "pose/2.txt:1: \"xxx", &["xxx...\" is not a number"]);
    assert_srn_refused("pose/2.txt", &words(&POSE[..12]), "pose/2.txt: found 12 numbers instead of 16", &[]);
    assert_srn_refused("pose/2.txt", "", "pose/2.txt: found 0 numbers instead of 16", &[]);
    let folder = scenes::srn();
    folder.write("pose/2.txt", [0xff, 0xfe, 0x00]);
    assert_refused(&folder, "pose/2.txt:1: this line is not UTF-8 text", &["UTF-8"]);
}

#[test]
fn matrices_that_are_no_pose() {
    let scaled: Vec<f64> =
        POSE.iter().enumerate().map(|(i, v)| if i % 4 < 3 && i < 12 { 1.01 * v } else { *v }).collect();
    let parts = ["scaled by 1.01", "divide its 3x3 block by that, not the camera's centre"];
    assert_srn_refused("pose/2.txt", &words(&scaled), "pose/2.txt: the rotation is scaled", &parts);
    assert_srn_refused("pose/2.txt", &with(0, 0.3), "pose/2.txt: not a camera pose", &["scaled or skewed"]);
    assert_srn_refused("pose/2.txt", &with(2, -1.0), "pose/2.txt: not a camera pose", &["mirrored"]);
    assert_srn_refused("pose/2.txt", &with(15, 2.0), "pose/2.txt: not a camera pose", &["last row"]);
    assert_srn_refused("pose/2.txt", &with(3, 1e300), "pose/2.txt: not a camera pose", &["row 1, column 4"]);
    assert_srn_refused("pose/2.txt", &with(3, 1e35), "pose/2.txt: not a camera pose", &["1e30"]);

    // A camera below an object in inches.
    let mut inches = scenes::opengl_matrix();
    for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
        inches[row][column] = json!(0.0254 * inches[row][column].as_f64().expect("a number"));
    }
    let parts = ["frames[0].transform_matrix: the rotation is scaled by 0.0254: divide"];
    assert_transforms_refused("/frames/0", "transform_matrix", inches, &parts);
    let mut mirrored = scenes::opengl_matrix();
    mirrored[0][2] = json!(1.0);
    let parts = ["frames[0].transform_matrix: not a camera pose", "mirrored"];
    assert_transforms_refused("/frames/0", "transform_matrix", mirrored, &parts);
    let line = middlebury_line("toy0002.png", &MIDDLEBURY_K).replace("-2 -3 -1", "-2 -3 nan");
    let folder = scenes::middlebury();
    folder.write("toy_par.txt", format!("1\n\n{line}\n"));
    assert_refused(&folder, "toy_par.txt:3: \"nan\" is not a finite number", &[]);
}

#[test]
fn unusable_intrinsics() {
    let file = "intrinsics.txt";
    assert_srn_refused(file, "-20 8 6 0\n0 0 0\n1\n12 16", "intrinsics.txt:1: focal lengths -20", &[]);
    assert_srn_refused(file, "20 8\n0 0 0\n1\n12 16", "intrinsics.txt:1: found 2 numbers", &["focal cx cy"]);
    assert_srn_refused(file, "20 8 6 0\n0 0 0\n1\n", "intrinsics.txt: found 0 lines", &["height width"]);
    assert_srn_refused(file, "20 8 6 0\n0 0 0\n1\n12.5 16", "intrinsics.txt:4: image size 16 x 12.5", &[]);
    assert_srn_refused(file, "20 8 6 0\n0 0 0\n1\n12 16\n7", "intrinsics.txt:5: ", &["0 or 1"]);
    assert_srn_refused(file, "\n", "intrinsics.txt: found 0 lines", &[]);
    assert_transforms_refused("", "fl_x", json!(0), &["frames[0]: focal lengths 0 and 24"]);
    assert_transforms_refused("/frames/0", "camera_angle_x", json!(3.2), &["frames[0].camera_angle_x", "3.2"]);
    for (index, part) in [(0, "focal lengths -1"), (1, "the skew -1"), (3, "the form"), (8, "the form")] {
        let mut k = MIDDLEBURY_K;
        k[index] = -1.0;
        let folder = scenes::middlebury();
        folder.write("toy_par.txt", format!("1\n{}\n", middlebury_line("toy0001.png", &k)));
        assert_refused(&folder, "toy_par.txt:2: ", &[part]);
    }
}

#[test]
fn lists_that_do_not_add_up() {
    let folder = scenes::middlebury();
    let line = middlebury_line("toy0001.png", &MIDDLEBURY_K);
    folder.write("toy_par.txt", format!("3\n{line}\n"));
    assert_refused(&folder, "toy_par.txt:1: found 1 lines of cameras instead of 3", &[]);
    folder.write("toy_par.txt", &line);
    assert_refused(&folder, "toy_par.txt:1: \"toy0001.png", &["is not a number"]);
    folder.write("toy_par.txt", format!("1\n{line} 5\n"));
    assert_refused(&folder, "toy_par.txt:2: found 22 numbers after the name instead of 21", &[]);
    folder.write("toy_par.txt", format!("2\n{line}\n{line}\n"));
    assert_refused(&folder, "toy0001.png: two views are called \"toy0001\"", &[]);
    let folder = scenes::srn();
    folder.image("rgb/2.jpg", 16, 12);
    assert_refused(&folder, "rgb/2.", &["two views are called \"2\""]);
}

#[test]
fn json_that_is_wrong() {
    let folder = Folder::new();
    folder.write("transforms.json", "{\n  \"frames\": [NaN]\n}");
    assert_refused(&folder, "transforms.json:2:14: not valid JSON", &[]);
    folder.write("transforms.json", "{\n  \"frames\": [");
    assert_refused(&folder, "transforms.json:2:13: not valid JSON", &[]);
    folder.write("transforms.json", "[1, 2]");
    assert_refused(&folder, "transforms.json: the whole file must be an object", &[]);
    folder.write("transforms.json", "{}");
    assert_refused(&folder, "transforms.json: frames is missing", &[]);
    for key in ["file_path", "transform_matrix"] {
        assert_transforms_refused("/frames/0", key, Value::Null, &[&format!("frames[0].{key} is missing")]);
    }
    assert_transforms_refused("", "fl_x", json!("20"), &["fl_x must be a number"]);
    assert_transforms_refused("/frames/0", "file_path", json!(7), &["frames[0].file_path must be a text"]);
    let matrix = "/frames/0/transform_matrix";
    assert_transforms_refused("/frames/0", "transform_matrix", json!([[1]]), &["found 1 rows instead of 4"]);
    let row = short_row();
    assert_transforms_refused("/frames/0", "transform_matrix", row, &["transform_matrix[1]: found 3 numbers"]);
    let mut transforms = scenes::transforms();
    *transforms.pointer_mut(&format!("{matrix}/2/0")).expect("an entry") = json!("a");
    assert_refused(
        &scenes::transforms_folder(&transforms),
        "transforms.json: frames[0].transform_matrix[2][0] must be a number",
        &[],
    );
    let mut transforms = scenes::transforms();
    transforms.as_object_mut().expect("an object").retain(|key, _| key == "frames");
    let parts = ["fl_x (or camera_angle_x), in frames[0] and at the top level, is missing"];
    assert_refused(&scenes::transforms_folder(&transforms), "transforms.json: ", &parts);
}

/// A matrix whose second row is short.
fn short_row() -> Value {
    json!([[1, 0, 0, 0], [0, 1, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
}

#[test]
fn lenses_that_are_not_read() {
    let advice = ["this lens is not supported", "image_undistorter"];
    for (object, key, value, said) in [
        ("", "s1", json!(0.05), "s1 is 0.05:"),
        ("/frames/0", "s4", json!(-1e-4), "frames[0].s4 is -0.0001:"),
        ("", "equirectangular", json!(true), "equirectangular is true:"),
        ("", "is_fisheye", json!("yes"), "is_fisheye is \"yes\":"),
        // Of no lens, of another model, of other programs.
        ("", "k5", json!(0.1), "k5 is 0.1:"),
        ("/frames/0", "k6", json!(1e-5), "frames[0].k6 is 0.00001:"),
        ("", "p3", json!(0.1), "p3 is 0.1:"),
        ("", "b2", json!(-0.7), "b2 is -0.7:"),
        ("", "tau_x", json!(0.01), "tau_x is 0.01:"),
        ("/frames/0", "ftheta_p1", json!(2), "frames[0].ftheta_p1 is 2:"),
    ] {
        assert_transforms_refused(object, key, value, &[said, advice[0], advice[1]]);
    }
    let mut fisheye = scenes::transforms();
    (fisheye["is_fisheye"], fisheye["p1"]) = (json!(true), json!(0.01));
    assert_refused(
        &scenes::transforms_folder(&fisheye),
        "transforms.json: p1 is 0.01: this lens is not supported",
        &[],
    );
    fisheye["camera_model"] = json!("OPENCV");
    let said = ": is_fisheye true and camera_model OPENCV contradict each other";
    assert_refused(&scenes::transforms_folder(&fisheye), &format!("transforms.json{said}"), &[]);
    let said = ["camera_model: camera model \"EQUIRECTANGULAR\" is not supported", "OPENCV_FISHEYE"];
    assert_transforms_refused("", "camera_model", json!("EQUIRECTANGULAR"), &said);
    assert_transforms_refused("/frames/0", "k2", json!(1e9), &["frames[0]: the lens's coefficient k2 is not"]);
    assert_transforms_refused("", "k1", json!("strong"), &["k1 must be a number"]);
}

#[test]
fn images_of_the_wrong_size() {
    for (width, height) in [(16, 11), (17, 12), (12, 16), (32, 25)] {
        let folder = scenes::srn();
        folder.image("rgb/10.png", width, height);
        let sizes = format!("the image is {width} x {height}, but");
        assert_refused(&folder, "rgb/10.png: ", &[&sizes, "intrinsics.txt:4 is for 16 x 12"]);
    }
    let mut transforms = scenes::transforms();
    transforms["h"] = json!(16);
    let parts = ["16 x 12, but", "transforms.json: frames[0] is for 16 x 16"];
    assert_refused(&scenes::transforms_folder(&transforms), "images/0001.png: ", &parts);
}

#[test]
fn images_that_cannot_be_read() {
    // Cut in its pixels: the header is good, so that the scene opens and the photograph fails.
    let folder = scenes::srn();
    let whole = fs::read(folder.join("rgb/2.png")).expect("an image");
    folder.write("rgb/2.png", &whole[..whole.len() - 24]);
    let scene = Scene::open(&folder).expect("headers are good");
    assert_message(&scene.photograph(0).expect_err("half an image"), &folder, "rgb/2.png: not a readable image", &[]);
    // Cut in its header.
    folder.write("rgb/2.png", &whole[..20]);
    assert_refused(&folder, "rgb/2.png: not a readable image", &[]);
    folder.write("rgb/2.png", "no image at all");
    assert_refused(&folder, "rgb/2.png: not a readable image", &[]);

    folder.write("rgb/2.png", scenes::huge_png());
    assert_refused(&folder, "rgb/2.png: the image is 100000 x 100000; at most 16384", &[]);
}

#[test]
fn numbers_out_of_range_and_keys_that_stand_twice_are_told() {
    let range = "not both from 0.001 to 1e9 pixels";
    assert_transforms_refused("", "fl_x", json!(1.0e30), &["frames[0]: focal lengths 1e30 and 24 are", range]);
    assert_transforms_refused("/frames/0", "fl_y", json!(-3), &["focal lengths 20 and -3 are", range]);
    assert_transforms_refused(
        "",
        "cx",
        json!(-2.5e9),
        &["principal point (-2500000000, 6.5) is further than 1e9 pixels"],
    );
    assert_srn_refused(
        "intrinsics.txt",
        "1e30 8 6 0\n0 0 0\n1\n12 16\n",
        "intrinsics.txt:1: focal lengths 1e30",
        &[range],
    );
    let text = scenes::transforms().to_string();
    for (given, twice, key) in [
        ("\"fl_y\"", "\"fl_y\": 24,\n\"fl_y\"", "fl_y"),
        ("\"file_path\"", "\"file_path\": \"other.png\",\n\"file_path\"", "file_path"),
    ] {
        let folder = scenes::transforms_folder(&Value::Null);
        folder.write("transforms.json", text.replacen(given, twice, 1));
        let message = format!("not valid JSON: the key \"{key}\" stands twice in one object");
        assert_refused(&folder, "transforms.json:2:", &[&message]);
    }
}

#[test]
fn coordinates_that_overflow_are_told_with_their_place() {
    for (value, part) in [("1e39", "32-bit number"), ("1e31", "beyond 1e30"), ("1e400", "not a finite number")] {
        let text = words(&POSE).replacen("1 1 0 0 2", &format!("{value} 1 0 0 2"), 1);
        assert!(text.contains(value), "{text}");
        assert_srn_refused("pose/2.txt", &text, "pose/2.txt:", &[part]);
    }
    let mut transforms = scenes::transforms();
    transforms["frames"][0]["transform_matrix"][1][3] = json!(1.0e31);
    let part = "frames[0].transform_matrix: not a camera pose: a coordinate of the camera's centre is beyond 1e30";
    assert_refused(&scenes::transforms_folder(&transforms), "transforms.json: ", &[part]);
    let folder = scenes::transforms_folder(&Value::Null);
    folder.write("transforms.json", scenes::transforms().to_string().replacen("\"fl_x\":20.0", "\"fl_x\":1e400", 1));
    assert_refused(&folder, "transforms.json:1:", &["number out of range"]);
}

#[cfg(unix)]
#[test]
fn names_that_are_no_text_work_and_stay_different() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = scenes::srn();
    for name in [&b"caf\xe9"[..], &b"caf\xe8"[..]] {
        let file = |folder_name: &str, extension: &str| {
            let name = [name, b".", extension.as_bytes()].concat();
            folder.join(folder_name).join(OsStr::from_bytes(&name))
        };
        fs::copy(folder.join("rgb/2.png"), file("rgb", "png")).expect("a photograph");
        fs::copy(folder.join("pose/2.txt"), file("pose", "txt")).expect("a pose");
        fs::create_dir_all(folder.join("masks")).expect("a folder");
        fs::copy(folder.join("rgb/2.png"), file("masks", "png")).expect("a mask");
    }
    let scene = Scene::open(&folder).expect("a scene");
    assert_eq!(names(&scene), ["2", "10", "caf%E8", "caf%E9", "target_1"]);
    assert_eq!(scene.views.iter().filter(|view| view.mask.is_some()).count(), 2);
    assert!(scene.photograph(3).is_ok());
    // A list that is no text is named with its line.
    let list = [&b"1\n\n"[..], b"caf\xe9.png", b" 1 0"].concat();
    let folder = Folder::new();
    folder.write("toy_par.txt", list);
    assert_refused(&folder, "toy_par.txt:3: this line is not UTF-8 text", &[]);
}
