//! `--pose` of commands that open a scene: bare photographs become a scene on the way.

use super::{REQUIRE, bare, no_program};
use crate::{assert_refused, done_with_warnings};
use serde_json::Value;
use std::fs;
use viewfuse_tests::command::files_below;
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    what_is_posed_already_stays,
    another_folder_is_not_taken;
    no_program(), REQUIRE => from_bare_photographs_to_a_picture,
];

fn from_bare_photographs_to_a_picture() {
    let folder = bare(0..4);
    let out = "--targets 3 -o out --size 32x24 --weights distance:power=2 --device cpu";
    let outcome = done_with_warnings(&folder, &format!("render bare --pose {out}"));
    let told = "viewfuse: bare-posed: written, 4 of 4 photographs with poses";
    assert!(outcome.stderr.lines().any(|line| line == told), "{}", outcome.stderr);
    assert!(folder.join("out/003.png").exists());
    // The next command takes the poses that are there; what it prints is its own.
    let before = files_below(&folder.join("bare-posed"));
    let outcome = done_with_warnings(&folder, "inspect ./bare/ --pose --json");
    let inspected: Value = serde_json::from_str(&outcome.stdout).expect("JSON alone");
    assert_eq!(inspected["photograph_count"], 4, "{inspected}");
    assert!(outcome.stderr.contains("bare-posed: the poses found before"), "{}", outcome.stderr);
    assert_eq!(files_below(&folder.join("bare-posed")), before);
    // Of other photographs they are not taken.
    fs::remove_file(folder.join("bare/002.jpg")).expect("a photograph");
    let parts = ["bare-posed: exists already and is not of the photographs in bare", "remove it"];
    assert_refused(&folder, "view bare --pose --no-browser", &parts);
}

fn what_is_posed_already_stays() {
    let toy = viewfuse_tests::command::toy();
    let before = files_below(&toy);
    done_with_warnings(&toy, "inspect toy --pose");
    assert_eq!(files_below(&toy), before);
    // Errors of other kinds are the command's own.
    assert_refused(&toy, "inspect nowhere --pose", &["nowhere"]);
}

fn another_folder_is_not_taken() {
    let folder: Folder = bare(0..3);
    folder.write("bare-posed/notes.txt", "mine");
    assert_refused(&folder, "inspect bare --pose", &["bare-posed: exists already"]);
}
