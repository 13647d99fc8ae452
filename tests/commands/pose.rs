//! `viewfuse pose`: photographs without poses, to a scene; and what keeps photographs, or all of them, out of it.
//!
//! Most tests need the program `viewfuse-openmvg` beside the command or named by `VIEWFUSE_OPENMVG`; `tests/run` builds
//! it.

mod colmap;
mod diagnosis;
mod helper;
mod on_the_way;
mod stopped;

use super::{BINARY, assert_refused, assert_wrong_arguments, command, done_with_warnings, list_of, read_json, run};
use image::{DynamicImage, ImageFormat, RgbImage, imageops};
use serde_json::{Value, json};
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::slice;
use viewfuse::core::pose::Pose;
use viewfuse::scene::Scene;
use viewfuse_tests::command::{Outcome, assert_command_refused, files_below, interrupt, spawn};
use viewfuse_tests::patience::wait_while_running;
use viewfuse_tests::places::data;
use viewfuse_tests::scenes::{FILM, Folder, ORIENTATION, with_exif};
use viewfuse_tests::trials::lacking;

/// What lets tests fail that lack the program.
const REQUIRE: &str = "VIEWFUSE_REQUIRE_POSE";

/// Focal length of the sample room in millimetres of a 35 mm camera: 294.4 pixels of 320 x 240, rounded as cameras do.
const ROOM_FILM: u16 = 32;

/// Photographs of a set whose poses a played solver says.
const COUNT_ALONE: usize = 5;

/// Why there is no program, if there is none.
fn no_program() -> Option<String> {
    lacking(program().is_some(), "no viewfuse-openmvg: `cargo openmvg` builds it")
}

/// Why no script can play a program, if that is so.
fn no_scripts() -> Option<String> {
    lacking(cfg!(unix), "no scripts of a shell")
}

viewfuse_tests::trials![
    [colmap, diagnosis, helper, on_the_way, stopped];
    formats_that_are_not_read,
    too_many_and_too_few,
    without_the_program,
    what_lies_beside_the_output_stays,
    bare_photographs_say_how;
    no_program(), REQUIRE =>
        eight_photographs_to_a_picture,
        what_does_not_belong_is_excluded_by_name,
        sizes_and_orientations_may_differ,
        zooms_are_told_apart,
        one_process_answers_as_many_do,
        a_step_leaves_few_enough,
        photographs_of_nothing_in_common,
        ctrl_c_leaves_nothing,
];

/// The program, if there is one.
fn program() -> Option<PathBuf> {
    let beside = Path::new(BINARY).with_file_name(format!("viewfuse-openmvg{}", std::env::consts::EXE_SUFFIX));
    std::env::var_os("VIEWFUSE_OPENMVG").map(PathBuf::from).or(Some(beside)).filter(|path| path.is_file())
}

/// The bytes of a photograph of the room.
fn room(view: usize) -> Vec<u8> {
    fs::read(data("room").join(format!("images/{view:03}.jpg"))).expect("a photograph")
}

fn decoded(view: usize) -> RgbImage {
    image::load_from_memory(&room(view)).expect("a picture").into_rgb8()
}

fn jpeg(picture: RgbImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    DynamicImage::ImageRgb8(picture).write_to(&mut bytes, ImageFormat::Jpeg).expect("a JPEG");
    bytes.into_inner()
}

/// A folder with these photographs of the room in `bare`, which state their focal length.
fn bare(views: impl IntoIterator<Item = usize>) -> Folder {
    let folder = Folder::new();
    for view in views {
        folder.write(&format!("bare/{view:03}.jpg"), with_exif(&room(view), &[(FILM, ROOM_FILM)]));
    }
    folder
}

/// A command for which a variable names a program.
fn with(folder: &Folder, arguments: &str, (name, value): (&str, PathBuf)) -> Command {
    let mut command = command(folder, arguments);
    command.env(name, value);
    command
}

/// What a command prints; warnings and progress aside, it succeeds.
#[track_caller]
fn posed(command: Command) -> String {
    let told = format!("{command:?}");
    let outcome = Outcome::of(command);
    assert_eq!(outcome.code, Some(0), "{told}\n{}{}", outcome.stdout, outcome.stderr);
    outcome.stdout
}

/// The greatest angle in degrees between relative rotations of the scene and of the room, over the views that have
/// these names.
fn worst_rotation(scene: &Scene) -> f32 {
    let known = Scene::open(data("room")).expect("the room");
    let pose = |scene: &Scene, name: &str| scene.views[scene.view_named(name).expect("a view")].camera.pose;
    let relative = |scene: &Scene, a: &str, b: &str| {
        let (a, b): (Pose, Pose) = (pose(scene, a), pose(scene, b));
        [a.right_world(), a.down_world(), a.forward_world()].map(|axis| {
            glam::Vec3::new(axis.dot(b.right_world()), axis.dot(b.down_world()), axis.dot(b.forward_world()))
        })
    };
    let mut worst = 0.0_f32;
    for a in &scene.views {
        for b in &scene.views {
            let (found, true_one) = (relative(scene, &a.name, &b.name), relative(&known, &a.name, &b.name));
            // trace(A B^T) = 1 + 2 cos
            let trace: f32 = found.iter().zip(&true_one).map(|(row, true_one)| row.dot(*true_one)).sum();
            worst = worst.max((0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos().to_degrees());
        }
    }
    worst
}

fn eight_photographs_to_a_picture() {
    let folder = bare(0..8);
    let said = done_with_warnings(&folder, "pose bare -o posed --seed 3").stdout;
    assert!(said.starts_with("registered 8 of 8 photographs\n") && said.contains("refined from EXIF's 2"), "{said}");
    let scene = Scene::open(folder.join("posed")).expect("a scene");
    assert_eq!((scene.layout, scene.views.len()), ("colmap", 8));
    assert!(scene.points.len() > 100, "{} points", scene.points.len());
    let worst = worst_rotation(&scene);
    assert!(worst < 1.5, "{worst} degrees");
    let record = read_json(folder.join("posed/pose.json"));
    let accepted = list_of(&record["accepted"]);
    assert_eq!(accepted.iter().filter(|photo| photo["verdict"] == "sure").count(), 8, "{record}");
    // Features are found in enlarged photographs; cameras are those of the photographs.
    let camera = &scene.views[0].camera.pinhole;
    assert!((camera.focal()[0] / 294.4 - 1.0).abs() < 0.05, "{camera:?}");
    let [x, y] = camera.principal();
    assert!(camera.width() == 320 && (x - 160.0).abs() < 1.0 && (y - 120.0).abs() < 1.0, "{camera:?}");
    assert!(record["attempts"][0]["solver"].as_str().is_some_and(|name| name.starts_with("openmvg-sfm ")), "{record}");
    assert!(image::open(folder.join("posed/cameras.png")).is_ok());
    // From nothing to a picture.
    done_with_warnings(
        &folder,
        "render posed --targets 3 -o out --size 160x120 --weights distance:power=2 --device cpu",
    );
    let psnr = read_json(folder.join("out/run.json"))["frames"][0]["psnr"].as_f64().expect("a score");
    assert!(psnr > 21.0, "{psnr} dB");
}

fn what_does_not_belong_is_excluded_by_name() {
    let folder = bare(0..5);
    let cut = room(5);
    folder.write("bare/cut.jpg", &cut[..cut.len() / 2]);
    folder.write("bare/twice.jpg", with_exif(&room(2), &[(FILM, ROOM_FILM)]));
    // What a messenger makes of a photograph: smaller, and compressed more.
    let small = imageops::resize(&decoded(1), 160, 120, imageops::FilterType::Triangle);
    folder.write("bare/000 copy.jpg", with_exif(&jpeg(small), &[(FILM, ROOM_FILM)]));
    folder.write("bare/blurred.jpg", with_exif(&jpeg(imageops::blur(&decoded(6), 6.0)), &[(FILM, ROOM_FILM)]));
    let other = image::open(data("toy/rgb/000003.png")).expect("another scene").to_rgb8();
    let other = imageops::resize(&other, 320, 240, imageops::FilterType::Triangle);
    folder.write("bare/other.jpg", with_exif(&jpeg(other), &[(FILM, ROOM_FILM)]));
    let said = done_with_warnings(&folder, "pose bare -o posed").stdout;
    assert!(said.starts_with("registered 5 of 10 photographs\n"), "{said}");
    for (name, reason) in [
        ("000 copy.jpg", "the same picture as 001.jpg"),
        ("cut.jpg", "the file ends before the picture does"),
        ("twice.jpg", "the same picture as 002.jpg"),
        ("blurred.jpg", "blurred"),
        ("other.jpg", ""),
    ] {
        assert!(said.contains(&format!("excluded   {name}: {reason}")), "{name}: {said}");
    }
    let scene = Scene::open(folder.join("posed")).expect("a scene");
    assert_eq!(scene.views.len(), 5);
    assert!(worst_rotation(&scene) < 1.5);
}

fn sizes_and_orientations_may_differ() {
    let folder = bare(0..4);
    // Half as large, and stored on its side.
    let small = imageops::resize(&decoded(4), 160, 120, imageops::FilterType::Triangle);
    folder.write("bare/004.jpg", with_exif(&jpeg(small), &[(FILM, ROOM_FILM)]));
    let lying = with_exif(&jpeg(imageops::rotate270(&decoded(5))), &[(ORIENTATION, 6), (FILM, ROOM_FILM)]);
    folder.write("bare/005.jpg", lying);
    let said = done_with_warnings(&folder, "pose bare -o posed --layout transforms").stdout;
    assert!(said.contains("320x240"), "{said}");
    let scene = Scene::open(folder.join("posed")).expect("a scene");
    let turned = scene.view_named("005").map(|view| &scene.views[view].camera.pinhole).expect("the lying one");
    assert_eq!((turned.width(), turned.height()), (320, 240), "upright");
    assert!(scene.views.len() >= 5, "{said}");
    assert!(worst_rotation(&scene) < 2.0, "{said}");
}

/// The middle of every second photograph, as large as the others, as of a phone whose EXIF says nothing of its digital
/// zoom: what it states does not count.
fn zooms_are_told_apart() {
    let folder = Folder::new();
    // 12 degrees apart: at 6 the solver determines no focal length of a single photograph.
    for view in (0..11).step_by(2) {
        let picture = decoded(view);
        let zoomed = imageops::crop_imm(&picture, 48, 36, 224, 168).to_image();
        let zoomed = imageops::resize(&zoomed, 320, 240, imageops::FilterType::CatmullRom);
        let stated = with_exif(&jpeg(if view % 4 == 2 { zoomed } else { picture }), &[(FILM, ROOM_FILM)]);
        folder.write(&format!("bare/{view:03}.jpg"), stated);
    }
    let Outcome { stdout: said, stderr, .. } = done_with_warnings(&folder, "pose bare -o posed");
    assert!(stderr.contains("the photographs state (EXIF), are not what they show"), "{stderr}");
    assert!(said.starts_with("registered 6 of 6 photographs\n"), "{said}");
    let scene = Scene::open(folder.join("posed")).expect("a scene");
    assert!(worst_rotation(&scene) < 1.5, "{said}");
    for (view, zoom) in scene.views.iter().zip([1.0, 320.0 / 224.0].into_iter().cycle()) {
        let focal = view.camera.pinhole.focal()[0];
        assert!((focal / (294.4 * zoom) - 1.0).abs() < 0.1, "{}: {focal}\n{said}", view.name);
    }
}

/// What the program keeps of a job's photographs serves jobs with these alone.
fn one_process_answers_as_many_do() {
    let folder = bare(0..6);
    let job = |first: usize, features: &str, focal: f64| {
        let path = |view: usize| folder.join(format!("bare/{view:03}.jpg"));
        let photograph = |view: usize| json!({ "path": path(view), "size": [320, 240], "camera": 0 });
        let photographs: Vec<Value> = (first..first + 4).map(photograph).collect();
        let cameras = [json!({ "focal": focal, "is_guess": true })];
        let job = json!({ "seed": 1, "features": features, "max_side": 320, "cameras": cameras,
            "photographs": photographs });
        job.to_string() + "\n"
    };
    let answers = |jobs: &[String]| -> Vec<String> {
        let mut command = Command::new(program().expect("a program"));
        let mut process = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it starts");
        let mut input = process.stdin.take().expect("its input");
        input.write_all(jobs.concat().as_bytes()).expect("it reads");
        drop(input);
        let said = process.wait_with_output().expect("its end").stdout;
        let lines = String::from_utf8(said).expect("text");
        lines.lines().filter(|line| !line.starts_with(r#"{"progress""#)).map(str::to_owned).collect()
    };
    let jobs = [(0, "alp", 290.0), (0, "sift", 290.0), (0, "alp", 400.0), (2, "alp", 290.0), (0, "sift", 400.0)]
        .map(|(first, features, focal)| job(first, features, focal));
    let together = answers(&jobs);
    let alone: Vec<String> = jobs.iter().flat_map(|job| answers(slice::from_ref(job))).collect();
    assert!(alone.iter().all(|answer| answer.starts_with(r#"{"solution""#)), "{alone:?}");
    assert!(together == alone, "{together:?}\n{alone:?}");
}

fn a_step_leaves_few_enough() {
    // As many as a person has of a video, five of them different.
    let folder = Folder::new();
    for number in 0..300 {
        folder.write(&format!("many/{number}.jpg"), with_exif(&room(number % 5), &[(FILM, ROOM_FILM)]));
    }
    let refused = run(&folder, "pose many -o posed");
    assert_eq!(refused.code, Some(1), "{}", refused.stderr);
    let step = refused.stderr.split("take one in ").nth(1).and_then(|rest| rest.split(';').next());
    let step: usize = step.and_then(|step| step.parse().ok()).unwrap_or_else(|| panic!("{}", refused.stderr));
    let said = done_with_warnings(&folder, &format!("pose many -o posed --every {step}")).stdout;
    assert!(said.starts_with(&format!("registered 5 of {} photographs\n", 300usize.div_ceil(step))), "{said}");
    assert!(said.contains("9.jpg: the same picture as "), "{said}");
    assert_eq!(Scene::open(folder.join("posed")).expect("a scene").views.len(), 5);
}

fn photographs_of_nothing_in_common() {
    let folder = Folder::new();
    for (seed, name) in ["a", "b", "c"].into_iter().enumerate() {
        // Spots at places that a photograph shares with no other.
        let level =
            |x: u32, y: u32| (x * 7919 + y * 104_729 + seed as u32 * 15_485_863).wrapping_mul(2_654_435_761) >> 24;
        let spots = RgbImage::from_fn(320, 240, |x, y| image::Rgb([level(x / 5, y / 5) as u8; 3]));
        folder.write(&format!("bare/{name}.jpg"), jpeg(imageops::blur(&spots, 1.0)));
    }
    let before = files_below(&folder);
    let outcome = run(&folder, "pose bare -o posed");
    assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(1), ""), "{}", outcome.stderr);
    let last = outcome.stderr.lines().last().unwrap_or_default();
    for part in ["viewfuse: bare: no poses that can be trusted", "15 degrees", "--focal"] {
        assert!(last.contains(part), "{part}: {}", outcome.stderr);
    }
    assert_eq!(files_below(&folder), before);
}

fn ctrl_c_leaves_nothing() {
    let folder = bare(0..8);
    let before = files_below(&folder);
    let mut child = spawn(command(&folder, "pose bare -o posed"));
    let process = child.id();
    // The program has begun.
    let has_child = || {
        let tasks = fs::read_to_string(format!("/proc/{process}/task/{process}/children")).unwrap_or_default();
        !cfg!(target_os = "linux") || !tasks.is_empty()
    };
    let threads_have = || {
        let tasks = fs::read_dir(format!("/proc/{process}/task")).into_iter().flatten().flatten();
        tasks.into_iter().any(|task| fs::read_to_string(task.path().join("children")).is_ok_and(|all| !all.is_empty()))
    };
    wait_while_running(&mut child, || has_child() || threads_have());
    interrupt(child, "-INT");
    assert_eq!(files_below(&folder), before);
}

fn formats_that_are_not_read() {
    let folder = bare(0..3);
    folder.write("bare/my 7.HEIC", "ftypheic");
    let advice = "heif-convert 'bare/my 7.HEIC' 'bare/my 7.HEIC.jpg'";
    assert_refused(&folder, "pose bare -o posed", &["bare/my 7.HEIC: HEIC is not read", advice]);
    // Done as advised, it stays beside what it became.
    folder.write("bare/my 7.HEIC.jpg", room(7));
    let named = with(&folder, "pose bare -o posed", ("VIEWFUSE_OPENMVG", folder.join("nothing")));
    assert_command_refused(named, &folder, &["nothing: the program is not there"]);
    folder.remove("bare/my 7.HEIC").write("bare/DSC_1.NEF", "raw");
    assert_refused(&folder, "pose bare -o posed", &["bare/DSC_1.NEF: a camera's raw format is not read"]);
}

fn too_many_and_too_few() {
    let folder = Folder::new();
    assert_refused(&folder, "pose nowhere -o posed", &["nowhere: no such file or folder"]);
    folder.write("empty/notes.txt", "nothing");
    assert_refused(&folder, "pose empty -o posed", &["empty: no photographs here"]);
    folder.write("empty/scan.BMP", "BM");
    assert_refused(
        &folder,
        "pose empty -o posed",
        &["empty: no photographs here", "; convert scan.BMP and the like to JPEG"],
    );
    for number in 0..300 {
        folder.write(&format!("many/{number}.jpg"), room(0));
    }
    assert_refused(&folder, "pose many -o posed", &["many: 300 photographs", "--every N takes every Nth"]);
    let two = bare(0..2);
    two.write("bare/cut.jpg", &room(5)[..4000]);
    assert_refused(&two, "pose bare -o posed", &["bare: 2 of the photographs can be used", "cut.jpg: the file ends"]);
    assert_refused(&two, "pose bare -o bare", &["bare: exists already"]);
    assert_wrong_arguments(&two, "pose bare -o posed --focal 0", &["--focal"]);
    assert_wrong_arguments(&two, "pose bare -o posed --layout srn", &["--layout"]);
}

fn without_the_program() {
    let folder = bare(0..3);
    let named = with(&folder, "pose bare -o posed", ("VIEWFUSE_OPENMVG", folder.join("nothing")));
    assert_command_refused(named, &folder, &["nothing: the program is not there", "`cargo openmvg` builds it"]);
    // A program that says something else.
    if Path::new("/bin/echo").exists() {
        let named = with(&folder, "pose bare -o posed", ("VIEWFUSE_OPENMVG", "/bin/echo".into()));
        assert_command_refused(named, &folder, &["/bin/echo: its answer cannot be read"]);
    }
}

/// The hidden folder of attempts may be a person's, or of a run that was stopped.
fn what_lies_beside_the_output_stays() {
    let folder = bare(0..3);
    folder.write(".posed.attempts/notes.txt", "mine").write(".posed.attempts/inner/more.txt", "mine");
    // Without an input nothing has begun.
    assert_refused(&folder, "pose nowhere -o posed", &["nowhere"]);
    // A solver that was asked, and failed.
    if Path::new("/bin/echo").exists() {
        let named = with(&folder, "pose bare -o posed", ("VIEWFUSE_OPENMVG", "/bin/echo".into()));
        assert_command_refused(named, &folder, &["/bin/echo"]);
    }
    #[cfg(unix)]
    {
        fs::create_dir(folder.join("elsewhere")).expect("a folder");
        let link = folder.join(".linked.attempts");
        std::os::unix::fs::symlink(folder.join("elsewhere"), &link).expect("a link");
        assert_refused(&folder, "pose bare -o linked", &[".linked.attempts: it is a link"]);
        std::os::unix::fs::symlink("elsewhere", folder.join("posed")).expect("a link");
        assert_refused(&folder, "pose bare -o posed", &["posed: exists already"]);
    }
}

fn bare_photographs_say_how() {
    let folder = bare(0..3);
    for arguments in ["inspect bare", "render bare --orbit 3 -o out", "view bare --no-browser"] {
        assert_refused(
            &folder,
            arguments,
            &["bare: 3 photographs, and nothing that gives their poses", "`viewfuse pose FOLDER -o posed`", "--pose"],
        );
    }
}
