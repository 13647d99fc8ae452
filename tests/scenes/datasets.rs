//! Data sets: every way in which their folders are laid out, and what is said where there is none.

use viewfuse::scene::dataset::{Dataset, DatasetError, Split};
use viewfuse_tests::scenes::Folder;

/// A folder with scenes: only what is looked at to find them.
fn folder(scenes: &[&str]) -> Folder {
    let folder = Folder::new();
    for scene in scenes {
        folder.write(&format!("{scene}/intrinsics.txt"), "");
    }
    folder
}

/// Opens a path in a folder; the scenes are told relative to it.
fn open(folder: &Folder, path: &str, split: Split) -> Result<(String, Vec<String>), DatasetError> {
    let Dataset { name, scenes } = Dataset::open(folder.join(path), split)?;
    let relative = |scene: &std::path::PathBuf| {
        scene.strip_prefix(folder).expect("inside the folder").to_string_lossy().into_owned()
    };
    Ok((name, scenes.iter().map(relative).collect()))
}

#[track_caller]
fn assert_found(folder: &Folder, path: &str, split: Split, name: &str, scenes: &[&str]) {
    let (found_name, found) = open(folder, path, split).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!((found_name.as_str(), found.iter().map(String::as_str).collect::<Vec<_>>()), (name, scenes.to_vec()));
}

#[test]
fn a_path_may_be_short_for_its_splits() {
    let folder = folder(&["srn/cars_train/b", "srn/cars_train/a", "srn/cars_val/c", "srn/cars_test/d"]);
    for path in ["srn/cars", "srn/cars/"] {
        assert_found(&folder, path, Split::Train, "cars", &["srn/cars_train/a", "srn/cars_train/b"]);
        assert_found(&folder, path, Split::Validation, "cars", &["srn/cars_val/c"]);
        assert_found(&folder, path, Split::Test, "cars", &["srn/cars_test/d"]);
    }
}

#[test]
fn a_path_may_be_the_folder_around_the_splits() {
    let folder = folder(&["cars/cars_train/a", "cars/cars_test/d", "cars/notes/x/y"]);
    assert_found(&folder, "cars", Split::Train, "cars", &["cars/cars_train/a"]);
    assert_found(&folder, "cars", Split::Test, "cars", &["cars/cars_test/d"]);
    assert!(matches!(open(&folder, "cars", Split::Validation), Err(DatasetError::NotFound { .. })));
}

#[test]
fn the_chairs_have_a_folder_more() {
    let folder = folder(&["chairs_train/chairs_2.0_train/a", "chairs_train/chairs_2.0_train/b", "chairs_val/c"]);
    let both = ["chairs_train/chairs_2.0_train/a", "chairs_train/chairs_2.0_train/b"];
    assert_found(&folder, "chairs", Split::Train, "chairs", &both);
    assert_found(&folder, "chairs", Split::Validation, "chairs", &["chairs_val/c"]);
    assert_found(&folder, "", Split::Train, "chairs", &both);
    assert_found(&folder, "chairs_train", Split::Train, "chairs_2.0", &both);
}

/// What is completed to one split's folder is not taken for another one: validation would be on what was learned.
#[test]
fn a_folder_of_one_split_is_not_another_one() {
    let folder = folder(&["srn/cars_train/a", "srn/cars_val/c"]);
    assert_found(&folder, "srn/cars_train", Split::Train, "cars_train", &["srn/cars_train/a"]);
    for split in [Split::Validation, Split::Test] {
        let error = open(&folder, "srn/cars_train", split).expect_err("another split").to_string();
        assert!(error.contains("cars_train: is the folder of the train split by its name; for the"), "{error}");
        assert!(error.ends_with("srn/cars"), "{error}");
    }
}

#[test]
fn a_folder_of_scenes_serves_every_split() {
    let folder = folder(&["mine/b", "mine/a", "mine/.unfinished-1/c"]);
    folder.write("mine/readme.txt", "").write("mine/empty/none.txt", "");
    for split in [Split::Train, Split::Validation, Split::Test] {
        assert_found(&folder, "mine", split, "mine", &["mine/a", "mine/b"]);
    }
}

#[test]
fn what_is_no_data_set_is_told_with_what_was_looked_for() {
    let folder = folder(&["two/cars_train/a", "two/chairs_train/b"]);
    folder.write("hollow_train/none.txt", "").write("file", "");
    let said = |path: &str| open(&folder, path, Split::Train).expect_err("no data set").to_string();
    let several = said("two");
    assert!(
        several.ends_with("two: holds several data sets (cars_train, chairs_train); name one of them"),
        "{several}"
    );
    let hollow = said("hollow");
    assert!(hollow.ends_with("hollow_train: no scenes: looked for folders with intrinsics.txt inside"), "{hollow}");
    for path in ["nowhere", "file", "hollow_train"] {
        let message = said(path);
        let start = format!("{}: no data set: looked for a folder ", folder.path().join(path).display());
        assert!(message.starts_with(&start), "{message}");
        assert!(message.contains(&format!("{path}_train")) && message.contains("*_train inside"), "{message}");
    }
}
