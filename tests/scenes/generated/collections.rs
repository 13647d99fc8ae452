//! Collections of scenes: exact poses, the same pictures again, going on after an interruption.

use super::folders::assert_poses;
use std::fs;
use std::path::Path;
use viewfuse::job::progress::Silent;
use viewfuse::scene::Scene;
use viewfuse::scene::dataset::{Dataset, Split};
use viewfuse_lab::scenes::cameras::{random_views, sphere, spiral_views};
use viewfuse_lab::scenes::collection::{Made, MakeError, ObjectCounts, RAYS_PER_SIDE, Settings, make};
use viewfuse_lab::scenes::{car, render_with};
use viewfuse_tests::command::files_below;
use viewfuse_tests::scenes::Folder;

const COUNTS: ObjectCounts = ObjectCounts { train: 3, validation: 1, test: 1 };

fn settings() -> Settings {
    Settings::new(11, 64, 2, 3)
}

fn made(out: &Path, settings: &Settings, counts: ObjectCounts) -> Result<Made, MakeError> {
    make(out, settings, counts, &Silent)
}

#[test]
fn poses_are_exact_and_pictures_are_those_of_the_object() {
    let place = Folder::new();
    let out = place.join("deep/cars");
    assert_eq!(
        made(&out, &settings(), COUNTS).expect("a collection"),
        Made { new_count: 5, kept_count: 0, more_count: 0 }
    );
    let sphere = sphere(64).expect("a size");
    let spiral = spiral_views(&sphere, 3).expect("cameras");
    for (folder, index, cameras) in [
        ("cars_train/000002", 2, random_views(&sphere, 11, 2, 2).expect("cameras")),
        ("cars_val/000000", 1_000_000, spiral.clone()),
        ("cars_test/000000", 2_000_000, spiral),
    ] {
        assert_poses(&out.join(folder), &cameras);
        let object = car(11, index);
        let stored = image::open(out.join(folder).join("rgb/000001.png")).expect("a picture").into_rgba8();
        assert!(stored == render_with(&object, &cameras[1], RAYS_PER_SIDE), "{folder} shows another object");
        let scene = Scene::open(out.join(folder)).expect("a scene");
        assert_eq!((scene.layout, scene.views.len()), ("srn", cameras.len()));
        assert_eq!(scene.views[1].camera, cameras[1], "{folder}");
    }
    for (split, count) in [(Split::Train, 3), (Split::Validation, 1), (Split::Test, 1)] {
        let dataset = Dataset::open(out.join("cars"), split).expect("a data set");
        assert_eq!((dataset.name.as_str(), dataset.scenes.len()), ("cars", count));
    }
}

#[test]
fn what_is_there_is_kept_and_what_is_missing_is_made() {
    let place = Folder::new();
    made(&place, &settings(), COUNTS).expect("a collection");
    let before = files_below(&place);
    let picture = place.join("cars_train/000001/rgb/000000.png");
    let bytes = fs::read(&picture).expect("a picture");

    fs::remove_dir_all(place.join("cars_train/000001")).expect("a scene to delete");
    let mark = place.join("cars_train/000000/rgb/000000.png");
    fs::write(&mark, "kept").expect("a mark");
    assert_eq!(
        made(&place, &settings(), COUNTS).expect("the rest"),
        Made { new_count: 1, kept_count: 4, more_count: 0 }
    );
    assert_eq!(fs::read(&picture).expect("the picture again"), bytes, "bit for bit");
    assert_eq!(fs::read(&mark).expect("the mark"), b"kept");

    let more = ObjectCounts { train: 4, ..COUNTS };
    assert_eq!(made(&place, &settings(), more).expect("one more"), Made { new_count: 1, kept_count: 5, more_count: 0 });
    assert_eq!(fs::read(&mark).expect("the mark"), b"kept");
    let names = |files: Vec<(std::path::PathBuf, u64)>| files.into_iter().map(|(path, _)| path).collect::<Vec<_>>();
    let after = names(files_below(&place));
    assert!(names(before).iter().all(|path| after.contains(path)), "something is gone");
}

#[test]
fn other_settings_are_refused_before_anything_is_written() {
    let place = Folder::new();
    let few = ObjectCounts { train: 1, validation: 0, test: 0 };
    made(&place, &settings(), few).expect("a collection");
    let before = files_below(&place);
    for other in [
        Settings::new(12, 64, 2, 3),
        Settings::new(11, 128, 2, 3),
        Settings::new(11, 64, 3, 3),
        Settings::new(11, 64, 2, 4),
    ] {
        let error = made(&place, &other, COUNTS).expect_err("other settings");
        assert!(matches!(error, MakeError::OtherSettings { .. }), "{error}");
        assert!(error.to_string().contains("cars.json: what is there was made with other settings"), "{error}");
    }
    fs::write(place.join("cars.json"), "{}").expect("a file");
    let error = made(&place, &settings(), COUNTS).expect_err("no settings in the file");
    assert!(matches!(error, MakeError::Parse { .. }), "{error}");
    fs::remove_file(place.join("cars.json")).expect("a file to delete");
    let error = made(&place, &settings(), COUNTS).expect_err("no file of settings");
    assert!(matches!(error, MakeError::NoSettings { .. }), "{error}");
    assert_eq!(files_below(&place).len(), before.len() - 1, "something was written");
    let error = made(&place, &Settings::new(11, 0, 2, 3), COUNTS).expect_err("no pixels");
    assert!(matches!(error, MakeError::Size { size: 0, .. }), "{error}");
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads_or_objects() {
    let bytes = |threads: usize, train: u32| {
        let place = Folder::new();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        let counts = ObjectCounts { train, validation: 0, test: 0 };
        pool.install(|| made(&place, &settings(), counts)).expect("a collection");
        fs::read(place.join("cars_train/000001/rgb/000001.png")).expect("a picture")
    };
    assert_eq!(bytes(1, 2), bytes(3, 4));
}
