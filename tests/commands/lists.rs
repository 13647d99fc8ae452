//! What other programs take from the weights: arrays, tables, and lists of the few views that targets need.

use super::{assert_near, assert_wrong_arguments, done, list_of, number_of, numbers, texts};
use serde_json::Value;
use std::fs;
use viewfuse_tests::command::{change_poses, toy};

viewfuse_tests::trials![
    weights_of_many_targets, distances_are_the_files, the_few_sources_of_a_target, the_few_sources_of_a_path,
    labels_name_schemes, nothing_counts_twice_in_a_table, tables_for_papers,
];

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

fn weights_of_many_targets() {
    let folder = toy();
    let what = "weights toy --orbit 3 --sources 0..5 --weights mean --weights half=error:alpha=0.5";
    let listed = json(&done(&folder, &format!("{what} --json")));
    let targets = list_of(&listed);
    assert_eq!(targets.len(), 3);
    let csv = done(&folder, &format!("{what} --csv"));
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((lines[0].join(","), lines.len()), ("scheme,target,source,weight".to_owned(), 1 + 2 * 3 * 6));
    let axes = json(&done(&folder, &format!("{what} --npy weights.npy")));
    assert_eq!((texts(&axes["schemes"]), numbers(&axes["shape"])), (vec!["mean", "half"], vec![2.0, 3.0, 6.0]));
    let bytes = fs::read(folder.join("weights.npy")).expect("an array");
    let array: Vec<f64> = bytes[bytes.len() - 4 * 36..]
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into())
        .collect();
    // The three forms hold the same numbers in the same order.
    for (scheme, name) in ["mean", "half"].into_iter().enumerate() {
        for (target, document) in targets.iter().enumerate() {
            let weights = numbers(&document["weights"][name]);
            assert_near(weights.iter().sum(), 1.0, 1.0e-5);
            assert_eq!(document["target"], axes["targets"][target]);
            for (source, weight) in weights.iter().enumerate() {
                let place = (scheme * 3 + target) * 6 + source;
                assert_near(array[place], *weight, 1.0e-7);
                let line = &lines[1 + place];
                assert_eq!((line[0], line[2]), (name, texts(&axes["sources"])[source]));
                assert_near(line[3].parse().expect("a number"), *weight, 1.0e-7);
            }
        }
    }
    assert_near(numbers(&targets[0]["world_from_camera"][3])[3], 1.0, 0.0);
}

/// Distances are those of the file, however small or large its units are.
fn distances_are_the_files() {
    let folder = toy();
    let table = || done(&folder, "weights toy --targets 20 --sources 0,1 --weights mean");
    let distances = |text: &str| -> Vec<f64> {
        let rows = text.lines().filter_map(|line| line.split_whitespace().collect::<Vec<_>>().try_into().ok());
        let sources = rows.filter(|row: &[&str; 4]| row[0].starts_with("0000"));
        sources.map(|row| row[1].parse().expect("a length")).collect()
    };
    let before = table();
    assert!(!before.contains("schemes measure lengths"), "{before}");
    change_poses(&folder, |_, matrix| [3, 7, 11].into_iter().for_each(|place| matrix[place] *= 1.0e-4));
    let after = table();
    assert!(after.contains("units of the scene's files; schemes measure lengths in 1.0000e-4 of these"), "{after}");
    let (before, after) = (distances(&before), distances(&after));
    assert_eq!((before.len(), after.len()), (2, 2), "{after:?}");
    before.iter().zip(&after).for_each(|(before, after)| assert_near(after / before, 1.0e-4, 2.0e-7));
}

fn the_few_sources_of_a_target() {
    let folder = toy();
    let all = json(&done(&folder, "weights toy --target 20 --weights error:alpha=1 --json"));
    let selected = json(&done(&folder, "select toy -k 3 --targets 20 --json"));
    let target = &selected["targets"][0];
    assert_eq!((&target["target"], target["index"].as_u64()), (&"000020".into(), Some(20)));
    // Those of greatest weight, in that order.
    let weights = numbers(&all["weights"]["error:alpha=1"]);
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|a, b| weights[*b].total_cmp(&weights[*a]));
    let greatest: Vec<&str> = order[..3].iter().map(|&source| texts(&all["sources"])[source]).collect();
    assert_eq!(texts(&target["sources"]), greatest);
    assert_near(number_of(&target["share"]), order[..3].iter().map(|&one| weights[one]).sum(), 1.0e-5);
    assert_near(numbers(&target["weights"]).iter().sum(), 1.0, 1.0e-5);
    let views = texts(&selected["views"]);
    let indices: Vec<usize> = numbers(&target["indices"]).into_iter().map(|index| index as usize).collect();
    assert_eq!(indices.iter().map(|&index| views[index]).collect::<Vec<_>>(), greatest);
    // As lines, and as an index file.
    let line = done(&folder, "select toy --count 3 --targets 20 --lines -o views.txt");
    assert_eq!(line, "views.txt\n");
    let expected: Vec<String> = indices.iter().map(usize::to_string).collect();
    assert_eq!(
        fs::read_to_string(folder.join("views.txt")).expect("a list"),
        format!("000020 {}\n", expected.join(" "))
    );
    // Another selection and other weights take the place of the first ones; a file that holds something else stays.
    for form in ["--lines", "--json", "--index", ""] {
        for more in ["--count 3 --targets 20", "--count 2 --targets 20,21", "--count 2 --targets 20 --weights mean"] {
            done(&folder, &format!("select toy {more} {form} -o again{form}"));
        }
    }
    for more in ["--targets 20", "--targets 20,21 --weights mean --sources 0..5"] {
        done(&folder, &format!("weights toy {more} --npy again.npy"));
    }
    folder
        .write("notes.txt", "notes of 3 things\n")
        .write("array.npy", [b"\x93NUMPY\x01\0v\0".to_vec(), vec![b' '; 200]].concat());
    folder.write("toy.json", "{\n  \"scene\": \"toy\"\n}\n");
    for command in [
        "select toy --count 2 --targets 20 --lines -o notes.txt",
        "select toy --count 2 --targets 20 --json -o notes.txt",
        "select toy --count 3 --targets 20 -o notes.txt",
        "select toy --count 3 --targets 20 -o again--json",
        "select toy --count 3 --targets 20 --json -o toy.json",
        "weights toy --targets 20 --npy array.npy",
    ] {
        assert_wrong_arguments(&folder, command, &["holds something else, and would be replaced"]);
    }
    assert_eq!(fs::read_to_string(folder.join("notes.txt")).expect("notes"), "notes of 3 things\n");
    let index = json(&done(&folder, "select toy -k 3 --targets 20,21 --index"));
    assert_eq!((numbers(&index["toy"]["target"]), numbers(&index["toy"]["context"]).len()), (vec![20.0, 21.0], 3));
    assert_wrong_arguments(&folder, "select toy -k 2 --orbit 3 --index", &["--index needs targets"]);
    let table = done(&folder, "select toy -k 2 --targets 20");
    assert!(table.contains(greatest[0]) && table.contains("for all together: "), "{table}");
    // A share is one of the sources' weight, however many photographs the scene has besides.
    assert!(table.starts_with("toy, error:alpha=1: 2 of 23 sources\n"), "{table}");
    let of_few = done(&folder, "select toy -k 9 --targets 20 --views 4");
    assert!(of_few.starts_with("toy, error:alpha=1: 4 of 4 sources\n"), "{of_few}");
}

fn the_few_sources_of_a_path() {
    let scene = toy();
    let selected = json(&done(&scene, "select toy -k 4 --orbit 12 --json"));
    assert_eq!(selected["targets"].as_array().map(Vec::len), Some(12));
    assert_eq!(selected["targets"][3]["index"], Value::Null);
    let together = &selected["together"];
    assert_eq!(numbers(&together["indices"]).len(), 4);
    let share = numbers(&together["share"]);
    assert!(share[0] >= share[1] && share[1] > 0.0 && share[0] < 1.0, "{share:?}");
    // Each target alone has more of the weight than of what serves all.
    let numbers: Vec<f64> = list_of(&selected["targets"]).iter().map(|one| number_of(&one["share"])).collect();
    assert!(numbers.iter().sum::<f64>() / 12.0 >= share[0] - 1.0e-6);
}

fn labels_name_schemes() {
    let folder = toy();
    done(&folder, "render toy --targets 20 --size 16x16 --weights near=error:alpha=0.5 --device cpu -o out");
    let record = json(&fs::read_to_string(folder.join("out/run.json")).expect("a record"));
    assert_eq!(record["weighting"], "near");
    assert_wrong_arguments(&folder, "weights toy --target 20 --weights a/b=mean", &["'a/b' is not a label"]);
    // One that means another scheme would be read as that.
    let taken = "weights toy --target 20 --weights mean=error:alpha=1";
    assert_wrong_arguments(&folder, taken, &["'mean' is a weighting itself"]);
    // In JSON one of two schemes under one name would be missing.
    for form in ["", "--json", "--csv", "--npy weights.npy"] {
        let two = format!("weights toy --target 20 --weights a=mean --weights a=l1 {form}");
        assert_wrong_arguments(&folder, &two, &["two schemes would be called 'a'"]);
    }
    let once = done(&folder, "weights toy --target 20 --weights mean --csv");
    assert_eq!(done(&folder, "weights toy --target 20 --weights mean --weights mean --csv"), once);
}

fn nothing_counts_twice_in_a_table() {
    let scene = toy();
    let run = "evaluate toy --targets 20 --size 16x16 --device cpu --weights mean";
    let once = done(&scene, run);
    // Times differ.
    let of_mean = |table: &str| -> Vec<String> {
        let row = table.lines().find(|line| line.trim_start().starts_with("mean ")).expect("a row");
        row.split_whitespace().take(5).map(str::to_owned).collect()
    };
    let twice = done(&scene, &format!("{run} --weights mean"));
    assert!(twice.contains("toy: 1 target\n") && of_mean(&twice) == of_mean(&once), "{twice}");
    for (more, part) in [
        ("--weights a=l1 --weights a=error:alpha=1", "two rows of the table would be called 'a'"),
        ("./toy/../toy", "toy/../toy: the scene is given twice"),
        ("-o scores.png", "a table as CSV is written; give a name as scores.csv"),
        ("-o toy/transforms_train.json", "the scene toy is read from this file"),
    ] {
        assert_wrong_arguments(&scene, &format!("{run} {more}"), &[part]);
    }
    // The same photographs by another file are the same scene.
    fs::create_dir(scene.join("a")).expect("a folder");
    done(&scene, "export toy --layout transforms -o a/b");
    let again =
        run.replace("evaluate toy", "evaluate a/b a/b/transforms.json").replace("--targets 20", "--targets #20");
    assert_wrong_arguments(&scene, &again, &["the scene is given twice: its photographs are those of a/b"]);
    assert_wrong_arguments(&scene, "inspect toy -o cameras.jpg", &["PNG", "cameras.png"]);
}

fn tables_for_papers() {
    let scene = toy();
    let arguments = "evaluate toy --targets 20,21 --sources 0..5 --size 16x16 --weights mean --weights \
        a_b=error:alpha=1 --device cpu";
    let latex = done(&scene, &format!("{arguments} --latex"));
    assert!(latex.starts_with("\\begin{table}\n") && latex.trim_end().ends_with("\\end{table}"), "{latex}");
    let rows: Vec<&str> = latex.lines().filter(|line| line.ends_with("\\\\")).collect();
    // The heading, three baselines, two schemes; as many cells in each.
    assert_eq!(rows.len(), 6, "{latex}");
    let cells = |row: &str| row.matches(" & ").count();
    rows.iter().for_each(|row| assert_eq!(cells(row), cells(rows[0]), "{row}"));
    assert!(rows[5].starts_with("    a\\_b & $") && latex.contains("\\pm") && !latex.contains('±'), "{latex}");
    // The same numbers as in the table for people.
    let table = done(&scene, arguments);
    let mean = rows[4].split(" & ").nth(1).expect("a cell");
    let number = mean.trim_start_matches("$\\mathbf{").trim_start_matches('$').split(' ').next().expect("a number");
    assert!(number.parse::<f64>().is_ok() && table.contains(number), "{mean} is not in\n{table}");
}
