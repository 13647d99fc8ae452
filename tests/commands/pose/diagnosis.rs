//! What is said where poses are not found, or found in part: which photographs match which, where they fall apart, and
//! which poses are doubtful whenever their scene is opened.

use super::{bare, no_scripts};
use crate::{command, done, done_with_warnings};
use serde_json::json;
use std::process::Command;
use viewfuse_tests::command::{Outcome, assert_command_refused, names_in, toy};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    later_commands_say_it;
    no_scripts() => where_it_broke, the_picture_replaces_nothing_that_is_read,
];

/// Five photographs and a program that matches some of them, and finds no poses.
fn matched() -> Folder {
    let folder = bare(0..5);
    let unposed = json!({ "camera_from_world": null, "reason": "no first pair" });
    let pair =
        |(a, b, count): (usize, usize, usize)| json!({ "photographs": [a, b], "inliers": count, "is_general": true });
    let pairs = [(0, 1, 310), (0, 2, 75), (3, 4, 120), (2, 3, 31)].map(pair);
    let camera = json!({ "focal": 300, "principal": [160, 120], "k1": 0 });
    let solution = json!({ "solver": "played 1", "cameras": [camera], "photographs": vec![unposed; 5], "points": [],
        "pairs": pairs });
    folder.write("answer.json", json!({ "solution": solution }).to_string() + "\n");
    folder.script("openmvg", "exec cat \"$(dirname \"$0\")/answer.json\"\n");
    folder
}

fn pose(folder: &Folder, arguments: &str) -> Command {
    let mut pose = command(folder, &format!("pose bare -o posed{arguments}"));
    pose.env("VIEWFUSE_OPENMVG", folder.join("openmvg"));
    pose
}

fn where_it_broke() {
    let folder = matched();
    let outcome = Outcome::of(pose(&folder, " --matches graph.png"));
    assert_eq!((outcome.code, outcome.stdout.as_str()), (Some(1), ""), "{}", outcome.stderr);
    let lines: Vec<&str> = outcome.stderr.lines().collect();
    // Two attempts, and two with finer features as some match: one reason.
    let reasons: Vec<&&str> = lines.iter().filter(|line| line.contains("0 photographs have a pose")).collect();
    assert_eq!(reasons.len(), 2, "a warning and the error: {}", outcome.stderr);
    assert!(
        reasons[0]
            .contains("played 1 (ALP at 1200 pixels), played 1 (SIFT at 1200 pixels), played 1 (ALP at 1280 pixels)"),
        "{}",
        outcome.stderr
    );
    for line in ["matches of 000: 001 310, 002 75", "matches of 002: 000 75, 003 31", "matches of 004: 003 120"] {
        assert!(lines.contains(&format!("viewfuse: {line}").as_str()), "{line}: {}", outcome.stderr);
    }
    let last = lines.last().unwrap_or(&"");
    assert!(
        last.contains("fall apart into 2 groups (000, 001, 002; 003, 004): take some between 002 and 003 first"),
        "{last}"
    );
    assert_eq!(names_in(&folder), ["answer.json", "bare", "graph.png", "openmvg"]);
    let picture = image::open(folder.join("graph.png")).expect("a picture").to_rgb8();
    let red = picture.pixels().filter(|pixel| pixel[0] > 180 && pixel[1] < 80).count();
    assert!(red > 200, "five photographs without a pose: {red}");
}

fn the_picture_replaces_nothing_that_is_read() {
    let folder = matched();
    for (file, part) in [("bare/graph.png", "lies in bare"), ("posed/graph.png", "lies in posed")] {
        let before = names_in(&folder.join("bare"));
        let outcome = Outcome::of(pose(&folder, &format!(" --matches {file}")));
        assert_eq!(outcome.code, Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(part), "{}", outcome.stderr);
        assert_eq!(names_in(&folder.join("bare")), before);
    }
    assert_command_refused(
        pose(&folder, " --matches answer.json/graph.png"),
        &folder,
        &["answer.json is not a folder"],
    );
}

fn later_commands_say_it() {
    let toy = toy();
    let record = |accepted: serde_json::Value, files: usize| {
        let files: Vec<_> = (0..files).map(|number| (format!("{number}.jpg"), number)).collect();
        toy.write(
            "toy/pose.json",
            json!({ "files": files, "accepted": accepted, "left_out": [["c.jpg", "blurred"]] }).to_string(),
        );
    };
    let accepted = |names: [(&str, &str); 2]| {
        json!(names.map(|(photograph, verdict)| json!({ "photograph": photograph, "verdict": verdict })))
    };
    record(accepted([("000000", "sure"), ("000003", "sure")]), 2);
    assert!(!done(&toy, "inspect toy").contains("pose.json"), "nothing to say");
    record(accepted([("000000", "sure"), ("000003", "doubtful")]), 3);
    let told = [
        "toy/pose.json: 1 of 2 poses are doubtful (000003)",
        "toy/pose.json: poses were found for 2 of 3 photographs (without c.jpg)",
    ];
    let inspected = done(&toy, "inspect toy");
    let render = "render toy --targets 3 -o out --size 16x16 --weights mean --device cpu";
    let rendered = done_with_warnings(&toy, render);
    for line in told {
        assert!(inspected.contains(&format!("warning    {line}")), "{inspected}");
        assert!(rendered.stderr.contains(&format!("warning: {line}")), "{}", rendered.stderr);
    }
    // Another file of this name is not ours.
    toy.write("toy/pose.json", "{}");
    assert!(!done(&toy, "inspect toy").contains("pose.json"));
}
