//! COLMAP's models: both forms, where they stand, what is dropped and what is refused.

use super::made::*;
use viewfuse::scene::Scene;
use viewfuse_core::Vec3;
use viewfuse_core::lens::Projection;
use viewfuse_tests::scenes::{Folder, POINT_WORLD};

#[test]
fn both_forms_are_the_same_scene() {
    for folder in [colmap_text(), colmap_binary()] {
        let scene = open(&folder);
        assert_eq!((scene.layout, names(&scene)), ("colmap", vec!["b 2", "b 10"]));
        for view in 0..2 {
            assert_pixel(&scene, view, [7.5 + 5.0, 6.5 - 3.0]);
        }
        assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
        let [point, other] = &scene.points[..] else { panic!("{:?}", scene.points) };
        assert_eq!(point.position_world, Vec3::from_array(POINT_WORLD));
        assert_eq!((point.error, point.colour, &point.views[..]), (Some(0.25), [10, 20, 30], &[0, 1][..]));
        assert_eq!((other.error, &other.views[..]), (None, &[][..]));
    }
}

#[test]
fn a_model_may_stand_in_several_places() {
    let files = [
        ("cameras.bin", cameras_binary(&[pinhole()])),
        ("images.bin", images_binary(&IMAGES)),
        ("points3D.bin", points_binary()),
    ];
    let places = [
        ("sparse/0/", "images/"),
        ("sparse/", "images_4/"),
        ("dense/0/sparse/", "dense/0/images/"),
        ("dense/0/sparse/", "images_8/"),
        ("colmap/sparse/0/", "images/"),
        ("", "images/"),
        ("", ""),
    ];
    for (model, images) in places {
        let folder = Folder::new();
        files.iter().for_each(|(name, bytes)| _ = folder.write(&format!("{model}{name}"), bytes));
        IMAGES.iter().for_each(|(_, _, name)| _ = folder.image(&format!("{images}{name}"), 16, 12));
        let scene = open(&folder);
        assert_pixel(&scene, 1, [7.5 + 5.0, 6.5 - 3.0]);
        // The model's folder may be named itself.
        let inner = Scene::open(folder.join(model)).expect("the model");
        assert_eq!(inner.views.len(), 2);
    }
}

#[test]
fn an_error_of_a_point_that_is_no_number_is_not_known() {
    let folder = colmap_text();
    let text = points_text();
    for error in ["nan", "inf", "-inf"] {
        folder.write("sparse/0/points3D.txt", text.replacen(" 0.25 ", &format!(" {error} "), 1));
        let scene = open(&folder);
        assert_eq!((scene.points.len(), scene.points[0].error), (2, None), "{error}");
    }
    folder.write("sparse/0/points3D.txt", text.replacen(" 0.25 ", " x ", 1));
    assert_refused(&folder, "sparse/0/points3D.txt:2: ", &["\"x\" is not a number"]);
}

/// What other layouts call rgb/ or pose/ is no SRN scene, and a rig's folders tell its views apart.
#[test]
fn photographs_may_lie_in_rgb_and_in_the_folders_of_rigs() {
    let names_in = |names: [&'static str; 2], images: &str| {
        let folder = Folder::new();
        let images_of = [(11, 7, names[0]), (12, 7, names[1])];
        folder
            .write("sparse/0/cameras.bin", cameras_binary(&[pinhole()]))
            .write("sparse/0/images.bin", images_binary(&images_of));
        names.iter().for_each(|name| _ = folder.image(&format!("{images}/{name}"), 16, 12));
        let scene = open(&folder);
        (scene.layout, names_of(&scene))
    };
    fn names_of(scene: &Scene) -> Vec<String> {
        scene.views.iter().map(|view| view.name.clone()).collect()
    }
    assert_eq!(names_in(["a.png", "b.png"], "rgb"), ("colmap", vec!["a".to_owned(), "b".to_owned()]));
    let rigs = names_in(["rig1/camera1/1.png", "rig2/camera1/1.png"], "images");
    assert_eq!(rigs.1, ["rig1_camera1_1", "rig2_camera1_1"]);
}

#[test]
fn extensions_may_have_changed_and_points_may_be_missing() {
    let folder = colmap_binary();
    folder.remove("images/b 2.png").image("images/b 2.jpg", 16, 12).remove("sparse/0/points3D.bin");
    let scene = open(&folder);
    assert_eq!((names(&scene), scene.points.len(), scene.warnings.len()), (vec!["b 2", "b 10"], 0, 0));
}

#[test]
fn missing_photographs_are_dropped_and_counted_once() {
    for folder in [colmap_text(), colmap_binary()] {
        folder.remove("images/b 2.png");
        let scene = open(&folder);
        assert_eq!(names(&scene), ["b 10"]);
        assert_eq!(scene.points[0].views, [0]);
        let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
        assert!(warning.contains("1 of 2 photographs") && warning.contains("b 2.png"), "{warning}");
        folder.remove("images/b 10.png");
        let begins = if folder.path().join("sparse/0/images.txt").is_file() {
            "sparse/0/images.txt:4: this pose has no photograph"
        } else {
            "sparse/0/images.bin: byte"
        };
        assert_refused(&folder, begins, &["this pose has no photograph", "b 2.png"]);
    }
}

#[test]
fn of_several_models_the_largest_is_read() {
    const ALL: [(u32, u32, &str); 3] = [(1, 7, "1.png"), (2, 7, "2.png"), (3, 7, "3.png")];
    let model = |folder: &Folder, name: &str, images: &[(u32, u32, &str)], is_text: bool| {
        let [extension, cameras, list] = match is_text {
            true => [b"txt".to_vec(), cameras_text(&[pinhole()]).into_bytes(), images_text(images).into_bytes()],
            false => [b"bin".to_vec(), cameras_binary(&[pinhole()]), images_binary(images)],
        };
        let extension = String::from_utf8(extension).expect("text");
        folder.write(&format!("sparse/{name}/cameras.{extension}"), cameras);
        folder.write(&format!("sparse/{name}/images.{extension}"), list);
    };
    for is_text in [true, false] {
        let folder = Folder::new();
        ALL.iter().for_each(|(_, _, name)| _ = folder.image(&format!("images/{name}"), 16, 12));
        model(&folder, "0", &ALL[..1], is_text);
        model(&folder, "1", &ALL[1..], is_text);
        // Found by its number, not by its name.
        model(&folder, "10", &ALL[..1], !is_text);
        let scene = open(&folder);
        assert_eq!(names(&scene), ["2", "3"]);
        let [models, photographs] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
        assert!(models.contains("sparse/1: this model has 2 photographs; others beside it are not read"), "{models}");
        assert!(models.ends_with(": 0 (1 photographs), 10 (1 photographs)"), "{models}");
        assert!(
            photographs.ends_with("images: 1 photograph has no pose and is not used, 2 have one (without is 1.png)")
        );
        // By its path, another one; of equal ones the first.
        let chosen = Scene::open(folder.join("sparse/0")).expect("the model");
        assert_eq!((names(&chosen), chosen.warnings.len()), (vec!["1"], 2));
        model(&folder, "0", &ALL, is_text);
        model(&folder, "10", &ALL, is_text);
        let scene = open(&folder);
        assert_eq!(scene.views.len(), 3);
        assert!(scene.warnings.len() == 1 && scene.warnings[0].contains("sparse/0: this model has 3"));
    }
}

#[test]
fn names_of_images_are_paths_of_any_system() {
    let folder = colmap_binary();
    folder.image("images/left/1.png", 16, 12).image("images/left/2.png", 16, 12);
    folder.write("sparse/0/images.bin", images_binary(&[(1, 7, "left\\1.png"), (2, 7, "./left/2.png")]));
    let scene = open(&folder);
    assert_eq!(names(&scene), ["2", "1"]);
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.contains("2 photographs have no pose"), "{warning}");
}

#[test]
fn text_without_the_lines_of_points_is_read() {
    let folder = colmap_text();
    let text = images_text(&IMAGES).replace("1.5 2.5 -1 3 4 1\n", "");
    folder.write("sparse/0/images.txt", &text);
    assert_eq!(open(&folder).views.len(), 2);
    // As COLMAP writes an image in which nothing was found.
    folder.write("sparse/0/images.txt", images_text(&IMAGES).replace("1.5 2.5 -1 3 4 1\n", "\n"));
    assert_eq!(open(&folder).views.len(), 2);
}

#[test]
fn every_camera_model_is_read() {
    // Parameters count from 1 after focal lengths and principal point, so that each coefficient shows where it went.
    let perspective = Projection::Perspective;
    type Case = (u32, &'static str, usize, usize, Projection, [f64; 9]);
    let cases: [Case; 11] = [
        (0, "SIMPLE_PINHOLE", 1, 0, perspective, [0.0; 9]),
        (1, "PINHOLE", 2, 0, perspective, [0.0; 9]),
        (2, "SIMPLE_RADIAL", 1, 1, perspective, [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (3, "RADIAL", 1, 2, perspective, [0.1, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (4, "OPENCV", 2, 4, perspective, [0.1, 0.2, 0.0, 0.0, 0.0, 0.0, 0.3, 0.4, 0.0]),
        (5, "OPENCV_FISHEYE", 2, 4, Projection::Fisheye, [0.1, 0.2, 0.3, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (6, "FULL_OPENCV", 2, 8, perspective, [0.1, 0.2, 0.5, 0.6, 0.7, 0.8, 0.3, 0.4, 0.0]),
        (8, "SIMPLE_RADIAL_FISHEYE", 1, 1, Projection::Fisheye, [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (9, "RADIAL_FISHEYE", 1, 2, Projection::Fisheye, [0.1, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (14, "SIMPLE_FISHEYE", 1, 0, Projection::Fisheye, [0.0; 9]),
        (15, "FISHEYE", 2, 0, Projection::Fisheye, [0.0; 9]),
    ];
    for (id, name, focal_count, coefficient_count, projection, expected) in cases {
        let mut parameters = vec![40.0, 48.0][..focal_count].to_vec();
        parameters.extend([15.0, 13.0]);
        parameters.extend((1..=coefficient_count).map(|index| f64::from(index as u32) / 10.0));
        let camera = Camera(7, id, name, parameters);
        let (text, binary) = (colmap_text(), colmap_binary());
        text.write("sparse/0/cameras.txt", cameras_text(std::slice::from_ref(&camera)));
        binary.write("sparse/0/cameras.bin", cameras_binary(&[camera]));
        for folder in [text, binary] {
            let scene = open(&folder);
            let view = &scene.views[0];
            let focal_y = if focal_count == 1 { 20.0 } else { 24.0 };
            assert_eq!((view.camera.pinhole.focal(), view.camera.pinhole.principal()), ([20.0, focal_y], [7.5, 6.5]));
            match view.lens {
                None => assert_eq!((coefficient_count, projection), (0, perspective), "{name}"),
                Some(lens) => {
                    assert_eq!(lens.projection(), projection, "{name}");
                    let found = lens.coefficients();
                    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{name}: {found:?}");
                }
            }
        }
    }
}

#[test]
fn models_that_are_not_read_are_named() {
    for (id, name, title) in [
        (7, "FOV", "FOV (7)"),
        (10, "THIN_PRISM_FISHEYE", "THIN_PRISM_FISHEYE (10)"),
        (17, "EQUIRECTANGULAR", "EQUIRECTANGULAR (17)"),
        (4711, "NONSENSE", "4711"),
    ] {
        let camera = Camera(7, id, name, vec![40.0, 48.0, 15.0, 13.0, 0.1]);
        let (text, binary) = (colmap_text(), colmap_binary());
        text.write("sparse/0/cameras.txt", cameras_text(std::slice::from_ref(&camera)));
        binary.write("sparse/0/cameras.bin", cameras_binary(&[camera]));
        let said = format!("camera model {name} is not supported");
        assert_refused(&text, "sparse/0/cameras.txt:2: ", &[&said, "OPENCV_FISHEYE"]);
        assert_refused(
            &binary,
            "sparse/0/cameras.bin: byte 8: ",
            &[&format!("camera model {title} is not"), "PINHOLE"],
        );
    }
}

#[test]
fn damaged_text_is_told_by_its_line() {
    let refused = |name: &str, text: String, begins: &str, parts: &[&str]| {
        let folder = colmap_text();
        folder.write(&format!("sparse/0/{name}"), text);
        assert_refused(&folder, &format!("sparse/0/{name}{begins}"), parts);
    };
    let cameras = cameras_text(&[pinhole()]);
    refused("cameras.txt", cameras.replace("48", "forty"), ":2: \"forty\" is not a number", &[]);
    refused("cameras.txt", cameras.replace("48", "NaN"), ":2: \"NaN\" is not a finite number", &[]);
    refused("cameras.txt", cameras.replace(" 48", ""), ":2: found 3 parameters", &["instead of 4"]);
    refused("cameras.txt", cameras.replace("7 PIN", "-7 PIN"), ":2: \"-7\" is not a whole number", &[]);
    refused("cameras.txt", cameras.replace("32 24", "32 0"), ":2: image size 32 x 0", &[]);
    refused("cameras.txt", format!("{cameras}{}", &cameras[12..]), ":3: there are two cameras with the number 7", &[]);
    let images = images_text(&IMAGES);
    refused("images.txt", images.replace(" 7 b", " 8 b"), ":4: there is no camera with the number 8", &[]);
    refused("images.txt", images.replace("12 0.5", "11 0.5"), ":2: there are two images with the number 11", &[]);
    refused("images.txt", images.replace("12 0.5 -0.5", "12 0.9 -0.5"), ":4: not a camera pose", &["scaled"]);
    refused("images.txt", images.replace(" 7 b 2.png", ""), ":4: found 8 words of an image instead of 10", &[]);
    refused("images.txt", "# nothing\n".to_owned(), ": the scene has no photographs", &[]);
    let twice = images.replace("b 10.png", "c/b 2.png");
    let folder = colmap_text();
    folder.image("images/c/b 2.png", 16, 12).write("sparse/0/images.txt", &twice);
    assert_eq!(names(&open(&folder)), ["images_b 2", "c_b 2"]);
    refused("points3D.txt", points_text().replace("0.25 12", "0.25"), ":2: found 13 words", &[]);
    refused(
        "points3D.txt",
        points_text().replace("1 0 0 0", "1 0 inf 0").replace("5 0 0 0", "5 0 inf 0"),
        ":3: \"inf\"",
        &[],
    );
}

#[test]
fn damaged_binaries_are_told_by_their_byte() {
    let refused = |name: &str, bytes: Vec<u8>, parts: &[&str]| {
        let folder = colmap_binary();
        folder.write(&format!("sparse/0/{name}"), bytes);
        assert_refused(&folder, &format!("sparse/0/{name}: "), parts);
    };
    let cameras = cameras_binary(&[pinhole()]);
    refused("cameras.bin", cameras[..40].to_vec(), &["ends after 40 bytes, inside the parameters of a camera"]);
    refused("cameras.bin", [&cameras[..], b"x"].concat(), &["1 bytes are left over"]);
    let mut many = cameras.clone();
    many[..8].copy_from_slice(&u64::MAX.to_le_bytes());
    refused("cameras.bin", many, &["byte 0: announces 18446744073709551615 cameras; the file has room for 2"]);
    let mut nan = cameras.clone();
    nan[32..40].copy_from_slice(&f64::NAN.to_le_bytes());
    refused("cameras.bin", nan, &["byte 32: \"NaN\" is not a finite number"]);
    refused("cameras.bin", cameras_binary(&[pinhole(), pinhole()]), &["two cameras with the number 7"]);
    refused("images.bin", images_binary(&[(1, 8, "b 2.png")]), &["there is no camera with the number 8"]);
    refused("images.bin", images_binary(&[]), &["no photographs"]);
    let images = images_binary(&IMAGES);
    refused("images.bin", images[..images.len() - 5].to_vec(), &["announces 1 points in an image", "room for 0"]);
    refused("images.bin", images[..20].to_vec(), &["byte 0: announces 2 images", "room for 0"]);
    let mut name = images.clone();
    name[8 + 4 + 56 + 4] = 0xff;
    refused("images.bin", name, &["the name of an image is not UTF-8"]);
    let points = points_binary();
    refused("points3D.bin", points[..points.len() - 1].to_vec(), &["room for 0"]);
}
