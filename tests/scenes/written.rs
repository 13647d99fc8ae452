//! Scenes written out in every layout that can hold them, and read back the same.

mod neus;

use super::made::*;
use glam::DVec3;
use serde_json::json;
use std::path::Path;
use viewfuse::job::progress::Silent;
use viewfuse::scene::write::{Layout, WriteSceneError, Written, write};
use viewfuse::scene::{MaskChoice, MaskMeaning, Scene, Split, View};
use viewfuse_core::lens::{Lens, Projection};
use viewfuse_tests::command::{names_in, toy};
use viewfuse_tests::listener::Listener;
use viewfuse_tests::scenes::{self, Folder};

fn written(scene: &Scene, layout: Layout) -> (Folder, Scene, Written) {
    let folder = Folder::new();
    let path = folder.join("out");
    let written = write(scene, layout, &path, &Silent).unwrap_or_else(|error| panic!("{error}"));
    let read = Scene::open(&path).unwrap_or_else(|error| panic!("{layout}: {error}"));
    assert_eq!(read.layout, layout.reader());
    // Half a photograph, as masks are below, may be an object.
    let warnings: Vec<_> =
        read.warnings.iter().filter(|line| !line.contains("if they show the object instead")).collect();
    assert!(warnings.is_empty(), "{warnings:?}");
    (folder, read, written)
}

/// The cameras are the same to rounding in f32, the photographs to the bit.
#[track_caller]
fn assert_same(layout: Layout, scene: &Scene, read: &Scene) {
    assert_eq!(names(read), names(scene), "{layout}");
    assert_same_photographs(layout, scene, read);
    for (a, b) in scene.views.iter().zip(&read.views) {
        let numbers = |view: &View| {
            let pinhole = view.camera.pinhole;
            let pose = view.camera.pose.to_opencv().into_iter().flatten();
            pose.chain(pinhole.focal()).chain(pinhole.principal()).collect::<Vec<f32>>()
        };
        for (a, b) in numbers(a).into_iter().zip(numbers(b)) {
            assert!((a - b).abs() <= 2e-7 * (1.0 + a.abs()), "{layout}: {a} and {b}");
        }
    }
}

#[track_caller]
fn assert_same_photographs(layout: Layout, scene: &Scene, read: &Scene) {
    for (index, (a, b)) in scene.views.iter().zip(&read.views).enumerate() {
        assert_eq!(a.image.is_some(), b.image.is_some(), "{layout}");
        if a.image.is_some() {
            assert_eq!(scene.photograph(index).expect("one"), read.photograph(index).expect("the other"), "{layout}");
        }
    }
}

/// LLFF's scene, whose second camera stands elsewhere.
fn llff_of_two_places() -> Folder {
    let folder = llff();
    let mut second = llff_row();
    (second[3], second[8]) = (1.25, 2.5);
    folder.write("poses_bounds.npy", npy(&[2, 17], &[llff_row(), second].concat()));
    folder
}

/// Centre and radius of the unit sphere of a NeuS scene in the coordinates of the files that it was written from.
fn sphere(folder: &Path) -> (DVec3, f64) {
    let file = std::fs::File::open(folder.join("cameras_sphere.npz")).expect("an archive");
    let mut archive = zip::ZipArchive::new(file).expect("an archive");
    let index = (0..archive.len())
        .find(|index| archive.by_index(*index).expect("an entry").name().expect("a name").starts_with("scale_mat_"));
    let mut bytes = Vec::new();
    std::io::copy(&mut archive.by_index(index.expect("a sphere")).expect("an entry"), &mut bytes).expect("bytes");
    let numbers: Vec<f64> =
        bytes[bytes.len() - 128..].as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect();
    assert_eq!((numbers[0], numbers[1], numbers[15]), (numbers[5], 0.0, 1.0));
    (DVec3::new(numbers[3], numbers[7], numbers[11]), numbers[0])
}

/// Every view sees points of the world where it saw them before, in the coordinates of the unit sphere, and the sphere
/// is where the cameras look.
#[track_caller]
fn assert_same_in_the_sphere(scene: &Scene, read: &Scene) {
    assert_eq!(names(read), names(scene));
    assert_same_photographs(Layout::Neus, scene, read);
    let (centre, radius) = sphere(&read.path);
    for (a, b) in scene.views.iter().zip(&read.views) {
        for offset in [DVec3::ZERO, DVec3::new(0.4, -0.3, 0.2), DVec3::new(-0.1, 0.5, 0.6)] {
            let before = a.camera.project(scene.frame.world(centre + radius * offset).as_vec3());
            let after = b.camera.project(read.frame.world(offset).as_vec3());
            let pixels = [before.x - after.x, before.y - after.y].map(f32::abs);
            assert!(pixels.into_iter().all(|error| error < 1e-3), "{before:?} {after:?}");
            let depths = [before.depth * scene.frame.scale as f32, after.depth * (radius * read.frame.scale) as f32];
            assert!((depths[0] - depths[1]).abs() < 1e-5 * depths[0].abs(), "{depths:?}");
        }
    }
}

#[test]
fn every_layout_that_can_hold_a_scene_gives_it_back() {
    // One focal length, the principal point in the centre, near and far: all layouts hold it.
    let folder = llff_of_two_places();
    let scene = open(&folder);
    for layout in Layout::ALL {
        let (_folder, read, written) = written(&scene, layout);
        match layout {
            Layout::Neus => assert_same_in_the_sphere(&scene, &read),
            _ => assert_same(layout, &scene, &read),
        }
        assert_eq!(written.photograph_count, 2);
        let kept = read.views[1].near_far == Some([0.5, 9.5]);
        assert_eq!(kept, layout == Layout::Llff);
        assert_eq!(written.lost.iter().any(|line| line.contains("near and far depths of 2 views")), !kept);
        // Of a whole scene the sphere holds what the cameras look at.
        let is_cut = written.lost.iter().any(|line| line.contains("within that sphere"));
        assert_eq!(is_cut, layout == Layout::Neus, "{layout}: {:?}", written.lost);
    }
    // NeRF's own program takes one focal length for all.
    let mut second = llff_row();
    (second[3], second[8], second[14]) = (1.25, 2.5, 176.0);
    folder.write("poses_bounds.npy", npy(&[2, 17], &[llff_row(), second].concat()));
    let scene = open(&folder);
    for layout in [Layout::Llff, Layout::Transforms] {
        let (_folder, read, written) = written(&scene, layout);
        assert_same(layout, &scene, &read);
        let is_told = written.lost.iter().any(|line| line.contains("takes the first photograph's for all"));
        assert_eq!(is_told, layout == Layout::Llff, "{:?}", written.lost);
    }
}

/// A layout without a list has the order of its files, which indices of views count in.
#[test]
fn another_order_of_the_views_is_told() {
    let mut scene = Scene::open(viewfuse_tests::places::data("toy")).expect("the sample");
    for is_reversed in [false, true] {
        for layout in [Layout::Transforms, Layout::Middlebury, Layout::Srn, Layout::ColmapBinary] {
            let (_folder, read, written) = written(&scene, layout);
            let is_told = written.lost.iter().any(|line| line.starts_with("the order of the views"));
            let has_list = matches!(layout, Layout::Transforms | Layout::Middlebury);
            assert_eq!((is_told, names(&read) != names(&scene)), (is_reversed && !has_list, is_told), "{layout}");
        }
        scene.views.reverse();
    }
}

#[test]
fn points_and_poses_without_photographs() {
    let folder = colmap_text();
    let scene = open(&folder);
    for layout in [Layout::Colmap, Layout::ColmapBinary] {
        let mut scene = scene.clone();
        if layout == Layout::Colmap {
            scene.views.iter_mut().for_each(|view| view.name = view.name.replace(' ', "_"));
        }
        let (folder, read, written) = self::written(&scene, layout);
        assert_same(layout, &scene, &read);
        assert_eq!(read.points, scene.points);
        let lost = written.lost.join(", ");
        assert!(lost.starts_with("where features were found") && written.lost.len() == 1, "{lost}");
        let is_binary = folder.join("out/sparse/0/cameras.bin").exists();
        assert_eq!(is_binary, layout == Layout::ColmapBinary);
        // A point behind a camera has no place in its photograph.
        let seen_by = scene.points[0].views.clone();
        let camera = &scene.views[seen_by[0] as usize].camera.pose;
        scene.points[0].position_world = camera.centre_world() - camera.forward_world();
        let (_folder, read, _) = self::written(&scene, layout);
        let is_before =
            |view: &u32| scene.views[*view as usize].camera.project(scene.points[0].position_world).depth > 0.0;
        let before: Vec<u32> = seen_by.iter().copied().filter(is_before).collect();
        assert_eq!(read.points[0].views, before);
        assert!(before.len() < seen_by.len());
    }
    let (_folder, read, written) = self::written(&scene, Layout::Transforms);
    assert_same(Layout::Transforms, &scene, &read);
    assert_eq!((read.points.len(), written.lost), (0, vec!["2 reconstructed points".to_owned()]));

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
        // Half the photograph: an ignore mask, unless a person says otherwise.
        for layout in [Layout::Transforms, Layout::Colmap, Layout::ColmapBinary] {
            let ignoring = open(&folder);
            let (_folder, read, _) = written(&ignoring, layout);
            assert_same(layout, &ignoring, &read);
            assert_eq!(read.masks, MaskMeaning::Ignore);
        }
        let scene = Scene::open_masked(&folder, MaskChoice::Object).expect("a scene");
        assert!(scene.views[0].lens.is_some() && scene.views[0].mask.is_some());
        for layout in [Layout::Transforms, Layout::Colmap, Layout::ColmapBinary] {
            let (_folder, read, written) = written(&scene, layout);
            assert_same(layout, &scene, &read);
            assert_eq!(read.views[0].lens, scene.views[0].lens);
            let split = (layout == Layout::Transforms).then_some(Split::Train);
            assert_eq!((read.views[0].split, written.lost.is_empty()), (split, split.is_some()));
        }
        // Others hold the pinhole's picture.
        let (_folder, read, written) = written(&scene, Layout::Srn);
        let (before, after) = (scene.photograph(0).expect("one"), read.photograph(0).expect("the other"));
        assert_eq!((&before.pixels, before.has_alpha), (&after.pixels, after.has_alpha));
        assert!(read.views[0].lens.is_none() && read.views[0].mask.is_none());
        // NeuS has its masks beside the photographs.
        let (folder, read, in_sphere) = self::written(&scene, Layout::Neus);
        assert!(!in_sphere.lost.iter().any(|line| line.contains("within that sphere")), "{:?}", in_sphere.lost);
        let after = read.photograph(0).expect("the other");
        assert!(before.pixels == after.pixels && after.has_alpha && read.views[0].lens.is_none());
        assert_eq!(read.views[0].mask, Some(folder.join("out/mask/1.png")));
        assert!(written.lost.iter().any(|line| line.contains("the lens of 1 photographs")));
    }
}

#[test]
fn a_lens_that_a_layout_has_not_is_undone() {
    let folder = through_a_lens("OPENCV", -0.1);
    let text = std::fs::read_to_string(folder.file("transforms.json")).expect("a file").replace("\"k2\"", "\"k4\"");
    folder.write("transforms.json", text);
    let scene = open(&folder);
    let [.., fourth] = scene.views[0].lens.expect("a lens").coefficients();
    assert_eq!(fourth, 0.01);
    let (_folder, read, given) = written(&scene, Layout::Transforms);
    assert_same(Layout::Transforms, &scene, &read);
    assert_eq!((read.views[0].lens, given.lost.is_empty()), (scene.views[0].lens, true));
    for layout in [Layout::Colmap, Layout::ColmapBinary] {
        let (_folder, read, given) = written(&scene, layout);
        let (before, after) = (scene.photograph(0).expect("one"), read.photograph(0).expect("the other"));
        assert!(before.pixels == after.pixels && read.views[0].lens.is_none() && read.views[0].mask.is_some());
        assert!(given.lost.iter().any(|line| line.contains("the lens of 1 photographs")), "{:?}", given.lost);
    }
    // No layout has both OpenCV's denominator and the polynomial's fourth coefficient.
    let mut both = scene.clone();
    let coefficients = [-0.1, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.01];
    both.views[0].lens = Lens::new(Projection::Perspective, coefficients).ok();
    let (_folder, read, given) = written(&both, Layout::Transforms);
    assert_eq!((read.views[0].lens, given.lost.len()), (None, 1));
}

/// Other programs look for the model at the top of the file, and know one for all frames.
#[test]
fn a_lens_of_all_frames_is_said_once() {
    let top = |folder: &Folder| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(folder.join("out/transforms.json")).expect("a file")).expect("JSON")
    };
    for (model, name, fisheye) in [("OPENCV", "OPENCV", None), ("OPENCV_FISHEYE", "OPENCV_FISHEYE", Some(true))] {
        let of_all = through_a_lens(model, 0.05);
        let (folder, ..) = written(&open(&of_all), Layout::Transforms);
        let top = top(&folder);
        assert_eq!(top["camera_model"], name);
        assert_eq!(
            (top["is_fisheye"].as_bool(), &top["frames"][0]["camera_model"]),
            (fisheye, &serde_json::Value::Null)
        );
    }
    // OpenCV's rational lens is none of theirs, and neither is a fisheye beside a pinhole.
    let folders = ["FULL_OPENCV", "OPENCV_FISHEYE"].map(|model| through_a_lens(model, 0.05));
    let [mut rational, mut mixed] = folders.each_ref().map(open);
    rational.views[0].lens = Lens::new(Projection::Perspective, [0.05, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0]).ok();
    let mut beside = mixed.views[0].clone();
    (beside.lens, beside.name) = (None, "2".to_owned());
    mixed.views.push(beside);
    for scene in [rational, mixed] {
        let (folder, read, given) = written(&scene, Layout::Transforms);
        assert!(read.views.iter().all(|view| view.lens.is_none()));
        assert!(given.lost.iter().any(|line| line.contains("the lens of 1 photographs")), "{:?}", given.lost);
        assert_eq!(top(&folder)["camera_model"], serde_json::Value::Null);
    }
}

/// COLMAP and nerfstudio want a PNG of the photograph's size for each photograph, if there is one for any.
#[test]
fn ignore_masks_are_those_that_other_programs_read() {
    let folder = Folder::new();
    let mut frames = Vec::new();
    for (view, mask) in [("1", Some([16, 12])), ("2", Some([8, 6])), ("3", None), ("4", Some([16, 12]))] {
        let pixels = image::RgbImage::from_fn(16, 12, |x, y| image::Rgb([15 * x as u8, 20 * y as u8, 77]));
        pixels.save(folder.file(&format!("images/{view}.png"))).expect("a photograph");
        let mut frame =
            json!({ "file_path": format!("images/{view}.png"), "transform_matrix": scenes::opengl_matrix() });
        frame["transform_matrix"][0][3] = json!(view.parse::<f64>().expect("a number"));
        if let Some([width, height]) = mask {
            let ending = if view == "4" { "jpg" } else { "png" };
            let mask =
                image::GrayImage::from_fn(width, height, |x, _| image::Luma([if 8 * x < width { 0 } else { 255 }]));
            mask.save(folder.file(&format!("masks/{view}.{ending}"))).expect("a mask");
            frame["mask_path"] = json!(format!("masks/{view}.{ending}"));
        }
        frames.push(frame);
    }
    folder.write("transforms.json", json!({ "fl_x": 20, "frames": frames }).to_string());
    let scene = Scene::open_masked(&folder, MaskChoice::Ignore).expect("a scene");
    for layout in [Layout::Transforms, Layout::Colmap, Layout::ColmapBinary] {
        let (folder, read, _) = written(&scene, layout);
        let read = Scene::open_masked(&read.path, MaskChoice::Ignore).expect("a scene");
        for (view, name) in ["1", "2", "3", "4"].iter().enumerate() {
            let mask = image::open(folder.join(format!("out/masks/{name}.png.png"))).expect("a mask").into_luma8();
            assert_eq!(mask.dimensions(), (16, 12), "{name}");
            assert_eq!(scene.photograph(view).expect("one").seen, read.photograph(view).expect("one").seen, "{name}");
            assert_eq!(mask.as_raw().contains(&0), *name != "3");
        }
    }
}

/// Masks that look like an object's, of which a person says that they are not.
#[test]
fn a_meaning_that_a_person_gives_must_be_given_again() {
    let folder = through_a_lens("OPENCV", 0.05);
    let mask = image::GrayImage::from_fn(16, 12, |x, y| {
        image::Luma([if (5..11).contains(&x) && (3..9).contains(&y) { 255 } else { 0 }])
    });
    mask.save(folder.file("masks/1.png")).expect("a mask");
    let scene = Scene::open_masked(&folder, MaskChoice::Ignore).expect("a scene");
    let said =
        |layout| written(&scene, layout).2.lost.iter().any(|line| line.contains("which must be said of this folder"));
    // As transparency, too, they look like an object's.
    assert!(said(Layout::Colmap) && said(Layout::Transforms) && said(Layout::Srn));
}

#[test]
fn what_a_layout_cannot_hold_is_refused_and_leaves_nothing() {
    let folder = Folder::new();
    let path = folder.join("out");
    let refused = |scene: &Scene, layout: Layout, part: &str| {
        let error = write(scene, layout, &path, &Silent).expect_err("unfit");
        assert!(matches!(error, WriteSceneError::Unfit { .. }), "{error}");
        let message = error.to_string();
        assert!(message.contains(part) && message.contains(&format!("the layout {layout} cannot hold")), "{message}");
        assert_eq!(std::fs::read_dir(&folder).expect("a folder").count(), 0);
    };
    let (srn, colmap) = (scenes::srn(), colmap_text());
    for layout in Layout::ALL.into_iter().filter(|layout| *layout != Layout::Srn) {
        refused(&open(&srn), layout, "view \"target_1\" is a pose without a photograph");
    }
    refused(&open(&colmap), Layout::Srn, "two focal lengths, 20 and 24");
    refused(&open(&colmap), Layout::Middlebury, "has a blank in it");
    refused(&open(&colmap), Layout::Colmap, "where other programs end a name of the text form; colmap-binary holds it");
    refused(&open(&colmap), Layout::Llff, "not in the order of their names");
    refused(&open(&scenes::middlebury()), Layout::Llff, "two focal lengths");
    // A photograph that cannot be read leaves nothing either.
    let broken = through_a_lens("OPENCV", 0.1);
    let scene = open(&broken);
    broken.write("images/1.png", "no image");
    assert!(matches!(write(&scene, Layout::Srn, &path, &Silent), Err(WriteSceneError::Scene(_))));
    let (scene, stopping) = (open(&colmap), Listener::stops_after(0));
    assert!(matches!(write(&scene, Layout::ColmapBinary, &path, &stopping), Err(WriteSceneError::Interrupted(_))));
    assert_eq!(std::fs::read_dir(&folder).expect("a folder").count(), 0);
    // What is there stays; an empty folder is filled.
    folder.write("out/mine.txt", "mine");
    assert!(matches!(write(&scene, Layout::ColmapBinary, &path, &Silent), Err(WriteSceneError::Occupied { .. })));
    folder.remove("out/mine.txt");
    assert_eq!(write(&scene, Layout::ColmapBinary, &path, &Silent).expect("written").photograph_count, 2);
    assert!("nerf".parse::<Layout>().expect_err("none").to_string().contains("transforms, colmap, colmap-binary, srn"));
}

/// Names that file systems hold, and the layouts that do not.
fn hostile_names() -> Vec<(String, Vec<Layout>)> {
    let lists = || vec![Layout::Srn, Layout::Llff, Layout::Neus];
    let lines = || vec![Layout::Colmap, Layout::Middlebury];
    let held = "plain a.b a.png dot. quote\"' #comment 1 -3 007 target_1 x_par.txt \u{e9} e\u{301} \u{feff}bom a,b;c \
                %E9 {json} \u{1b}[2J \u{7f} *?$(rm) CON images nan";
    let mut all: Vec<(String, Vec<Layout>)> = held.split(' ').map(|name| (name.to_owned(), Vec::new())).collect();
    all.push(("x".repeat(240), Vec::new()));
    all.push(("x".repeat(241), Layout::ALL.to_vec()));
    all.extend([".hidden", "..", "..."].map(|name| (name.to_owned(), lists())));
    all.extend(["line\nbreak", "a\rb", "\ta", " leading", "\u{2003}em"].map(|name| (name.to_owned(), lines())));
    all.extend(["a b", "trailing ", "\u{2028}", "a\tb"].map(|name| (name.to_owned(), lines())));
    if cfg!(unix) {
        let lists = vec![Layout::Transforms, Layout::Colmap, Layout::ColmapBinary, Layout::Middlebury];
        all.push(("back\\slash".to_owned(), lists));
    }
    all
}

/// Every layout gives a scene of hostile names back, or refuses it and leaves nothing.
#[test]
fn hostile_names_are_given_back_or_refused() {
    let folder = llff_of_two_places();
    let plain = open(&folder);
    for (index, view) in plain.views.iter().enumerate() {
        let level = 90 * index as u8;
        let path = view.image.as_ref().expect("a photograph");
        image::RgbImage::from_pixel(16, 12, image::Rgb([level; 3])).save(path).expect("a picture of its own");
    }
    for (name, refused_by) in hostile_names() {
        let mut scene = plain.clone();
        // In the order of their files, which LLFF's layout keeps.
        let mut names = [name.clone(), "m".to_owned()];
        names.sort_by_key(|name| format!("{name}.png"));
        scene.views.iter_mut().zip(names).for_each(|(view, name)| view.name = name);
        for layout in Layout::ALL {
            let out = Folder::new();
            let path = out.join("out");
            match write(&scene, layout, &path, &Silent) {
                Ok(_) => {
                    assert!(!refused_by.contains(&layout), "{layout}: {name:?} was to be refused");
                    let read = Scene::open(&path).unwrap_or_else(|error| panic!("{layout}: {error}"));
                    assert_eq!(read.views.len(), 2, "{layout}: {name:?}");
                    for (index, view) in scene.views.iter().enumerate() {
                        let back = read.views.iter().position(|known| known.name == view.name);
                        let back = back.unwrap_or_else(|| panic!("{layout}: {name:?}: {:?}", self::names(&read)));
                        assert_eq!(scene.photograph(index).ok(), read.photograph(back).ok(), "{layout}: {name:?}");
                        let centre = |scene: &Scene, view: usize| scene.views[view].camera.pose.centre_world();
                        let moved = centre(&scene, index).distance(centre(&read, back));
                        assert!(layout == Layout::Neus || moved < 1e-5, "{layout}: {name:?} by {moved}");
                    }
                }
                Err(error) => {
                    assert!(refused_by.contains(&layout), "{layout}: {error}");
                    assert!(error.to_string().contains(&format!("the name {name:?}")), "{error}");
                    assert_eq!(std::fs::read_dir(&out).expect("a folder").count(), 0, "{layout}: {name:?}");
                }
            }
        }
    }
}

/// What no rule of names foresees is found when the files are read back: LLFF's rows are in the order of the files.
#[test]
fn poses_of_other_photographs_are_not_written() {
    let folder = llff_of_two_places();
    let mut scene = open(&folder);
    // In the order of their files, `a-b.png` comes before `a.png`: these can be written.
    scene.views.iter_mut().zip(["a-b", "a"]).for_each(|(view, name)| view.name = name.to_owned());
    assert_same(Layout::Llff, &scene, &written(&scene, Layout::Llff).1);
    // `a.b.png` comes before `a.png`, too.
    scene.views.iter_mut().zip(["a", "a.b"]).for_each(|(view, name)| view.name = name.to_owned());
    let out = Folder::new();
    let error = write(&scene, Layout::Llff, &out.join("out"), &Silent).expect_err("another order");
    assert!(error.to_string().contains("is read back with the pose of another"), "{error}");
    assert_eq!(std::fs::read_dir(&out).expect("a folder").count(), 0);
}
