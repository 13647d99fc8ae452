//! `viewfuse weights` and `viewfuse evaluate`: tables for people, JSON and CSV for programs.

use super::{assert_near, command, done, done_with_warnings, number_of, numbers, read_json, texts};
use serde_json::Value;
use std::fs;
use viewfuse::weighting::scheme_names;
use viewfuse_tests::command::{names_in, toy, toy_twice};

viewfuse_tests::trials![
    weights_as_a_table,
    weights_as_json,
    evaluates_schemes_against_the_nearest_copy,
    evaluates_the_views_that_are_no_sources,
    auto_is_a_row_and_leaves_the_others_alone,
    a_reader_that_goes_away_is_no_failure,
];

fn weights_as_a_table() {
    let scene = toy();
    let table = done(&scene, "weights toy --target 20 --sources 0..9");
    assert!(table.starts_with("toy: target 000020, 10 sources\n"), "{table}");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split_whitespace().collect())
        .filter(|row: &Vec<&str>| row.first().is_some_and(|word| word.len() == 6 && word.parse::<u32>().is_ok()))
        .collect();
    assert_eq!(rows.len(), 10, "{table}");
    for (view, row) in rows.iter().enumerate() {
        assert_eq!((row[0], row.len()), (format!("{view:06}").as_str(), 3 + scheme_names().len()), "{table}");
    }
    for column in 3..3 + scheme_names().len() {
        // Four decimals each.
        assert_near(rows.iter().map(|row| row[column].parse::<f64>().expect("a weight")).sum(), 1.0, 10.0 * 0.5e-4);
    }
    let names = table.replace('\n', " ");
    for name in ["mean", "l1", "gaussian", "beta=1", "power=3", "alpha=0.5"] {
        assert!(names.contains(name), "{name} is no column of\n{table}");
    }
    assert_eq!(names_in(&scene), ["toy"]);
}

fn weights_as_json() {
    let scene = toy();
    let weights = |arguments: &str| -> Value {
        serde_json::from_str(&done(&scene, &format!("weights toy --json {arguments}"))).expect("JSON")
    };
    let all = weights("--target 20");
    assert_eq!((&all["target"], texts(&all["sources"]).len()), (&"000020".into(), 23));
    let columns = all["weights"].as_object().expect("schemes");
    assert_eq!(columns.len(), scheme_names().len());
    for name in scheme_names() {
        let values = numbers(&columns[name]);
        assert!(values.len() == 23 && values.iter().all(|weight| *weight >= 0.0), "{name}");
        assert_near(values.iter().sum(), 1.0, 1.0e-5);
    }
    let two = weights("--target 5 --weights mean --weights error:alpha=0.25,angle=full --sources 1..4");
    let columns = two["weights"].as_object().expect("schemes");
    assert_eq!(columns.keys().collect::<Vec<_>>(), ["error:alpha=0.25,angle=full", "mean"]);
    assert_eq!(numbers(&columns["mean"]), [0.25; 4]);
    assert!(numbers(&columns["error:alpha=0.25,angle=full"]) != [0.25; 4]);
}

fn evaluates_schemes_against_the_nearest_copy() {
    let scene = toy_twice();
    let run = "evaluate toy again --targets 20,21 --size 64x64 --weights mean --weights error:alpha=1 -o scores.csv";
    let table = done(&scene, run);
    for title in ["toy: 2 targets", "again: 2 targets", "all 2 scenes: 4 targets"] {
        assert!(table.contains(title), "no {title:?} in\n{table}");
    }
    for row in ["nearest copy", "mean", "error:alpha=1"] {
        let begins = |line: &str| line.trim().strip_prefix(row).is_some_and(|rest| rest.starts_with(' '));
        assert_eq!(table.lines().filter(|line| begins(line)).count(), 3, "rows of {row} in\n{table}");
    }

    let csv = fs::read_to_string(scene.join("scores.csv")).expect("the scores");
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    assert_eq!(
        lines.next(),
        Some(vec!["scene", "scheme", "target", "sources", "psnr_db", "ssim", "psnr-corrected", "seconds"])
    );
    let rows: Vec<Vec<&str>> = lines.collect();
    assert_eq!(rows.len(), 2 * 5 * 2, "{csv}");
    let score = |scene: &str, scheme: &str, target: &str| -> [f64; 2] {
        let found: Vec<_> = rows.iter().filter(|row| row[..3] == [scene, scheme, target]).collect();
        assert_eq!(found.len(), 1, "{scene}, {scheme}, {target} in\n{csv}");
        assert_eq!(found[0][3], "23");
        assert!(found[0][7].parse::<f64>().expect("a time") >= 0.0);
        [found[0][4], found[0][5]].map(|number| number.parse().expect("a number"))
    };
    for scene in ["toy", "again"] {
        for target in ["000020", "000021"] {
            let [copy, weighted] = ["nearest copy", "error:alpha=1"].map(|scheme| score(scene, scheme, target));
            assert!(weighted[0] > copy[0] + 3.0 && weighted[1] > copy[1], "{target}: {weighted:?} after {copy:?}");
            let mean = score(scene, "mean", target);
            assert!(mean[0] > copy[0], "{target}: {mean:?} after {copy:?}");
        }
    }
}

fn evaluates_the_views_that_are_no_sources() {
    let scene = toy();
    let table = done(&scene, "evaluate toy --sources all/2 --size 32x32 --weights error:alpha=1");
    assert!(table.contains("toy: 12 targets"), "{table}");
    assert_eq!(names_in(&scene), ["toy"]);
}

fn auto_is_a_row_and_leaves_the_others_alone() {
    let scene = toy();
    let room = viewfuse_tests::places::data("room");
    let job = format!("{} --targets 5 --sources 1,3,4,6,7,9 --size 64x48", room.display());
    let scores = |weights: &str| -> Vec<(String, f64)> {
        // The sources are far apart, and a warning says so.
        done_with_warnings(&scene, &format!("evaluate {job} {weights} -o scores.csv"));
        let csv = fs::read_to_string(scene.join("scores.csv")).expect("the scores");
        let line = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            (cells[1].to_owned(), cells[4].parse().expect("a number"))
        };
        csv.lines().skip(1).map(line).collect()
    };
    let score = |scores: &[(String, f64)], scheme: &str| {
        scores.iter().find(|(name, _)| name == scheme).unwrap_or_else(|| panic!("no row {scheme}")).1
    };
    let (both, alone) = (scores("--weights auto --weights mean"), scores("--weights mean"));
    assert_near(score(&both, "mean"), score(&alone, "mean"), 1.0e-6);
    // The same choice as `render` makes without being told a scheme.
    done_with_warnings(&scene, &format!("render {job} -o out"));
    let record = read_json(scene.join("out/run.json"));
    assert_near(score(&both, "auto"), number_of(&record["frames"][0]["psnr"]), 1.0e-4);
}

/// `viewfuse ... | head` closes the pipe early: no panic, and the files are written all the same.
#[cfg(unix)]
fn a_reader_that_goes_away_is_no_failure() {
    use std::io::Read;
    use std::process::Stdio;
    let scene = toy();
    for arguments in ["weights toy --target 20", "render toy --targets 20 --size 32x32 -o out"] {
        let mut run = command(&scene, arguments);
        let mut child = run.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the command starts");
        drop(child.stdout.take());
        let mut said = String::new();
        child.stderr.take().expect("a pipe").read_to_string(&mut said).expect("text");
        assert_eq!((child.wait().expect("an end").code(), said.as_str()), (Some(0), ""), "viewfuse {arguments}");
    }
    assert!(scene.join("out/run.json").is_file());
}
