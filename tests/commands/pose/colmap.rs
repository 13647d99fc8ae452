//! `--from`: a person's own COLMAP, played by a script that says what the room's poses are, or something else.

use super::{COUNT_ALONE, REQUIRE, bare, no_program, no_scripts, posed, with, worst_rotation};
use crate::{assert_wrong_arguments, command, list_of, read_json, text_of};
use std::f64::consts::PI;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use viewfuse::scene::Scene;
use viewfuse::scene::rig::Rig;
use viewfuse_tests::command::{Outcome, assert_command_refused, files_below};
use viewfuse_tests::places::data;
use viewfuse_tests::scenes::Folder;

/// Plays `colmap`: it keeps a list of its calls, and its mapper writes a model that lies beside it, by the features
/// asked for.
const COLMAP: &str = r#"here=$(dirname "$0")
step=$1
if [ "$1" = -h ]; then echo "COLMAP 9.8.7 -- Structure-from-Motion"; exit 0; fi
if [ "$2" = -h ]; then
  echo "--database_path arg --image_path arg --image_list_path arg --output_path arg --random_seed arg (=0)"
  echo "--ImageReader.single_camera arg --ImageReader.camera_model arg --ImageReader.camera_params arg"
  echo "--ImageReader.default_focal_length_factor arg --SiftExtraction.domain_size_pooling arg (=0)"
  exit 0
fi
echo "$@" >> "$here/calls"
while [ $# -gt 0 ]; do
  case "$1" in
    --SiftExtraction.domain_size_pooling) echo "$2" > "$here/dsp" ;;
    --output_path) out=$2 ;;
  esac
  shift
done
if [ "$step" = mapper ]; then
  model="$here/sift"
  if [ "$(cat "$here/dsp")" = 1 ]; then model="$here/dsp-sift"; fi
  if [ ! -d "$model" ]; then echo "ERROR: failed to create sparse model" >&2; exit 1; fi
  cp -r "$model" "$out/0"
fi
"#;

viewfuse_tests::trials![
    python_without_pycolmap,
    not_installed;
    no_scripts() => in_place_of_openmvg, what_it_cannot_do_is_said;
    no_scripts().or_else(no_program), REQUIRE => as_a_second_opinion,
];

/// Writes the room's first photographs and their true poses as COLMAP's text model, each turned about its down axis by
/// as many degrees as `turn` says.
fn model(folder: &Folder, name: &str, turn: impl Fn(usize) -> f64) {
    let scene = Scene::open(data("room")).expect("the room");
    let cameras: Vec<_> = scene.views.iter().map(|view| view.camera).collect();
    let mut images = String::new();
    for (photo, camera) in cameras.iter().take(COUNT_ALONE).enumerate() {
        let axes = [camera.pose.right_world(), camera.pose.down_world(), camera.pose.forward_world()];
        let axes = axes.map(|axis| axis.as_dvec3());
        let world_from_camera = glam::DMat3::from_cols(axes[0], axes[1], axes[2]);
        let rotation = (world_from_camera * glam::DMat3::from_rotation_y(turn(photo).to_radians())).transpose();
        let quaternion = glam::DQuat::from_mat3(&rotation).normalize();
        let t = -(rotation * camera.pose.centre_world().as_dvec3());
        let (q, id) = (quaternion, photo + 1);
        writeln!(images, "{id} {} {} {} {} {} {} {} 1 {photo:05}.png\n", q.w, q.x, q.y, q.z, t.x, t.y, t.z)
            .expect("a string");
    }
    let focus = Rig::of(&cameras).focus.as_dvec3();
    let away = focus.distance(cameras[0].pose.centre_world().as_dvec3());
    let mut points = String::new();
    for number in 0..40 {
        let angle = 2.0 * PI * f64::from(number) / 40.0;
        let p = focus + 0.4 * away * glam::DVec3::new(angle.cos(), (3.0 * angle).sin(), angle.sin());
        let track: Vec<String> = (1..=COUNT_ALONE).map(|image| format!("{image} {number}")).collect();
        writeln!(points, "{number} {} {} {} 9 9 9 0.3 {}", p.x, p.y, p.z, track.join(" ")).expect("a string");
    }
    folder.write(&format!("bin/{name}/images.txt"), images).write(&format!("bin/{name}/points3D.txt"), points);
    // Features are looked for in photographs that are enlarged to 1200 pixels.
    folder.write(&format!("bin/{name}/cameras.txt"), "1 SIMPLE_RADIAL 1200 900 1104 600 450 0\n");
}

/// Puts the script at `bin/colmap` beside photographs of the room.
fn with_colmap() -> Folder {
    let folder = bare(0..COUNT_ALONE);
    folder.script("bin/colmap", COLMAP);
    folder
}

fn colmap(folder: &Folder) -> (&'static str, PathBuf) {
    ("VIEWFUSE_COLMAP", folder.join("bin/colmap"))
}

fn in_place_of_openmvg() {
    let folder = with_colmap();
    model(&folder, "sift", |_| 0.0);
    model(&folder, "dsp-sift", |_| 0.0);
    let said = posed(with(&folder, "pose bare -o posed --from colmap --seed 5", colmap(&folder)));
    assert!(said.starts_with("registered 5 of 5 photographs\n") && said.contains("by COLMAP 9.8.7 (SIFT)"), "{said}");
    let scene = Scene::open(folder.join("posed")).expect("a scene");
    assert!(worst_rotation(&scene) < 0.1 && scene.points.len() == 40, "{}", worst_rotation(&scene));
    let record = read_json(folder.join("posed/pose.json"));
    let attempts = list_of(&record["attempts"]);
    let told: Vec<_> =
        attempts.iter().map(|attempt| (attempt["solver"].as_str(), attempt["features"].as_str())).collect();
    assert_eq!(told, [(Some("COLMAP 9.8.7"), Some("sift")), (Some("COLMAP 9.8.7"), Some("dsp-sift"))]);
    // What it was asked: the known camera and the seed, and of the options only those that it has.
    let calls = fs::read_to_string(folder.join("bin/calls")).expect("calls");
    let steps: Vec<_> = calls.lines().map(|call| call.split(' ').next().unwrap_or_default()).collect();
    assert_eq!(steps, ["feature_extractor", "exhaustive_matcher", "mapper"].repeat(2));
    let focal = calls.lines().next().and_then(|call| call.split("--ImageReader.camera_params ").nth(1));
    let focal: f64 = focal.and_then(|text| text.split(',').next()?.parse().ok()).expect("a camera");
    assert!((focal / 1104.0 - 1.0).abs() < 0.02 && calls.contains("--random_seed 5"), "{calls}");
    assert!(!calls.contains("use_gpu"), "an option that it does not have: {calls}");
}

fn as_a_second_opinion() {
    let folder = with_colmap();
    model(&folder, "sift", |_| 0.0);
    model(&folder, "dsp-sift", |photo| 20.0 * photo as f64);
    let said = posed(with(&folder, "pose bare -o posed --from openmvg,colmap", colmap(&folder)));
    assert!(said.starts_with("registered 5 of 5 photographs\n"), "{said}");
    assert!(worst_rotation(&Scene::open(folder.join("posed")).expect("a scene")) < 1.5);
    let record = read_json(folder.join("posed/pose.json"));
    let attempts = list_of(&record["attempts"]);
    let solver = |attempt: &serde_json::Value| {
        attempt["solver"].as_str().unwrap_or_default().split(' ').next().map(str::to_owned)
    };
    let solvers: Vec<_> = attempts.iter().filter_map(solver).collect();
    assert_eq!(solvers, ["openmvg-sfm", "openmvg-sfm", "COLMAP", "COLMAP"]);
    // The wrong attempt is known as one.
    let refused = text_of(&attempts[3]["refused"]);
    assert!(refused.contains("no other attempt has the same rotations"), "{refused}");
    assert!(attempts[2]["refused"].is_null(), "{}", attempts[2]);
}

/// It looked for poses and wrote nothing.
#[track_caller]
fn assert_not_posed(folder: &Folder, parts: &[&str]) {
    let before = files_below(&folder.join("bare"));
    let outcome = Outcome::of(with(folder, "pose bare -o posed --from colmap", colmap(folder)));
    assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(1), ""), "{}", outcome.stderr);
    let last = outcome.stderr.lines().last().unwrap_or_default();
    for part in ["viewfuse: bare: no poses that can be trusted"].iter().chain(parts) {
        assert!(last.contains(part), "{part}: {}", outcome.stderr);
    }
    assert!(!folder.join("posed").exists());
    assert_eq!(files_below(&folder.join("bare")), before);
}

fn what_it_cannot_do_is_said() {
    let folder = with_colmap();
    assert_not_posed(&folder, &["failed to create"]);
    model(&folder, "sift", |_| 0.0);
    folder.write("bin/sift/images.txt", "1 1 0 0 0 0 0 0 1 00000.png\n\n2 1 0 nan 0 0 0 0 1 00001.png\n\n");
    let damaged = Outcome::of(with(&folder, "pose bare -o posed --from colmap", colmap(&folder)));
    assert_eq!((damaged.code, damaged.stdout.as_str()), (Some(1), ""), "{}", damaged.stderr);
    assert!(damaged.stderr.contains("colmap: its model"), "{}", damaged.stderr);
    assert!(!folder.join("posed").exists());
    let echo = ("VIEWFUSE_COLMAP", PathBuf::from("/bin/echo"));
    if echo.1.exists() {
        let other = with(&folder, "pose bare -o posed --from colmap", echo);
        assert_command_refused(other, &folder, &["/bin/echo: does not say that it is COLMAP"]);
    }
}

fn not_installed() {
    let folder = bare(0..3);
    let nothing = ("VIEWFUSE_COLMAP", folder.join("nothing"));
    let missing = with(&folder, "pose bare -o posed --from colmap", nothing);
    assert_command_refused(missing, &folder, &["nothing: the program is not there", "`apt install colmap`"]);
    let nothing = ("VIEWFUSE_PYTHON", folder.join("nothing"));
    let missing = with(&folder, "pose bare -o posed --from pycolmap", nothing);
    assert_command_refused(missing, &folder, &["nothing: the program is not there", "pip install pycolmap"]);
    assert_wrong_arguments(&folder, "pose bare -o posed --from bundler", &["--from"]);
}

fn python_without_pycolmap() {
    let found = Command::new("python3").arg("--version").output().is_ok_and(|said| said.status.success());
    if !found {
        return;
    }
    let folder = bare(0..3);
    // A module of this name that cannot be imported stands before one that is installed.
    folder.write("modules/pycolmap.py", "raise ImportError('none here')\n");
    let mut refused = command(&folder, "pose bare -o posed --from pycolmap");
    refused.env("PYTHONPATH", folder.join("modules")).env_remove("VIEWFUSE_PYTHON");
    // Python itself would leave the module compiled beside it.
    refused.env("PYTHONDONTWRITEBYTECODE", "1");
    let before = folder.path();
    assert_command_refused(
        refused,
        before,
        &["cannot import pycolmap: none here", "`python3 -m pip install pycolmap`"],
    );
}
