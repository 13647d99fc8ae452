//! What is said of targets and photographs before anything is rendered: names that are one file on some systems,
//! targets that face away from everything, exposures far apart; and that equal runs say the same.

use super::made::open;
use image::{Rgba, RgbaImage};
use viewfuse::job::progress::Silent;
use viewfuse::scene::few_shot::{FewShot, PathChoice, Selection, Target, away_warning, item_of, target_of, view_list};
use viewfuse::scene::photographs::{Album, BackgroundChoice};
use viewfuse::scene::{Scene, Split};
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::pose::Pose;
use viewfuse_tests::places::data;
use viewfuse_tests::scenes::{Folder, WORLD_FROM_CAMERA, words};

/// An SRN scene of photographs with these names.
fn called(names: &[&str]) -> Folder {
    let folder = Folder::new();
    for (index, name) in names.iter().enumerate() {
        let mut pose = WORLD_FROM_CAMERA;
        pose[3] += index as f64;
        folder.image(&format!("rgb/{name}.png"), 16, 12).write(&format!("pose/{name}.txt"), words(&pose));
    }
    folder.write("intrinsics.txt", "20. 8. 6. 0.\n0. 0. 0.\n1.\n12 16\n");
    folder
}

#[test]
fn targets_that_would_be_one_file_are_refused() {
    for (first, second) in [("a", "A"), ("B\u{e4}r", "Ba\u{308}r"), ("\u{c9}t\u{e9}", "e\u{301}te\u{301}")] {
        let folder = called(&[first, second, "c", "d"]);
        let scene = open(&folder);
        let resolve = |targets: &str| {
            let selection = Selection { targets: Some(targets.to_owned()), ..Selection::default() };
            selection.resolve(&scene, 1).map_err(|error| error.to_string())
        };
        let error = resolve(&format!("{first},{second}")).expect_err("two targets of one file");
        assert!(error.contains(&format!("'{first}'")) && error.contains(&format!("'{second}'")), "{error}");
        assert!(error.contains("the same files where file names ignore case"), "{error}");
        // As sources they make no files.
        for targets in [first, second, "c,d"] {
            resolve(targets).expect("targets with names of their own");
        }
    }
}

/// A second photograph of a pose next to the first shows no depth, and held out it is no test of a new view.
#[test]
fn a_pose_is_one_source() {
    let folder = called(&["a", "b", "c", "d"]);
    let moved = |by: f64| {
        let mut pose = WORLD_FROM_CAMERA;
        pose[3] += by;
        words(&pose)
    };
    folder.write("pose/c.txt", moved(1.0)).write("pose/d.txt", moved(0.2));
    let scene = open(&folder);
    let twins = "views 'b' and 'c' have the same pose";
    assert!(scene.pose_warnings().iter().any(|warning| warning.contains(twins)), "{:?}", scene.pose_warnings());
    let sources = |targets: &str, sources: Option<&str>| {
        let selection = Selection {
            targets: Some(targets.to_owned()),
            sources: sources.map(str::to_owned),
            ..Selection::default()
        };
        selection.resolve(&scene, 1).expect("a job").sources
    };
    assert_eq!(sources("a", None), [1, 3]);
    // With the other one as a source a target would be no new view; what is listed is taken.
    assert_eq!(sources("b", None), [0, 3]);
    assert_eq!(sources("b", Some("a,c")), [0, 2]);
    assert_eq!(sources("a", Some("b,c")), [1, 2]);
    // Of a field that shows no sources, targets are some where nothing else is left.
    let shared = |targets: &str| {
        let selection = Selection { targets: Some(targets.to_owned()), may_share: true, ..Selection::default() };
        selection.resolve(&scene, 1).expect("a job").sources
    };
    assert_eq!((shared("a"), shared("all")), (vec![1, 3], vec![0, 1, 3]));
    // Nearly the same pose is the same.
    let near = called(&["a", "b", "c", "d"]);
    near.write("pose/b.txt", moved(1.0e-5));
    assert!(open(&near).pose_warnings().iter().any(|warning| warning.contains("have the same pose")));
    assert_eq!(open(&called(&["a", "b"])).pose_warnings(), Vec::<String>::new());
    // Whichever splits they are of: the same photographs may be in two.
    let mut of_two = Scene::open(data("toy")).expect("a scene");
    let mut again = of_two.views[3].clone();
    (again.name, again.split) = ("again".to_owned(), Some(Split::Test));
    of_two.views.push(again);
    let selection = Selection { targets: Some("again".to_owned()), ..Selection::default() };
    assert!(!selection.resolve(&of_two, 1).expect("a job").sources.contains(&3));
}

#[test]
fn a_principal_point_outside_of_the_photograph_is_told() {
    let folder = called(&["a", "b"]);
    assert_eq!(open(&folder).pose_warnings(), Vec::<String>::new());
    folder.write("intrinsics.txt", "20. 17. 6. 0.\n0. 0. 0.\n1.\n12 16\n");
    let warnings = open(&folder).pose_warnings();
    let told = "the principal point of 2 of 2 photographs lies outside of them: of 'a' at (17, 6), 16 x 12 pixels";
    assert!(warnings.len() == 1 && warnings[0].starts_with(told), "{warnings:?}");
    // That of photographs twice as large lies at the corner.
    folder.write("intrinsics.txt", "20. 16. 12. 0.\n0. 0. 0.\n1.\n12 16\n");
    let warnings = open(&folder).pose_warnings();
    let told =
        "the principal point of 2 of 2 photographs lies far from their middle: of 'a' at (16, 12), 16 x 12 pixels";
    assert!(warnings.len() == 1 && warnings[0].starts_with(told), "{warnings:?}");
    folder.write("intrinsics.txt", "20. 10. 6. 0.\n0. 0. 0.\n1.\n12 16\n");
    assert_eq!(open(&folder).pose_warnings(), Vec::<String>::new(), "a lens that is not centred");
}

#[test]
fn sources_that_no_scene_has_are_no_panic() {
    let scene = Scene::open(data("toy")).expect("a scene");
    let job = FewShot { sources: vec![1, 999], targets: vec![target_of(&scene, 0)], ..FewShot::default() };
    assert_eq!(away_warning(&scene, &job), None);
}

#[test]
fn what_no_scene_has_is_an_error() {
    let scene = Scene::open(data("toy")).expect("a scene");
    let along = Selection { path: Some(PathChoice::Orbit(2)), targets: Some("all".to_owned()), ..Selection::default() };
    assert!(along.resolve(&scene, 0).is_err_and(|error| error.to_string().contains("source")), "a path of no sources");
    let error = Album::open(&scene, [0, 999], &Silent).map(|_| ()).expect_err("no such view").to_string();
    assert!(error.contains("999"), "{error}");
    let album = Album::open(&scene, [0, 1], &Silent).expect("photographs");
    for colour in [[f32::NAN, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, -0.1]] {
        let choice = BackgroundChoice::Colour(colour);
        let error = album.sources(&[0, 1], 64, choice, &Silent).expect_err("no colour").to_string();
        assert!(error.contains("is no colour"), "{error}");
    }
}

#[test]
fn intrinsics_that_are_no_pixels_are_told() {
    let folder = called(&["a", "b", "c"]);
    let told = || open(&folder).pose_warnings().into_iter().find(|warning| warning.contains("150 degrees"));
    assert_eq!(told(), None);
    // Shares of the width.
    folder.write("intrinsics.txt", "1.25 0.5 0.5 0.\n0. 0. 0.\n1.\n12 16\n");
    let told = told().expect("a warning");
    assert!(told.contains("3 of 3 photographs") && told.contains("'a' has a focal length of 1.25 pixels"), "{told}");
}

fn job(scene: &Scene, target: Camera) -> FewShot {
    let target = Target { name: "away".to_owned(), camera: target, truth: None };
    FewShot { sources: (0..8).collect(), targets: vec![target_of(scene, 20), target], ..FewShot::default() }
}

#[test]
fn a_target_that_faces_away_is_told() {
    let scene = Scene::open(data("toy")).expect("the sample scene");
    let camera = scene.views[20].camera;
    let centre = camera.pose.centre_world();
    let turned = Pose::look_at(centre, centre * 3.0, Vec3::Z).expect("a pose");
    // Above the object, looking up: no source looks there.
    let up = Pose::look_at(Vec3::new(0.0, 0.1, 3.0), Vec3::new(0.0, 0.3, 9.0), Vec3::Y).expect("a pose");
    let warning = away_warning(&scene, &job(&scene, Camera { pose: up, ..camera })).expect("a warning");
    assert!(warning.contains("target 'away' faces away from everything that the sources show"), "{warning}");
    assert_eq!(away_warning(&scene, &job(&scene, camera)), None);
    // From behind the object towards it, as no source looks, but what it sees they see.
    let behind = Pose::look_at(-centre, Vec3::ZERO, Vec3::Z).expect("a pose");
    assert_eq!(away_warning(&scene, &job(&scene, Camera { pose: behind, ..camera })), None);
    // One source alone, and away from it.
    let alone = FewShot { sources: vec![20], ..job(&scene, Camera { pose: turned, ..camera }) };
    assert!(away_warning(&scene, &alone).is_some());
}

/// Names that a list takes for something else are given by their index.
#[test]
fn every_view_is_an_item_of_a_list() {
    let folder = called(&["0", "x,y", "all", "0..2", "train", "5"]);
    let scene = open(&folder);
    for view in 0..scene.views.len() {
        let item = item_of(&scene, view);
        assert_eq!(view_list(&scene, &item).expect(&item), [view], "{item}");
        let name = &scene.views[view].name;
        assert_eq!(item == *name, !name.contains(','), "{item}");
    }
}

fn warnings(scene: &Scene, views: &[usize]) -> Vec<String> {
    let album = Album::open(scene, views.iter().copied(), &Silent).expect("photographs");
    album.sources(views, 64, BackgroundChoice::None, &Silent).expect("sources").warnings
}

#[test]
fn grey_photographs_among_others_are_told() {
    let folder = called(&["0", "1", "2"]);
    for (name, colour) in [("0", [90, 120, 80]), ("1", [100, 102, 104]), ("2", [80, 110, 70])] {
        let [red, green, blue] = colour;
        let picture = RgbaImage::from_pixel(16, 12, Rgba([red, green, blue, 255]));
        picture.save(folder.file(&format!("rgb/{name}.png"))).expect("saved");
    }
    let scene = open(&folder);
    let told = warnings(&scene, &[0, 1, 2]);
    assert!(told.len() == 1 && told[0].starts_with("1 of 3 photographs are grey ('1' is the first)"), "{told:?}");
    // All of them may be.
    assert_eq!(warnings(&scene, &[1]), Vec::<String>::new());
    assert_eq!(warnings(&scene, &[0, 2]), Vec::<String>::new());
}

/// Values of 12 bits in the place of 16 are a fiftieth of what they mean.
#[test]
fn nearly_black_photographs_are_told() {
    let folder = called(&["0", "1"]);
    let save = |name: &str, level: u16| {
        let picture = image::ImageBuffer::from_fn(16, 12, |x, y| image::Rgb([level, level / 2, (x * y) as u16]));
        picture.save(folder.file(&format!("rgb/{name}.png"))).expect("saved");
    };
    save("0", 16_000);
    save("1", 4_095);
    let scene = open(&folder);
    let told = warnings(&scene, &[0, 1]);
    assert!(
        told.iter().any(|told| told.starts_with("no pixel of the photographs is brighter than 62 of 255")),
        "{told:?}"
    );
    save("1", 30_000);
    let told = warnings(&open(&folder), &[0, 1]);
    assert!(told.iter().all(|told| !told.contains("no pixel")), "{told:?}");
}

#[test]
fn exposures_far_apart_are_told() {
    let folder = called(&["0", "1", "2", "3"]);
    // In linear light a tenth is 0.35 of the stored value.
    for (name, level) in [("0", 200), ("1", 190), ("2", 70), ("3", 120)] {
        RgbaImage::from_pixel(16, 12, Rgba([level, level, level, 255]))
            .save(folder.file(&format!("rgb/{name}.png")))
            .expect("saved");
    }
    let scene = open(&folder);
    let told = warnings(&scene, &[0, 1, 2, 3]);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("photograph '0' is 10 times as bright as '2'"), "{told:?}");
    assert_eq!(warnings(&scene, &[0, 1, 3]), Vec::<String>::new());
    for name in ["toy", "room", "car"] {
        let scene = Scene::open(data(name)).expect("a scene");
        let views: Vec<usize> = (0..scene.views.len()).filter(|view| scene.views[*view].image.is_some()).collect();
        let told = warnings(&scene, &views);
        assert!(told.iter().all(|warning| !warning.contains("times as bright")), "{name}: {told:?}");
    }
}

/// Several photographs show nothing: the first in the order of the scene is named, whichever thread finds another one
/// sooner.
#[test]
fn equal_runs_name_the_same_photograph() {
    let folder = called(&["0", "1", "2", "3", "4", "5", "6", "7"]);
    for name in 0..8 {
        let level = if name < 2 { 10 } else { 255 };
        let picture = RgbaImage::from_fn(160, 120, |x, y| {
            let is_object = x.abs_diff(80) < 20 && y.abs_diff(60) < 20;
            Rgba([if is_object { level } else { 255 }, 255, 255, 255])
        });
        picture.save(folder.file(&format!("rgb/{name}.png"))).expect("saved");
    }
    folder.write("intrinsics.txt", "200. 80. 60. 0.\n0. 0. 0.\n1.\n120 160\n");
    let scene = open(&folder);
    for _ in 0..40 {
        let album = Album::open(&scene, 0..8, &Silent).expect("photographs");
        let choice = BackgroundChoice::Colour([1.0; 3]);
        let error = album.sources(&[0, 1, 2, 3, 4, 5, 6, 7], 160, choice, &Silent).expect_err("no object").to_string();
        assert!(error.contains("2.png"), "{error}");
    }
}
