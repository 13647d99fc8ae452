//! `viewfuse inspect`: a good scene raises no warning, a bad one its own.

use super::{done, list_of, number_of, numbers, read_json, run, texts};
use serde_json::Value;
use viewfuse_tests::command::{change_poses, names_in, sample, toy};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    a_good_scene,
    draws_the_cameras,
    the_map_has_what_cameras_in_a_row_pass,
    bad_poses_are_told,
    a_scene_in_a_map,
    a_background_of_many_colours_is_a_fault_only_of_an_object,
    what_the_cameras_cover,
    the_quality_is_that_of_held_out_photographs,
    a_copy_tells_nothing_of_new_views,
    views_are_listed_with_their_neighbours,
    what_is_excluded_is_said_and_recorded,
    conventions_are_said_and_recorded,
];

fn inspection(folder: &Folder) -> Value {
    serde_json::from_str(&done(folder, "inspect toy --json")).expect("JSON")
}

/// Exactly one of the warnings holds this text; `others` says how many more there may be.
#[track_caller]
fn assert_warns(folder: &Folder, text: &str, others: usize) {
    let inspection = inspection(folder);
    let warnings = texts(&inspection["warnings"]);
    assert_eq!(warnings.iter().filter(|warning| warning.contains(text)).count(), 1, "{warnings:#?}");
    assert!(warnings.len() <= 1 + others, "{warnings:#?}");
    assert!(inspection["near"].as_f64() <= inspection["far"].as_f64(), "{inspection}");
    let printed = done(folder, "inspect toy");
    assert!(printed.lines().any(|line| line.starts_with("warning    ") && line.contains(text)), "{printed}");
}

fn a_good_scene() {
    let scene = toy();
    let inspection = inspection(&scene);
    assert_eq!(texts(&inspection["warnings"]), Vec::<&str>::new());
    assert_eq!((&inspection["layout"], &inspection["photograph_count"]), (&"srn".into(), &24.into()));
    assert_eq!((numbers(&inspection["size"]), numbers(&inspection["focal"])), (vec![128.0; 2], vec![131.25; 2]));
    assert!(numbers(&inspection["focus"]).iter().all(|x| x.abs() < 1.0e-4));
    assert!(numbers(&inspection["distances"]).iter().all(|distance| (distance - 1.3).abs() < 1.0e-4));
    let (near, far) = (number_of(&inspection["near"]), number_of(&inspection["far"]));
    assert!(0.5 < near && near < 1.3 && 1.3 < far && far < 2.0);
    let corners = list_of(&inspection["object"]);
    assert!(numbers(&corners[0]).iter().all(|x| *x < 0.0) && numbers(&corners[1]).iter().all(|x| *x > 0.0));
    assert!(done(&scene, "inspect toy").contains("warnings   none"));
}

fn views_are_listed_with_their_neighbours() {
    let scene = toy();
    let printed = done(&scene, "inspect toy --views");
    let lines: Vec<Vec<&str>> = printed.lines().map(|line| line.split_whitespace().collect()).collect();
    let row = lines.iter().find(|words| words.first() == Some(&"#3")).unwrap_or_else(|| panic!("{printed}"));
    assert_eq!(row[..3], ["#3", "000003", "128x128"], "{printed}");
    let listed: Value = serde_json::from_str(&done(&scene, "inspect toy --views --json")).expect("JSON");
    let listed = list_of(&listed);
    assert_eq!(listed.len(), 24);
    for (index, view) in listed.iter().enumerate() {
        assert_eq!((view["index"].as_u64(), view["has_photograph"].as_bool()), (Some(index as u64), Some(true)));
        let neighbours = list_of(&view["neighbours"]).iter();
        let angles = numbers(&neighbours.clone().map(|neighbour| neighbour["degrees"].clone()).collect());
        assert!(angles.len() == 3 && angles.is_sorted() && angles[0] > 0.0 && angles[2] < 90.0, "{view}");
        let others: Vec<u64> = neighbours.filter_map(|neighbour| neighbour["index"].as_u64()).collect();
        assert!(!others.contains(&(index as u64)), "{view}");
    }
    // By index, wherever views are named.
    let weights = |target: &str| done(&scene, &format!("weights toy --target {target} --sources 0..7"));
    assert_eq!(weights("#20"), weights("000020"));
    for (arguments, names) in [
        ("--targets #20,#22..#23 --sources #0..#7/2", vec!["000020.png", "000022.png", "000023.png"]),
        ("--between #20 #23 --frames 2 --sources 0..7", vec!["between-000.png", "between-001.png"]),
    ] {
        let render =
            format!("render toy {arguments} --size 16x16 --weights mean --device cpu --no-sheets --replace -o out");
        done(&scene, &render);
        let written = names_in(&scene.join("out"));
        assert!(names.iter().all(|name| written.iter().any(|file| file == name)), "{written:?}");
    }
    let error = run(&scene, "render toy --targets 0000020 --size 16x16 -o elsewhere");
    assert_eq!(error.code, Some(0), "a number, however it is written");
    for (target, parts) in
        [("00002x", "the nearest names are '000020', '000021', '000022'"), ("#24", "by index #0 .. #23")]
    {
        let error = run(&scene, &format!("weights toy --target {target}"));
        assert!(error.code == Some(1) && error.stderr.contains(parts), "{}", error.stderr);
    }
}

fn draws_the_cameras() {
    let scene = toy();
    let printed = done(&scene, "inspect toy -o maps/cameras.png");
    assert!(printed.contains("maps/cameras.png"), "{printed}");
    assert_eq!(names_in(&scene.join("maps")), ["cameras.png"]);
    let map = image::open(scene.join("maps/cameras.png")).expect("a picture").to_rgb8();
    assert!(map.width() > 300 && map.pixels().any(|pixel| *pixel != *map.get_pixel(0, 0)));
    // With --json, standard output is JSON and nothing else.
    let json = done(&scene, "inspect toy --json -o maps/cameras.png");
    assert!(serde_json::from_str::<Value>(&json).is_ok(), "{json}");
}

/// Cameras in a row have no width across it; what is beside them is on the map.
fn the_map_has_what_cameras_in_a_row_pass() {
    let folder = Folder::new();
    let (mut images, mut points) = (String::new(), String::new());
    for view in 0..4 {
        image::RgbImage::new(16, 12).save(folder.file(&format!("row/images/{view}.png"))).expect("a photograph");
        images += &format!("{} 1 0 0 0 0 0 {} 1 {view}.png\n\n", view + 1, -view);
    }
    for point in 0..400 {
        let aside = f64::from(6 + point % 4) * if point % 2 == 0 { 1.0 } else { -1.0 };
        points += &format!("{} {aside} 0 {} 255 0 0 0.5\n", point + 1, f64::from(point) / 20.0);
    }
    folder.write("row/sparse/0/cameras.txt", "1 PINHOLE 16 12 15 15 8 6\n");
    folder.write("row/sparse/0/images.txt", images).write("row/sparse/0/points3D.txt", points);
    run(&folder, "inspect row -o row.png");
    let map = image::open(folder.join("row.png")).expect("a map").to_rgb8();
    let red: Vec<u32> =
        map.enumerate_pixels().filter(|(.., pixel)| pixel[0] > 150 && pixel[1] < 60).map(|(x, ..)| x).collect();
    assert!(red.len() > 200, "{} pixels of points", red.len());
    assert!(red.iter().any(|x| *x < map.width() / 3) && red.iter().any(|x| *x > map.width() / 3 * 2));
}

/// A change of pose number so many, a row-major matrix.
type Change = fn(usize, &mut [f64; 16]);

/// What is wrong with the poses, the warning that says so, and how many more there may be.
const BAD_POSES: [(Change, &str, usize); 3] = [
    (
        |_, matrix| [1, 2, 5, 6, 9, 10].iter().for_each(|&at| matrix[at] = -matrix[at]),
        "24 of 24 cameras look away from the point",
        1,
    ),
    (
        |view, matrix| {
            matrix[3] += 1.3 * ((7 * view % 5) as f64 - 2.0);
            matrix[7] += 1.1 * ((3 * view % 5) as f64 - 2.0);
            matrix[11] += 0.9 * ((11 * view % 7) as f64 - 3.0);
        },
        "the cameras do not look at a common point",
        1,
    ),
    (
        |_, matrix| [3, 7, 11].iter().for_each(|&at| matrix[at] *= 1.0e3),
        "the cameras are 1.300e3 units from what they look at",
        0,
    ),
];

fn bad_poses_are_told() {
    for (change, warning, others) in BAD_POSES {
        let scene = toy();
        change_poses(&scene, change);
        assert_warns(&scene, warning, others);
    }
    let scene = toy();
    std::fs::copy(scene.join("toy/pose/000003.txt"), scene.join("toy/pose/000007.txt")).expect("a copy");
    assert_warns(&scene, "views '000003' and '000007' have the same pose", 1);
}

/// In the coordinates of a map: what is changed when it is opened is said, and is no reason for a warning.
fn a_scene_in_a_map() {
    let scene = toy();
    change_poses(&scene, |_, matrix| [3, 7, 11].iter().for_each(|&at| matrix[at] += 1.0e6));
    let inspection = inspection(&scene);
    assert_eq!(texts(&inspection["warnings"]), Vec::<&str>::new());
    let origin = numbers(&inspection["origin"]);
    assert!(origin.len() == 3 && origin.iter().all(|x| (x - 1.0e6).abs() < 2.0), "{inspection}");
    let printed = done(&scene, "inspect toy");
    let says = |line: &str| line.starts_with("frame      the file's (") && line.contains("is the origin");
    assert!(printed.lines().any(says), "{printed}");
}

/// Puts clutter behind the object of some photographs, which have no alpha channel then.
fn clutter(scene: &Folder, which: impl Fn(usize) -> bool) {
    let names = names_in(&scene.file("toy/rgb"));
    for name in names.iter().enumerate().filter(|(index, _)| which(*index)).map(|(_, name)| name) {
        let path = scene.file(&format!("toy/rgb/{name}"));
        let object = image::open(&path).expect("a photograph").to_rgba8();
        let cluttered = image::RgbImage::from_fn(object.width(), object.height(), |x, y| {
            let pixel = object.get_pixel(x, y);
            let behind = [(x * 37 % 256) as u8, (y * 53 % 256) as u8, ((x + y) * 29 % 256) as u8];
            if pixel[3] > 127 { image::Rgb([pixel[0], pixel[1], pixel[2]]) } else { image::Rgb(behind) }
        });
        cluttered.save(&path).expect("a photograph");
    }
}

fn a_background_of_many_colours_is_a_fault_only_of_an_object() {
    // Whole photographs: nobody asked for an object.
    let scene = toy();
    clutter(&scene, |_| true);
    let whole = inspection(&scene);
    assert!(texts(&whole["warnings"]).iter().all(|warning| !warning.contains("one colour")), "{whole}");
    assert!(whole["object"].is_null());
    assert!(done(&scene, "inspect toy").contains("\nobject     none cut out: whole photographs\n"));
    // Some are cut out.
    let scene = toy();
    clutter(&scene, |index| index % 4 == 0);
    assert_warns(&scene, "not of one colour", 1);
    let outcome = run(&scene, "render toy --targets 20 --size 32x32 -o out");
    let warnings = outcome.stderr.lines().filter(|line| line.contains("not of one colour")).count();
    assert_eq!(warnings, 1, "{}", outcome.stderr);
}

fn what_the_cameras_cover() {
    let scene = toy();
    let inspected = inspection(&scene);
    let gaps = numbers(&inspected["gaps"]);
    assert!(10.0 < gaps[0] && gaps[0] < gaps[1] && gaps[1] < 40.0, "{gaps:?}");
    assert_eq!(inspected["arc"], 360.0);
    let printed = done(&scene, "inspect toy");
    let line = format!(
        "\nneighbours {:.0} degrees apart (median), at most {:.0}\ncoverage   all around the focus, from ",
        gaps[0], gaps[1]
    );
    assert!(printed.contains(&line), "{printed}");
    assert!(inspected.get("quality").is_none() && printed.contains("\nexpected   --quality "), "{printed}");
}

fn the_quality_is_that_of_held_out_photographs() {
    let scene = toy();
    let quality = |arguments: &str| -> Value {
        let printed = done(&scene, &format!("inspect toy --json --quality{arguments}"));
        serde_json::from_str::<Value>(&printed).expect("JSON")["quality"].clone()
    };
    let judged = quality("");
    let held_out = list_of(&judged["left_out"]);
    let scores: Vec<f64> = held_out.iter().map(|view| number_of(&view["psnr"])).collect();
    assert_eq!(scores.len(), 6);
    let mean = scores.iter().sum::<f64>() / 6.0;
    let expected = number_of(&judged["expected"]["psnr"]);
    // A view between neighbours has nearer sources than a held-out view.
    assert!(20.0 < mean && mean < expected && expected < 45.0, "{judged}");
    let printed = done(&scene, "inspect toy --quality");
    let said = format!("\nheld out   6 photographs, rendered from the others: PSNR {mean:.1} dB, from ");
    assert!(
        printed.contains(&said) && printed.contains(&format!("\nexpected   PSNR {expected:.1} dB half-way")),
        "{printed}"
    );
    // Photographs that do not show what their poses say: there is no object, and that is said.
    change_poses(&scene, |view, matrix| {
        if view % 2 == 0 {
            matrix.swap(3, 7);
        }
    });
    let wrong = quality("");
    assert!(
        wrong["expected"].is_null() && wrong["problem"].as_str().is_some_and(|problem| problem.contains("silhouettes")),
        "{wrong}"
    );
    assert!(done(&scene, "inspect toy --quality").contains("\nexpected   not measured: toy: the silhouettes"));
}

/// A photograph that was saved again, with a pose of its own, is no new view of anything: what is held out beside it would
/// be met by its copy. Depths are sought between the two, and pictures are bad: that is told.
fn a_copy_tells_nothing_of_new_views() {
    let folder = sample("room");
    let judged = || -> (Value, String) {
        let said = run(&folder, "inspect room --json --quality");
        assert_eq!(said.code, Some(0), "{}", said.stderr);
        (serde_json::from_str::<Value>(&said.stdout).expect("JSON")["quality"].clone(), said.stderr)
    };
    let best = |judged: &Value| {
        let views = list_of(&judged["left_out"]);
        views.iter().map(|view| number_of(&view["psnr"])).fold(f64::NEG_INFINITY, f64::max)
    };
    let (before, said) = judged();
    assert_eq!(said, "");
    let mut transforms = read_json(folder.join("room/transforms.json"));
    let frames = transforms["frames"].as_array_mut().expect("frames");
    for frame in frames.clone() {
        let name = frame["file_path"].as_str().expect("a name").to_owned();
        let picture = image::open(folder.join("room").join(&name)).expect("a photograph").into_rgb8();
        let again = name.replace(".jpg", "_again.jpg");
        let file = std::fs::File::create(folder.file(&format!("room/{again}"))).expect("a file");
        let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(file, 70);
        picture.write_with_encoder(encoder).expect("written");
        let mut frame = frame;
        frame["file_path"] = again.into();
        let x = number_of(&frame["transform_matrix"][0][3]);
        frame["transform_matrix"][0][3] = (x + 5.0e-3).into();
        frames.push(frame);
    }
    folder.write("room/transforms.json", transforms.to_string());
    let (after, said) = judged();
    assert!(best(&after) < best(&before) + 3.0, "{before}: {after}");
    assert!(said.contains("or many of them are there twice"), "{said}");
}

fn what_is_excluded_is_said_and_recorded() {
    let (folder, room) = (Folder::new(), viewfuse_tests::places::data("room"));
    for name in names_in(&room.join("images")) {
        std::fs::copy(room.join("images").join(&name), folder.file(&format!("room/images/{name}"))).expect("a copy");
    }
    let mut transforms = read_json(room.join("transforms.json"));
    let frames = transforms["frames"].as_array_mut().expect("frames");
    let count = frames.len();
    frames[2]["file_path"] = "images/999.jpg".into();
    transforms["aabb_scale"] = 4.into();
    folder.write("room/transforms.json", transforms.to_string());
    let warnings = [
        format!("transforms.json: 1 of {count} photographs are not there and excluded"),
        format!("images: 1 photograph has no pose and is not used, {} have one (without is 002.jpg)", count - 1),
    ];
    let (printed, verbose) = (done(&folder, "inspect room"), done(&folder, "inspect room --verbose"));
    for warning in &warnings {
        let is_said = |line: &str| line.starts_with("warning    ") && line.contains(warning);
        assert!(printed.lines().any(is_said) && verbose.lines().any(is_said), "{printed}");
    }
    assert!(!printed.contains("not read   "), "{printed}");
    assert!(verbose.lines().any(|line| line.starts_with("not read   ") && line.ends_with(": aabb_scale")), "{verbose}");
    let render = "render room --targets 005 --size 32x24 --device cpu --weights mean --no-sheets -o out";
    let outcome = run(&folder, render);
    let record = read_json(folder.join("out/run.json"));
    for warning in &warnings {
        // Once, though it was told with the scene's path, too.
        let lines = texts(&record["warnings"]);
        assert_eq!(lines.iter().filter(|line| line.contains(warning)).count(), 1, "{lines:?}");
        let said = outcome.stderr.lines().filter(|line| line.contains("warning: ") && line.contains(warning));
        assert_eq!(said.count(), 1, "{}", outcome.stderr);
    }
}

fn conventions_are_said_and_recorded() {
    let scene = toy();
    let render = |output: &str| {
        let options = "--targets 20 --size 32x32 --device cpu --weights mean --no-sheets";
        done(&scene, &format!("render toy {options} -o {output}"));
        std::fs::read(scene.join(output).join("000020.png")).expect("a picture")
    };
    let plain = render("plain");
    assert_eq!(texts(&read_json(scene.join("plain/run.json"))["conventions"]), Vec::<&str>::new());
    scene.write("toy/intrinsics.txt", "131.25 0 64 0\n0 131.25 64 0\n0 0 1 0\n0 0 0 1\n");
    assert!(render("matrix") == plain, "the same camera gives another picture");
    let convention = "intrinsics.txt: K alone, for the photographs' size (NSVF)";
    assert_eq!(texts(&read_json(scene.join("matrix/run.json"))["conventions"]), [convention]);
    assert!(done(&scene, "inspect toy").contains(&format!("\nread as    {convention}\n")));
}
