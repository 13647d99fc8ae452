//! Camera paths: what is read from files, and what is generated.

use super::made::open;
use serde_json::{Value, json};
use viewfuse::scene::Scene;
use viewfuse::scene::few_shot::{FewShot, PathChoice, Selection};
use viewfuse::scene::path::{CameraPath, generated};
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_core::pose::Pose;
use viewfuse_tests::places::data;
use viewfuse_tests::scenes::{self, Folder, POINT_WORLD, WORLD_FROM_CAMERA};

/// The path of a file beside an SRN scene: one camera of 16 x 12 pixels, focal length 20, centre (8, 6).
fn path_of(name: &str, text: impl AsRef<[u8]>) -> Result<CameraPath, String> {
    let folder = scenes::srn();
    folder.write(name, text);
    let scene = open(&folder);
    let pinhole = scene.views[0].camera.pinhole;
    let outcome = CameraPath::open(&folder.join(name), &scene, &pinhole);
    outcome.map_err(|error| error.to_string().replace(&folder.display().to_string(), ""))
}

/// Where a camera sees the point of [`POINT_WORLD`], which is 2 in front of it.
#[track_caller]
fn assert_sees(camera: &Camera, expected: [f32; 2]) {
    let seen = camera.project(Vec3::from_array(POINT_WORLD));
    assert!(seen.in_front && (seen.depth - 2.0).abs() < 1.0e-4, "{seen:?}");
    assert!((seen.x - expected[0]).abs() < 1.0e-3 && (seen.y - expected[1]).abs() < 1.0e-3, "{seen:?}");
}

/// Where the scene's own camera sees it.
fn own_pixel(scene: &Scene) -> [f32; 2] {
    let seen = scene.views[0].camera.project(Vec3::from_array(POINT_WORLD));
    [seen.x, seen.y]
}

/// The pose in OpenGL axes as one list.
fn flat() -> Vec<Value> {
    let rows = scenes::opengl_matrix();
    rows.as_array().expect("rows").iter().flat_map(|row| row.as_array().expect("a row").clone()).collect()
}

fn camera_path() -> Value {
    // A focal length of 20 at a height of 12 pixels.
    let fov = 2.0 * (6.0_f64 / 20.0).atan().to_degrees();
    let frame = json!({ "camera_to_world": flat(), "fov": fov, "aspect": 1.333 });
    json!({
        "camera_type": "perspective", "render_height": 12, "render_width": 16, "fps": 24, "seconds": 1,
        "camera_path": [frame, frame],
    })
}

#[test]
fn the_path_of_nerfstudios_viewer() {
    let expected = own_pixel(&open(&scenes::srn()));
    let path = path_of("camera_path.json", camera_path().to_string()).expect("a path");
    assert_eq!(path.frames_per_second, Some(24.0));
    let names: Vec<&str> = path.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["path-000", "path-001"]);
    let camera = path.cameras[1].camera;
    assert_eq!((camera.pinhole.width(), camera.pinhole.height()), (16, 12));
    assert_sees(&camera, expected);

    let mut other = camera_path();
    other["camera_path"][1]["fov"] = json!(180.0);
    let error = path_of("camera_path.json", other.to_string()).expect_err("no lens");
    assert!(error.starts_with("/camera_path.json: camera_path[1].fov: "), "{error}");
    let mut other = camera_path();
    other["camera_type"] = json!("equirectangular");
    let error = path_of("camera_path.json", other.to_string()).expect_err("no pinhole");
    assert!(error.contains("camera_type") && error.contains("equirectangular"), "{error}");
    let mut other = camera_path();
    other["camera_path"] = json!([]);
    assert_eq!(path_of("p.json", other.to_string()), Err("/p.json: the path has no cameras".to_owned()));
}

/// What the data parser did is undone: turned, moved and scaled cameras are where they were.
#[test]
fn the_world_of_nerfstudios_training() {
    let folder = scenes::transforms_folder(&{
        let mut transforms = scenes::transforms();
        // The scene itself was turned before: (x, y, z) became (y, -x, z) + (0, 0, 1).
        transforms["applied_transform"] = json!([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 1]]);
        transforms
    });
    let scene = open(&folder);
    // The parser: (x, y, z) of the files became 0.5 * ((z, x, y) + (3, 4, 5)).
    let cycled = |v: [f64; 3]| [v[2], v[0], v[1]];
    let rows: Vec<[f64; 4]> =
        flat().chunks(4).map(|r| [0, 1, 2, 3].map(|k| r[k].as_f64().expect("a number"))).collect();
    let column = |k: usize| cycled([rows[0][k], rows[1][k], rows[2][k]]);
    let axes = [column(0), column(1), column(2)];
    let centre = column(3);
    let offset = [3.0, 4.0, 5.0];
    let moved: Vec<f64> = (0..3)
        .flat_map(|row| [axes[0][row], axes[1][row], axes[2][row], 0.5 * (centre[row] + offset[row])])
        .chain([0.0, 0.0, 0.0, 1.0])
        .collect();
    let mut path = camera_path();
    path["camera_path"][0]["camera_to_world"] = json!(moved);
    folder.write("run/camera_path.json", path.to_string());
    // What it writes begins before the scene was turned: the product of both.
    let parser = json!({ "transform": [[0, 0, 1, 4], [0, 1, 0, 4], [-1, 0, 0, 5]], "scale": 0.5 });
    folder.write("run/dataparser_transforms.json", parser.to_string());
    let open_path = || CameraPath::open(&folder.join("run/camera_path.json"), &scene, &scene.views[0].camera.pinhole);
    let path = open_path().expect("a path");
    assert_eq!(path.warning, None);
    let camera = path.cameras[0].camera;
    let rows = scene.views[0].camera.pose.to_opencv();
    for (row, expected) in camera.pose.to_opencv().iter().zip(rows) {
        row.iter().zip(expected).for_each(|(value, expected)| assert!((value - expected).abs() < 1.0e-5, "{row:?}"));
    }
    folder.write(
        "run/dataparser_transforms.json",
        json!({ "transform": [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]], "scale": 1 }).to_string(),
    );
    let error = open_path().expect_err("no rotation").to_string();
    assert!(error.contains("dataparser_transforms.json: transform is not a rotation"), "{error}");
}

#[test]
fn transforms_without_photographs() {
    let expected = own_pixel(&open(&scenes::srn()));
    let frame = |name: &str| json!({ "file_path": name, "transform_matrix": scenes::opengl_matrix() });
    // Intrinsics are those of the scene where the file has none.
    let path =
        path_of("t.json", json!({ "frames": [frame("nowhere/a.png"), frame("b")] }).to_string()).expect("a path");
    let names: Vec<&str> = path.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!((names, path.frames_per_second), (vec!["a", "b"], None));
    assert_sees(&path.cameras[0].camera, expected);
    // Equal names are replaced.
    let path = path_of("t.json", json!({ "frames": [frame("1/a"), frame("2/a")] }).to_string()).expect("a path");
    assert_eq!(path.cameras[1].name, "path-001");
    // An angle without a size is for the size of the scene's photographs.
    let angle = 2.0 * (8.0_f64 / 20.0).atan();
    let text =
        json!({ "camera_angle_x": angle, "k1": 0.1, "frames": [{ "transform_matrix": scenes::opengl_matrix() }] });
    let path = path_of("t.json", text.to_string()).expect("a path");
    assert_sees(&path.cameras[0].camera, expected);
    let error = path_of("t.json", r#"{"frames": [{"file_path": "a"}]}"#).expect_err("no pose");
    assert!(error.contains("frames[0].transform_matrix"), "{error}");
    assert!(path_of("t.json", "{}").expect_err("nothing").contains("no camera path; looked for nerfstudio's"));
}

#[test]
fn tables_of_poses() {
    let expected = own_pixel(&open(&scenes::srn()));
    let m = WORLD_FROM_CAMERA;
    let names: Vec<String> = (0..12).map(|k| format!("m{}{}", k / 4, k % 4)).collect();
    let numbers: Vec<String> = m[..12].iter().map(f64::to_string).collect();
    let text = format!("# poses\nname, {}\n\"a, b\", {}\n", names.join(", "), numbers.join(", "));
    let path = path_of("poses.csv", text).expect("a path");
    assert_eq!(path.cameras[0].name, "a, b");
    assert_sees(&path.cameras[0].camera, expected);
    // COLMAP's quaternion is from the world to the camera: its conjugate is meant here, of any length.
    let [w, x, y, z] = super::made::QUATERNION;
    let centre = [m[3], m[7], m[11]];
    let text = format!(
        "qx,qy,qz,qw,x,y,z,fx,fy,cx,cy,width,height\n{},{},{},{},{},{},{},40,40,16,12,32,24\n",
        -2.0 * x,
        -2.0 * y,
        -2.0 * z,
        2.0 * w,
        centre[0],
        centre[1],
        centre[2]
    );
    let camera = path_of("poses.CSV", text).expect("a path").cameras[0].camera;
    assert_eq!((camera.pinhole.width(), camera.pinhole.focal()), (32, [40.0; 2]));
    assert_sees(&camera, expected.map(|value| 2.0 * value));
    // Looking at a point puts it in the middle.
    let [px, py, pz] = POINT_WORLD;
    let text = format!("x,y,z,look_x,look_y,look_z\n7,1,2,{px},{py},{pz}\n");
    let camera = path_of("poses.csv", text).expect("a path").cameras[0].camera;
    let seen = camera.project(Vec3::new(px, py, pz));
    assert!((seen.x - 8.0).abs() < 1.0e-3 && (seen.y - 6.0).abs() < 1.0e-3 && seen.depth > 0.0, "{seen:?}");

    for (text, part) in [
        ("x,y,z\n1,2,3\n", ":1: no column says where the cameras look"),
        ("x,y,qw,qx,qy,qz\n1,2,3,4,5,6\n", ":1: column \"z\" is missing"),
        ("x,y,z,up\n1,2,3,4\n", ":1: there is no column \"up\""),
        ("x,x,y,z\n", ":1: column \"x\" is there twice"),
        ("x,y,z,look_x,look_y,look_z\n1,2,3,4,5,6\n1,2,3,4,five,6\n", ":3: \"five\" is not a number"),
        ("x;y;z;look_x\n1;2;3;4\n", ":1: there is no column \"x;y;z;look_x\": columns are separated by commas"),
        ("x,y,z,look_x,look_y,look_z\n1,2,3,4,5\n", "not a table of comma-separated values"),
        ("x,y,z,qw,qx,qy,qz\n1,2,3,0,0,0,0\n", ":2: qw qx qy qz are no rotation"),
        ("x,y,z,look_x,look_y,look_z\n1,2,3,1,2,3\n", ":2: the camera stands at the point that it is to look at"),
        ("name,x,y,z,qw,qx,qy,qz\na,0,0,0,1,0,0,0\na.png,1,0,0,1,0,0,0\n", ":3: name \"a\" is that of line 2, too"),
        ("x,y,z,look_x,look_y,look_z\n", "the path has no cameras"),
    ] {
        let error = path_of("poses.csv", text).expect_err(part);
        assert!(error.starts_with("/poses.csv") && error.contains(part), "{error:?} does not hold {part:?}");
    }
}

fn pinhole() -> Pinhole {
    Pinhole::new([200.0; 2], [80.0, 60.0], 160, 120).expect("a pinhole")
}

fn looking(centre: [f32; 3], at: [f32; 3]) -> Camera {
    let pose = Pose::look_at(Vec3::from_array(centre), Vec3::from_array(at), Vec3::Z).expect("a pose");
    Camera { pose, pinhole: pinhole() }
}

/// What both ends look at stays in the middle; height and distance from the axis are between theirs.
#[test]
fn the_way_around_a_subject_keeps_it_in_the_middle() {
    let subject = Vec3::new(1.0, -2.0, 0.5);
    let (first, last) = (looking([5.0, -2.0, 1.0], subject.into()), looking([-1.0, -2.1, 3.0], subject.into()));
    let path = generated::between(&first, &last, Vec3::Z, 9).expect("a way");
    assert_eq!(path.len(), 9);
    for (camera, end) in [(&path[0], &first), (&path[8], &last)] {
        assert!(camera.pose.distance(&end.pose) < 1.0e-4 && camera.pose.rotation_angle(&end.pose) < 1.0e-3);
    }
    for (step, camera) in path.iter().enumerate() {
        let seen = camera.project(subject);
        assert!((seen.x - 80.0).hypot(seen.y - 60.0) < 0.05, "step {step}: {seen:?}");
        let (offset, share) = (camera.pose.centre_world() - subject, step as f32 / 8.0);
        let radius = offset.x.hypot(offset.y);
        assert!((offset.z - (0.5 + 2.0 * share)).abs() < 1.0e-3, "step {step}: {offset}");
        assert!((radius - (4.0 + (2.0_f32.hypot(0.1) - 4.0) * share)).abs() < 1.0e-3, "step {step}: {offset}");
        // The shorter way: on the side of the negative y axis.
        assert!(step == 0 || offset.y < 0.0, "step {step}: {offset}");
    }
    // Ends that look past the subject are met as they are.
    let turned = Pose::look_at(Vec3::new(0.0, 4.0, 2.0), subject + Vec3::new(0.3, 0.2, 0.1), Vec3::new(0.1, 0.0, 1.0));
    let other = Camera { pose: turned.expect("a pose"), ..first };
    let path = generated::between(&other, &last, Vec3::Z, 5).expect("a way");
    assert!(path[0].pose.rotation_angle(&other.pose) < 1.0e-3 && path[4].pose.rotation_angle(&last.pose) < 1.0e-3);
    // Cameras side by side go straight.
    let (left, right) = (looking([0.0, 0.0, 0.0], [0.0, 9.0, 0.0]), looking([2.0, 0.0, 0.0], [2.0, 9.0, 0.0]));
    let middle = generated::between(&left, &right, Vec3::Z, 3).expect("a way")[1];
    assert!(middle.pose.centre_world().distance(Vec3::X) < 1.0e-5);
    assert_eq!(generated::between(&left, &right, Vec3::Z, 1).expect("one").len(), 1);
}

#[test]
fn a_spiral_stays_before_what_the_cameras_see() {
    let cameras: Vec<Camera> = (0..12)
        .map(|k| [(k % 4) as f32 - 1.5, (k / 4) as f32 - 1.0])
        .map(|[x, z]| looking([x, 0.0, z], [x, 8.0, z]))
        .collect();
    let spiral = generated::spiral(&cameras, pinhole(), &[[4.0, 20.0]], 40).expect("a spiral");
    // 1 / (0.25 / 4 + 0.75 / 20) = 10.
    let subject = Vec3::new(0.0, 10.0, 0.0);
    for camera in &spiral {
        let centre = camera.pose.centre_world();
        assert!(centre.x.abs() <= 1.5 && centre.z.abs() <= 1.01 && centre.y.abs() < 1.0e-4, "{centre}");
        let seen = camera.project(subject);
        assert!((seen.x - 80.0).abs() < 0.01 && (seen.y - 60.0).abs() < 0.01, "{seen:?}");
    }
    let widest = spiral.iter().map(|camera| camera.pose.centre_world().x).fold(0.0, f32::max);
    assert!(widest > 1.4, "{widest}");
    // Cameras all around have none, and a single one has none.
    let around: Vec<Camera> =
        (0..8).map(|k| (k as f32).sin_cos()).map(|(s, c)| looking([4.0 * c, 4.0 * s, 1.0], [0.0; 3])).collect();
    assert_eq!(generated::spiral(&around, pinhole(), &[], 5), None);
    assert_eq!(generated::spiral(&cameras[..1], pinhole(), &[], 5), None);
}

#[test]
fn selections_along_paths() {
    let scene = Scene::open(data("toy")).expect("the sample");
    let resolve = |path: PathChoice| -> Result<FewShot, String> {
        let selection = Selection { path: Some(path), ..Selection::default() };
        selection.resolve(&scene, 2).map_err(|error| error.to_string())
    };
    let between = |first: &str, last: &str, count| {
        resolve(PathChoice::Between { first: first.to_owned(), last: last.to_owned(), count })
    };
    let job = between("3", "000007", 4).expect("a way");
    assert_eq!((job.sources.len(), job.targets.len(), job.targets[3].name.as_str()), (24, 4, "between-003"));
    let ends = [(&job.targets[0], 3), (&job.targets[3], 7)];
    ends.iter()
        .for_each(|(target, view)| assert!(target.camera.pose.distance(&scene.views[*view].camera.pose) < 1.0e-4));
    assert!(between("3", "nobody", 4).expect_err("no view").contains("has no view 'nobody'"));
    assert!(resolve(PathChoice::Spiral(5)).expect_err("around").contains("span no spiral"));
    // A path beside chosen views; a name that is there already.
    let folder = Folder::new();
    let table = folder.file("poses.csv");
    folder.write("poses.csv", "name,x,y,z,look_x,look_y,look_z\n000005,1,1,1,0,0,0\n");
    let mut selection = Selection { path: Some(PathChoice::File(table)), ..Selection::default() };
    assert_eq!(selection.resolve(&scene, 2).expect("a job").targets[0].name, "000005");
    selection.targets = Some("5".to_owned());
    let error = selection.resolve(&scene, 2).expect_err("two of a name").to_string();
    assert!(error.ends_with("two targets are called '000005'"), "{error}");
}

/// Names are given back as they stand in a table, but for the extension of a picture; results are files of the name.
#[test]
fn names_of_a_table_are_kept_or_refused() {
    let table = |names: &[&str]| {
        let line = |name: &&str| format!("\"{}\",0,0,0,1,0,0,0\n", name.replace('"', "\"\""));
        let text = format!("name,x,y,z,qw,qx,qy,qz\n{}", names.iter().map(line).collect::<String>());
        let path = path_of("path.csv", text)?;
        Ok::<_, String>(path.cameras.into_iter().map(|camera| camera.name).collect::<Vec<String>>())
    };
    let kept = ["v1.5", "v1.6", "a,b", "\"q\"", "two\nlines", "\u{1b}[2J", "\u{e9}", ".hidden", &"x".repeat(240)];
    assert_eq!(table(&kept), Ok(kept.map(str::to_owned).to_vec()));
    assert_eq!(table(&["out/a.png", "b.JPG"]), Ok(["a", "b"].map(str::to_owned).to_vec()));
    for (name, reason) in [("nul\0", "it holds a NUL"), (&*"x".repeat(241), "it is too long")] {
        let error = table(&["a", name]).expect_err("no name of a file");
        assert!(error.contains("cannot be the name of a view") && error.contains(reason), "{error}");
    }
}

/// Nobody knows what nerfstudio did to the world.
#[test]
fn a_path_of_the_viewer_alone_is_doubtful() {
    let folder = scenes::srn();
    let scene = open(&folder);
    folder.write("run/camera_path.json", camera_path().to_string());
    let path = folder.join("run/camera_path.json").display().to_string();
    let choice = |text: &str| Selection { path: Some(PathChoice::File(text.into())), ..Selection::default() };
    let warning = choice(&path).resolve(&scene, 1).expect("a job").warning.expect("a warning");
    assert!(warning.contains("camera_path.json") && warning.contains("dataparser_transforms.json"), "{warning}");
}
