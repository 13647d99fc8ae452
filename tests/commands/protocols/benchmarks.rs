//! Protocols of few-shot papers: the views they take, what they refuse, what is printed beside them.

use crate::{assert_refused, assert_wrong_arguments, done, list_of, number_of, read_json, text_of};
use image::{GrayImage, Luma};
use serde_json::{Value, json};
use std::path::Path;
use viewfuse::evaluate::protocol::{Draws, Job, Protocol};
use viewfuse::scene::dataset::Split;
use viewfuse::scene::{Scene, View};
use viewfuse_core::camera::Camera;
use viewfuse_lab::scenes::cameras::{random_views, sphere, spiral_views};
use viewfuse_lab::scenes::{render_with, toy::lorry};
use viewfuse_tests::command::{toy, toy_twice};
use viewfuse_tests::scenes::{self, Folder, npy};

viewfuse_tests::trials![
    llff_takes_every_eighth_view,
    views_are_counted_as_the_published_loaders_sort_them,
    dtu_takes_the_published_views,
    blender_takes_views_of_its_splits,
    blender_on_a_scene_in_its_layout,
    nearest_takes_the_nearest_cameras,
    tables_without_a_folder,
    json_is_the_table,
    nearest_with_targets,
    masks_serve_the_metric,
    published_figures_stand_beside_the_same_size,
];

const DRAWS: Draws = Draws { seed: 0, trial_count: 3, target_count: 4 };

fn sample() -> Scene {
    Scene::open(viewfuse_tests::places::data("toy")).expect("the sample scene")
}

/// A scene with views of these names, numbers and splits.
fn scene(views: impl IntoIterator<Item = (String, Option<Split>)>) -> Scene {
    let sample = sample();
    let view = |(name, split)| View { name, split, ..sample.views[0].clone() };
    Scene { views: views.into_iter().map(view).collect(), ..sample.clone() }
}

fn jobs(protocol: &str, scene: &Scene) -> Vec<Job> {
    let protocol: Protocol = protocol.parse().unwrap_or_else(|error| panic!("{protocol}: {error}"));
    let plan = protocol.plan(std::slice::from_ref(scene), DRAWS, 2);
    plan.unwrap_or_else(|error| panic!("{protocol}: {error}")).jobs
}

/// What a protocol says of a scene that it does not fit.
fn refusal(protocol: &str, scene: &Scene) -> String {
    let protocol: Protocol = protocol.parse().unwrap_or_else(|error| panic!("{protocol}: {error}"));
    protocol.plan(std::slice::from_ref(scene), DRAWS, 2).expect_err("it fits none").to_string()
}

fn names<'a>(scene: &'a Scene, views: &[usize]) -> Vec<&'a str> {
    views.iter().map(|&view| scene.views[view].name.as_str()).collect()
}

fn llff_takes_every_eighth_view() {
    let sample = sample();
    let all = jobs("llff:3", &sample);
    // 24 views; numpy.linspace(0, 20, 3) of the 21 others.
    assert_eq!(all, [Job { scene: 0, trial: 0, sources: vec![1, 12, 23], targets: vec![0, 8, 16] }]);
    assert_eq!(jobs("llff:21", &sample)[0].sources.len(), 21);
    let error = refusal("llff:22", &sample);
    assert!(
        error.ends_with("toy 24 photographs, of which every 8th is a target, leave 21 sources; 22 are needed"),
        "{error}"
    );
    // LLFF's fern has 20 photographs: the papers' 1, 10, 19.
    let fern = scene((0..20).map(|view| (format!("image{view:03}"), None)));
    assert_eq!(names(&fern, &jobs("llff:3", &fern)[0].sources), ["image001", "image010", "image019"]);
}

/// Twenty photographs, numbered from 1 without zeros in front. `sorted` of Python makes of their names 1, 10, 11 .. 19,
/// 2, 20, 3 .. 9, so that every eighth is 1, 17 and 6, and `linspace` takes of the others 10, 19 and 9.
fn views_are_counted_as_the_published_loaders_sort_them() {
    let sample = scenes::transforms();
    let matrix = &sample["frames"][0]["transform_matrix"];
    let photographs = |folder: &Folder| {
        (1..=20).for_each(|number| _ = folder.image(&format!("images/{number}.png"), 16, 12));
    };
    let transforms = Folder::new();
    photographs(&transforms);
    let frame = |number| json!({ "file_path": format!("images/{number}.png"), "transform_matrix": matrix });
    let mut file = sample.clone();
    file["frames"] = (1..=20).map(frame).collect();
    transforms.write("transforms.json", file.to_string());
    let colmap = Folder::new();
    photographs(&colmap);
    colmap.write("sparse/0/cameras.txt", "1 PINHOLE 16 12 20 24 7.5 6.5\n");
    let image = |number| format!("{number} 0.5 -0.5 -0.5 -0.5 -2 -3 -1 1 {number}.png\n\n");
    colmap.write("sparse/0/images.txt", (1..=20).map(image).collect::<String>());
    let llff = Folder::new();
    photographs(&llff);
    // Axes down, right, backwards, the centre; height, width, focal length; near and far.
    let row = [0., 0., -1., 1., 12., 0., 1., 0., 2., 16., 1., 0., 0., 3., 20., 0.5, 9.5];
    llff.write("poses_bounds.npy", npy(&[20, 17], &row.repeat(20)));
    for (folder, layout) in [(transforms, "transforms"), (colmap, "colmap"), (llff, "llff")] {
        let scene = Scene::open(folder.path()).unwrap_or_else(|error| panic!("{error}"));
        let [job] = &jobs("llff:3", &scene)[..] else { panic!("one job") };
        let mut sources = names(&scene, &job.sources);
        sources.sort_unstable();
        assert_eq!((scene.layout, names(&scene, &job.targets)), (layout, vec!["1", "17", "6"]));
        assert_eq!((sources, job.sources.is_sorted()), (vec!["10", "19", "9"], true), "{layout}");
        // A person sees them by number.
        let shown = if layout == "llff" { ["1", "10"] } else { ["1", "2"] };
        assert_eq!(names(&scene, &[0, 1]), shown);
    }
}

fn dtu_takes_the_published_views() {
    let part = [1, 3, 10, 13, 14, 16, 22, 24, 25, 27, 28, 29, 32, 34, 40, 44];
    let part = scene(part.map(|view| (format!("{view:06}"), None)));
    let job = &jobs("dtu:3", &part)[0];
    assert_eq!(names(&part, &job.sources), ["000022", "000025", "000028"]);
    // 3 and 16 are of wrong exposure, 13, 40 and 44 are sources of more.
    assert_eq!(
        names(&part, &job.targets),
        ["000001", "000010", "000014", "000024", "000027", "000029", "000032", "000034"]
    );
    assert!(refusal("dtu:9", &part).ends_with("toy has no source view 48, 0, 8"), "{}", refusal("dtu:9", &part));
    // All 49 by position, whatever their names: DTU's own count from 1 and end in the lighting.
    let whole = scene((0..49).map(|view| (format!("rect_{:03}_3_r5000", view + 1), None)));
    let job = &jobs("dtu:9", &whole)[0];
    assert_eq!(job.sources, [0, 8, 13, 22, 25, 28, 40, 44, 48]);
    assert_eq!((job.targets.len(), &job.targets[..3]), (25, &[1, 2, 9][..]));
    assert!(refusal("dtu:3", &sample()).contains("toy has no source view 25, 28"));
}

fn blender_takes_views_of_its_splits() {
    let views = |split, count: usize| (0..count).map(move |view| (format!("{split}_r_{view}"), Some(split)));
    let whole = scene(views(Split::Train, 100).chain(views(Split::Validation, 5)).chain(views(Split::Test, 200)));
    let job = &jobs("blender:8", &whole)[0];
    assert_eq!(job.sources, [2, 16, 26, 55, 73, 75, 86, 93]);
    assert_eq!((job.targets.len(), job.targets[0], job.targets[1], job.targets[24]), (25, 105, 113, 297));
    // A part of one, by the numbers of its names.
    let sources = [93, 2, 16, 26, 55, 73, 75, 86].map(|view| (format!("train_r_{view}"), Some(Split::Train)));
    let targets = [0, 4, 8, 192].map(|view| (format!("test_r_{view}"), Some(Split::Test)));
    let part = scene(sources.into_iter().chain(targets));
    let job = &jobs("blender:8", &part)[0];
    assert_eq!(job.sources, [0, 1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(names(&part, &job.targets), ["test_r_0", "test_r_8", "test_r_192"]);
    // Without splits it is refused, and what is missing is said.
    let error = refusal("blender:8", &sample());
    assert!(
        error.ends_with(
            "toy has no views of a training split and of a test split (transforms_train.json and transforms_test.json)"
        ),
        "{error}"
    );
    let half = scene(views(Split::Train, 100));
    assert!(refusal("blender:8", &half).contains("has no views of a test split"), "{}", refusal("blender:8", &half));
}

fn blender_on_a_scene_in_its_layout() {
    let folder = Folder::new();
    let sphere = sphere(48).expect("a sphere");
    let mut train: Vec<_> = (0..).zip(random_views(&sphere, 5, 0, 100).expect("cameras")).collect();
    train.retain(|(view, _)| [2, 16, 26, 55, 73, 75, 86, 93].contains(view));
    let mut test: Vec<_> = (0..).zip(spiral_views(&sphere, 200).expect("cameras")).collect();
    let validation = vec![test[7]];
    test.retain(|(view, _)| [0, 3, 40, 104].contains(view));
    let lorry = lorry();
    let angle = 2.0 * (f64::from(sphere.pinhole.width()) / 2.0 / f64::from(sphere.pinhole.focal()[0])).atan();
    for (split, views) in [("train", train), ("val", validation), ("test", test)] {
        let frame = |(number, camera): &(u32, Camera)| {
            let path = format!("./{split}/r_{number}");
            render_with(&lorry, camera, 2).save(folder.file(&format!("lorry/{path}.png"))).expect("a picture");
            json!({ "file_path": path, "transform_matrix": camera.pose.to_opengl() })
        };
        let frames: Vec<Value> = views.iter().map(frame).collect();
        let transforms = json!({ "camera_angle_x": angle, "frames": frames });
        folder.write(&format!("lorry/transforms_{split}.json"), transforms.to_string());
    }
    let scene = Scene::open(folder.join("lorry")).expect("a scene");
    let count = |split| scene.views.iter().filter(|view| view.split == Some(split)).count();
    assert_eq!([Split::Train, Split::Validation, Split::Test].map(count), [8, 1, 4]);
    assert!(scene.photograph(0).is_ok_and(|photograph| photograph.has_alpha));
    let expected = sphere.pinhole;
    assert!(scene.views.iter().all(|view| (view.camera.pinhole.focal()[0] - expected.focal()[0]).abs() < 1e-4));
    let whole = json(&folder, "lorry --protocol blender:8");
    assert_eq!(whole["jobs"][0]["targets"], json!(["test_r_0", "test_r_40", "test_r_104"]));
    assert_eq!(whole["settings"]["protocol"], "blender:8");
    let rows = list_of(&whole["tables"][0]["rows"]);
    let psnr = |row: usize| number_of(&rows[row]["cells"][0]["value"]["mean"]);
    // Of the object over white; a copy of a source is far worse.
    assert!(psnr(3) > psnr(0) + 3.0 && psnr(3) > 18.0, "{rows:?}");
    assert!(
        whole["published"]["withheld"].as_str().is_some_and(|why| why.contains("400x400")),
        "{}",
        whole["published"]
    );
}

fn nearest_takes_the_nearest_cameras() {
    let sample = sample();
    let all = jobs("nearest:4", &sample);
    assert_eq!(all.len(), 24);
    let distance = |a: usize, b: usize| sample.views[a].camera.pose.distance(&sample.views[b].camera.pose);
    for (view, job) in all.iter().enumerate() {
        assert_eq!((job.targets.as_slice(), job.sources.len()), (&[view][..], 4));
        let farthest = job.sources.iter().map(|&source| distance(source, view)).fold(0.0, f32::max);
        let others = (0..24).filter(|other| *other != view && !job.sources.contains(other));
        assert!(others.map(|other| distance(other, view)).all(|other| other >= farthest), "{job:?}");
    }
    let two: Vec<usize> = jobs("nearest:3:5,7", &sample).iter().map(|job| job.targets[0]).collect();
    assert_eq!(two, [5, 7]);
    assert!(refusal("nearest:24", &sample).contains("toy: 24 photographs, 25 are needed for 24 sources"));
}

/// The command's JSON.
fn json(folder: &Path, arguments: &str) -> Value {
    let text = done(folder, &format!("evaluate {arguments} --json --device cpu --weights mean --weights l1"));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{arguments}: {error}: {text}"))
}

fn tables_without_a_folder() {
    let scene = toy();
    let run = "evaluate toy --protocol llff:3 --size 32x32 --device cpu --weights mean --weights l1";
    let text = done(&scene, run);
    for part in [
        "toy, 32x32: targets 000000, 000008, 000016 from 000001, 000012, 000023\n",
        "metric: full: prediction and photograph over the run's background\n",
        "llff:3, sources: 3; 1 scene, 3 pictures of each scheme\n",
        "\n nearest copy ",
        "\n warped copy ",
        "\n warped blend ",
        "\n mean ",
        "±: 95 % intervals over 3 views of one scene; they say nothing about other scenes\n",
        "published figures are not shown: they are at 504x378, these pictures at 32x32 (LLFF, 3 sources, ",
    ] {
        assert!(text.contains(part), "no {part:?} in\n{text}");
    }
    assert_eq!(viewfuse_tests::command::names_in(&scene), ["toy"]);
    // The same numbers with a folder.
    let kept = done(&scene, &format!("{run} -o kept"));
    let rows = |text: &str| -> Vec<String> {
        let is_row = |line: &&str| line.starts_with(" nearest copy") || line.starts_with(" warped");
        text.lines().filter(is_row).map(str::to_owned).collect()
    };
    assert!(rows(&text).len() == 3 && rows(&text) == rows(&kept), "{text}\n{kept}");
    assert!(kept.contains("1 job done; 1 of 1 are in kept"), "{kept}");
    let record = read_json(scene.join("kept/run.json"));
    assert_eq!((&record["protocol"], &record["scenes"][0]["size"]), (&"llff:3".into(), &json!([32, 32])));
    assert!(record["metric"].as_str().is_some_and(|metric| metric.starts_with("full: ")), "{record}");
}

fn json_is_the_table() {
    let folder = toy_twice();
    let whole = json(&folder, "toy --protocol llff:3 --size 32x32");
    assert_eq!(whole["settings"]["protocol"], "llff:3");
    assert_eq!(whole["jobs"][0]["targets"], json!(["000000", "000008", "000016"]));
    let table = &whole["tables"][0];
    assert_eq!((&table["unit"], &table["target_count"]), (&"views".into(), &3.into()));
    let rows = list_of(&table["rows"]);
    let schemes: Vec<&str> = rows.iter().filter_map(|row| row["scheme"].as_str()).collect();
    assert_eq!(schemes, ["nearest copy", "warped copy", "warped blend", "mean", "l1"]);
    assert_eq!(rows[0]["is_baseline"], true);
    let psnr = &rows[3]["cells"][0]["value"];
    assert!(psnr["mean"].as_f64().is_some_and(|psnr| psnr > 5.0) && psnr["half_width"].is_f64(), "{psnr}");
    assert_eq!(table["comparisons"].as_array().map(Vec::len), Some(2 * 3));
    assert!(whole["published"]["withheld"].as_str().is_some_and(|why| why.contains("504x378")));
    // Without a protocol as well, a table a scene and one of all.
    let plain = json(&folder, "toy again --targets 20,21 --size 32x32");
    let titles: Vec<&str> = list_of(&plain["tables"]).iter().filter_map(|table| table["title"].as_str()).collect();
    assert_eq!(titles, ["toy: 2 targets", "again: 2 targets", "all 2 scenes: 4 targets"]);
    assert_eq!(plain["tables"][2]["unit"], "scenes");
}

fn nearest_with_targets() {
    let folder = toy();
    let whole = json(&folder, "toy --protocol nearest:3 --targets 5,7 --size 24x24");
    assert_eq!(whole["settings"]["protocol"], "nearest:3:5,7");
    assert_eq!(whole["jobs"].as_array().map(Vec::len), Some(2));
    assert!(whole["published"].is_null(), "{}", whole["published"]);
    assert_wrong_arguments(
        &folder,
        "evaluate toy --protocol llff:3 --targets 5",
        &["--targets cannot be used with --protocol llff:3", "nearest:K"],
    );
    assert_refused(&folder, "evaluate toy --protocol nearest:3 --targets 99", &["toy: has no view '99'"]);
    assert_refused(
        &folder,
        "evaluate toy --protocol blender:8",
        &["protocol 'blender:8' fits none of the scenes", "transforms_test.json"],
    );
}

/// The sample scene with the names of DTU's views, its photographs laid over black, and its silhouettes as masks beside
/// them if it is called `masked`, as their alpha channels if `cut`: there the first target's fills most of its border.
fn like_dtu(folder: &Folder, scene: &str) {
    let numbers = [1, 10, 14, 24, 27, 29, 22, 25, 28];
    let mut frames = Vec::new();
    let sample = sample();
    for (view, number) in sample.views.iter().zip(numbers) {
        let photograph = image::open(view.image.as_ref().expect("a photograph")).expect("a picture").into_rgba8();
        let name = format!("images/{number:06}.png");
        let over_black = image::RgbImage::from_fn(photograph.width(), photograph.height(), |x, y| {
            let pixel = photograph.get_pixel(x, y);
            image::Rgb([0, 1, 2].map(|c| (u32::from(pixel[c]) * u32::from(pixel[3]) / 255) as u8))
        });
        let path = folder.file(&format!("{scene}/{name}"));
        if scene == "cut" {
            let cut = image::RgbaImage::from_fn(photograph.width(), photograph.height(), |x, y| {
                let [red, green, blue] = over_black.get_pixel(x, y).0;
                let fills = number == 1 && x < 100;
                image::Rgba([red, green, blue, if fills { 255 } else { photograph.get_pixel(x, y)[3] }])
            });
            cut.save(path).expect("a picture");
        } else {
            over_black.save(path).expect("a picture");
        }
        let [fx, fy] = view.camera.pinhole.focal();
        let [cx, cy] = view.camera.pinhole.principal();
        let mut frame = json!({
            "file_path": name, "transform_matrix": view.camera.pose.to_opengl(), "fl_x": fx, "fl_y": fy, "cx": cx,
            "cy": cy,
            "w": photograph.width(), "h": photograph.height(),
        });
        if scene == "masked" {
            let mask = GrayImage::from_fn(photograph.width(), photograph.height(), |x, y| {
                Luma([photograph.get_pixel(x, y)[3]])
            });
            let name = format!("masks/{number:06}.png");
            mask.save(folder.file(&format!("{scene}/{name}"))).expect("a picture");
            frame["mask_path"] = name.into();
        }
        frames.push(frame);
    }
    folder.write(&format!("{scene}/transforms.json"), json!({ "frames": frames }).to_string());
}

fn masks_serve_the_metric() {
    let folder = Folder::new();
    ["masked", "cut", "bare"].into_iter().for_each(|scene| like_dtu(&folder, scene));
    let run = |scene: &str, protocol: &str| json(&folder, &format!("{scene} --protocol {protocol} --size 32x32"));
    let names = |whole: &Value| -> Vec<String> {
        let metrics = list_of(&whole["tables"][0]["metrics"]).clone();
        metrics.iter().map(|metric| text_of(&metric["label"]).to_owned()).collect()
    };
    let bare = run("bare", "dtu:3");
    assert_eq!(names(&bare), ["PSNR", "SSIM", "PSNR corrected"]);
    let masked = run("masked", "dtu:3");
    assert_eq!(names(&masked), ["PSNR full", "SSIM full", "PSNR corrected", "PSNR masked", "SSIM masked"]);
    assert_eq!((&masked["tables"][0]["headline"], &masked["settings"]["scenes"][0]["masks"]), (&3.into(), &9.into()));
    // Fields and the full metric see the photographs as if there were no masks.
    let full = |whole: &Value, row: usize| whole["tables"][0]["rows"][row]["cells"][0]["value"]["mean"].clone();
    let cut = run("cut", "dtu:3");
    assert_eq!(names(&cut), names(&masked));
    // Each target is scored by its silhouette.
    let counts = list_of(&cut["tables"][0]["rows"][0]["cells"]).iter().map(|cell| &cell["value"]["count"]);
    assert!(counts.into_iter().all(|count| *count == 6), "{}", cut["tables"][0]["rows"][0]);
    for row in 0..5 {
        assert_eq!(full(&masked, row), full(&bare, row), "row {row}");
        assert_eq!(full(&cut, row), full(&bare, row), "row {row}, cut out");
    }
    // Given masks, they are sources with an alpha channel, over white.
    let given = run("masked", "dtu:3,masks=given");
    assert_eq!(given["settings"]["protocol"], "dtu:3,masks=given");
    assert_ne!(full(&given, 0), full(&bare, 0));
    assert_eq!(names(&given).len(), 5);
}

fn published_figures_stand_beside_the_same_size() {
    let folder = Folder::new();
    // Shaped as LLFF's photographs are, and large enough.
    let sample = sample();
    let frames: Vec<Value> = (0..10)
        .map(|view| {
            let name = format!("images/{view:03}.png");
            let colour = |x: u32, y: u32| {
                if (160..340).contains(&x) && (90..290).contains(&y) { [200, 90, x as u8] } else { [0; 3] }
            };
            let picture = image::RgbImage::from_fn(504, 378, |x, y| image::Rgb(colour(x, y)));
            picture.save(folder.file(&format!("fern/{name}"))).expect("a picture");
            json!({
                "file_path": name, "transform_matrix": sample.views[view].camera.pose.to_opengl(),
                "fl_x": 400.0, "fl_y": 400.0, "cx": 252.0, "cy": 189.0, "w": 504, "h": 378,
            })
        })
        .collect();
    folder.write("fern/transforms.json", json!({ "frames": frames }).to_string());
    let text = done(&folder, "evaluate fern --protocol llff:3 --device cpu --weights mean");
    for part in [
        "published for LLFF, 3 sources, 504x378, PSNR: means over the benchmark's 8 scenes (fern, flower, ",
        ", 1 of the 1 here among them",
        " RegNeRF ",
        "19.08",
        "a diffusion prior",
    ] {
        assert!(text.contains(part), "no {part:?} in\n{text}");
    }
}
