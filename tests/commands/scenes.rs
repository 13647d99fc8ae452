//! `viewfuse-lab scenes make` and `scenes photograph`: what it writes, and how it stops and goes on.

use super::{assert_refused, assert_wrong_arguments, done, start};
use std::fs;
use viewfuse::scene::Scene;
use viewfuse_tests::command::{files_below, names_in};
use viewfuse_tests::places::data;
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    scenes_appear_in_their_folders_and_are_read_again,
    a_room_is_photographed_as_asked,
    the_sample_scene_is_made_again,
    wrong_arguments_are_told,
    ctrl_c_leaves_whole_scenes_and_the_same_command_goes_on,
];

const FEW: &str = "scenes make cars out --train 2 --val 1 --test 1 --views 2 --test-views 3 --size 64";

fn scenes_appear_in_their_folders_and_are_read_again() {
    let folder = Folder::new();
    assert_eq!(done(&folder, FEW), "out: 4 new scenes, 0 existing\n");
    assert_eq!(names_in(&folder.join("out")), ["cars.json", "cars_test", "cars_train", "cars_val"]);
    assert_eq!(names_in(&folder.join("out/cars_train")), ["000000", "000001"]);
    assert!(done(&folder, "inspect out/cars_train/000001").contains("2"));
    assert_eq!(done(&folder, FEW), "out: 0 new scenes, 4 existing\n");
    assert_eq!(done(&folder, &FEW.replace("--train 2", "--train 3")), "out: 1 new scenes, 4 existing\n");
    let more = "; 1 more than were asked for stay there, and are part of the data set\n";
    assert_eq!(done(&folder, FEW), format!("out: 0 new scenes, 4 existing{more}"));
    let other = FEW.replace("--views 2", "--views 4");
    assert_refused(&folder, &other, &["out/cars.json: what is there was made with other settings"]);
}

fn a_room_is_photographed_as_asked() {
    let folder = Folder::new();
    let room = "scenes photograph room out --views 3 --size 64x48 --seed 2";
    assert_eq!(done(&folder, room), "out: 3 views\n");
    let scene = Scene::open(folder.join("out")).expect("a scene");
    assert_eq!(scene.views.len(), 3);
    assert_eq!(scene.photograph(2).expect("a photograph").pixels.dimensions(), (64, 48));
    assert_refused(&folder, room, &["out: exists already"]);
}

fn the_sample_scene_is_made_again() {
    let folder = Folder::new();
    assert_eq!(done(&folder, "scenes toy out"), "out: 24 views\n");
    let sample = data("toy");
    for (stored, _) in files_below(&sample).into_iter().filter(|(path, _)| path.is_file()) {
        let name = stored.strip_prefix(&sample).expect("a file of the sample");
        let made = fs::read(folder.join("out").join(name)).expect("a file");
        assert!(made == fs::read(&stored).expect("a file of the sample"), "{} is out of date", name.display());
    }
    assert_eq!(files_below(&folder.join("out")).len(), files_below(&sample).len());
}

fn wrong_arguments_are_told() {
    let folder = Folder::new();
    let wrong = |arguments: &str, parts: &[&str]| assert_wrong_arguments(&folder, arguments, parts);
    wrong("scenes make lorries out", &["lorries", "KIND"]);
    wrong("scenes make cars out --size 100", &["the size must be 64 or 128"]);
    wrong("scenes make cars out --views 0", &["--views"]);
    wrong("scenes photograph moon out", &["moon", "PLACE"]);
    wrong("scenes make cars out --train 2000000", &["--train"]);
}

#[cfg(unix)]
fn ctrl_c_leaves_whole_scenes_and_the_same_command_goes_on() {
    use viewfuse_tests::command::interrupt;
    use viewfuse_tests::patience::wait_while_running;
    let folder = Folder::new();
    let scenes = folder.join("out/cars_train");
    let arguments = |count: usize| format!("scenes make cars out --train {count} --val 0 --test 0 --views 4 --size 64");
    let mut child = start(&folder, &arguments(50_000));
    wait_while_running(&mut child, || scenes.join("000000").exists());
    interrupt(child, "-INT");
    let names = names_in(&scenes);
    assert!(!names.is_empty() && names.len() < 50_000, "{} scenes", names.len());
    for name in &names {
        let scene = Scene::open(scenes.join(name)).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(scene.views.len(), 4, "{name} is not whole");
        assert_eq!(fs::read_dir(scenes.join(name).join("rgb")).expect("pictures").count(), 4);
    }
    let there = names.iter().filter(|name| ["000000", "000001"].contains(&name.as_str())).count();
    let goes_on = format!("out: {} new scenes, {there} existing\n", 2 - there);
    assert_eq!(done(&folder, &arguments(2)), goes_on);
}
