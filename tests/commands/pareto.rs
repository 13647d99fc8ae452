//! `viewfuse pareto`.

use super::{assert_refused, assert_wrong_arguments, command, done, list_of, number_of, read_json, text_of};
use serde_json::Value;
use std::collections::HashMap;
use std::fs;
use std::path::Path;
use viewfuse::evaluate::pareto::front::best_for_their_time;
use viewfuse_tests::command::{names_in, toy};

viewfuse_tests::trials![
    sweeps_what_a_network_omits, sweeps_the_field_without_a_network, targets_without_photographs_have_no_loss,
    bad_input_is_refused, ctrl_c_leaves_what_was_there,
];

const NETWORK: &str =
    "pareto toy --targets 20 --views 3 --size 24x24 --model body:16 --samples 16,8,8 --repeat 2 --device cpu";

fn record(folder: &Path) -> Value {
    read_json(folder.join("out/pareto.json"))
}

/// Lines of the CSV file, by column.
fn table(folder: &Path) -> Vec<HashMap<String, String>> {
    let table = csv::Reader::from_path(folder.join("out/pareto.csv")).expect("a table");
    table.into_deserialize().collect::<Result<_, _>>().expect("as many cells in every row")
}

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column} is {:?}", row[column]))
}

/// The plot is well-formed as far as its own elements go: every element ends, and there is no bare `&`.
fn check_plot(folder: &Path) -> String {
    let plot = fs::read_to_string(folder.join("out/pareto.svg")).expect("a plot");
    let mut open: Vec<&str> = Vec::new();
    for tag in plot.split('<').skip(1) {
        let (tag, text) = tag.split_once('>').expect("a tag ends");
        assert!(!text.contains('&') || text.contains(';'), "{text}");
        match tag.strip_prefix('/') {
            Some(name) => assert_eq!(open.pop(), Some(name)),
            None if tag.ends_with('/') => {}
            None => open.push(tag.split_whitespace().next().expect("a name")),
        }
    }
    assert_eq!(open, [""; 0]);
    assert!(plot.starts_with("<svg ") && !plot.contains("NaN") && !plot.contains("inf"), "{plot}");
    plot
}

fn sweeps_what_a_network_omits() {
    let folder = toy();
    let printed = done(&folder, &format!("{NETWORK} -o out"));
    assert_eq!(names_in(&folder.join("out")), ["pareto.csv", "pareto.json", "pareto.svg"]);

    let rows = table(&folder);
    let settings: Vec<&str> = rows.iter().map(|row| row["setting"].as_str()).collect();
    assert!((26..=45).contains(&settings.len()), "{settings:?}");
    let expected = "exact; at most 40 dB; unused views; leave out 0.1; latent layers; empty space, 4; empty rays; \
                    empty parts; hidden, 1/256; all; all but space; all, 8+4+4; all, 16+0+0";
    for setting in expected.split("; ") {
        assert_eq!(settings.iter().filter(|other| **other == setting).count(), 1, "{setting} in {settings:?}");
        assert!(printed.contains(setting), "{setting} in\n{printed}");
    }
    for row in &rows {
        let (seconds, least, most) =
            (number(row, "seconds"), number(row, "seconds_least"), number(row, "seconds_most"));
        assert!(0.0 < least && least <= seconds && seconds <= most, "{row:?}");
        assert!(number(row, "encode_seconds") > 0.0 && number(row, "encode_seconds") < seconds, "{row:?}");
        assert_eq!(row["repeatable"], "1", "{row:?}");
        assert!(number(row, "psnr_truth_db") > 5.0, "{row:?}");
    }
    let row = |setting: &str| &rows[settings.iter().position(|other| *other == setting).expect("a setting")];
    assert_eq!((row("exact")["psnr_exact_db"].as_str(), number(row("exact"), "gain")), ("inf", 1.0));
    assert_eq!(number(row("exact"), "first_pass_samples_left_out"), 0.0);
    assert_eq!(number(row("exact"), "second_pass_samples_left_out"), 0.0);
    // Rounding shows: the difference is taken before 8 bits.
    let layers = row("latent layers");
    assert!(number(layers, "largest_difference") > 0.0 && number(layers, "psnr_exact_db") > 90.0, "{layers:?}");
    // What is omitted is counted, and fewer samples cost more.
    assert!(number(row("all"), "first_pass_samples_left_out") > 0.3 * number(row("all"), "first_pass_samples_of"));
    let few = number(row("all, 2+1+1"), "psnr_exact_db");
    assert!(few < number(row("all"), "psnr_exact_db") && few < 40.0, "{few}");

    let record = record(&folder);
    let device = &record["devices"][0];
    assert!(device["device"].as_str().is_some_and(|name| name.starts_with("cpu")), "{device}");
    assert_eq!((&record["model"], &record["size"]), (&"body:16".into(), &[24, 24][..].into()));
    assert_eq!(device["points"].as_array().map(Vec::len), Some(rows.len()));
    assert_eq!(device["exact_versus_first"], Value::Null);
    // The mark is what the front of the record's own numbers says.
    let recorded = list_of(&device["points"]);
    let pair = |point: &Value| [number_of(&point["seconds"]), number_of(&point["versus_exact"]["root_mean_square"])];
    let points: Vec<[f64; 2]> = recorded.iter().map(pair).collect();
    let best: Vec<bool> = rows.iter().map(|row| row["best"] == "1").collect();
    assert_eq!(best, best_for_their_time(&points));
    assert!(best.contains(&true) && best.contains(&false));
    let chosen = text_of(&device["fastest_of_same_look"]);
    assert!(number(row(chosen), "psnr_exact_db") >= 40.0);
    assert!(printed.contains(&format!("fastest at 40 dB or more from exact: {chosen}\n")), "{printed}");
    assert!(printed.contains("every round gave the same pictures"), "{printed}");

    let plot = check_plot(&folder);
    for (setting, _) in settings.iter().zip(best).filter(|(_, best)| *best) {
        assert_eq!(plot.lines().filter(|line| line.trim() == *setting).count(), 1, "{setting} in\n{plot}");
    }
}

fn sweeps_the_field_without_a_network() {
    let folder = toy();
    done(&folder, "pareto toy --targets 20,21 --views 4 --size 32x32 --repeat 1 --device cpu --device cpu -o out");
    let rows = table(&folder);
    let settings: Vec<&str> = rows.iter().map(|row| row["setting"].as_str()).collect();
    assert_eq!(settings.iter().filter(|setting| **setting == "exact").count(), 2, "{settings:?}");
    let row = |setting: &str| &rows[settings.iter().position(|other| *other == setting).expect("a setting")];
    assert!(number(row("sources 1/4"), "psnr_exact_db") < number(row("early termination 1/256"), "psnr_exact_db"));
    let record = record(&folder);
    assert_eq!(record["devices"][1]["exact_versus_first"]["root_mean_square"], 0.0);
    assert_eq!((&record["model"], record["targets"].as_array().map(Vec::len)), (&Value::Null, Some(2)));
    check_plot(&folder);
}

fn targets_without_photographs_have_no_loss() {
    let folder = toy();
    fs::remove_file(folder.join("toy/rgb/000020.png")).expect("a photograph");
    fs::create_dir(folder.join("toy/target_pose")).expect("a folder");
    let pose = "toy/pose/000020.txt";
    fs::rename(folder.join(pose), folder.join("toy/target_pose/000020.txt")).expect("a pose");
    let printed = done(&folder, "pareto toy --views 3 --size 16x16 --repeat 1 --device cpu -o out");
    assert!(!printed.contains("loss") && printed.contains("fastest at 40 dB"), "{printed}");
    assert!(table(&folder).iter().all(|row| row["psnr_truth_db"].is_empty() && row["truth_loss_db"].is_empty()));
    assert_eq!(record(&folder)["devices"][0]["fastest_without_loss"], Value::Null);
}

fn bad_input_is_refused() {
    let folder = toy();
    let refused = |arguments: &str, parts: &[&str]| assert_refused(&folder, arguments, parts);
    let wrong = |arguments: &str, parts: &[&str]| assert_wrong_arguments(&folder, arguments, parts);
    refused("pareto toy -o out", &["toy: no targets", "--targets"]);
    refused("pareto nowhere --targets 20 -o out", &["nowhere"]);
    refused("pareto toy --targets 20 --device vulkan:99 -o out", &[]);
    refused("pareto toy --targets 20 --size 64x48 --device cpu -o out", &["size of 64x48", "64x64", "--size"]);
    wrong("pareto toy --targets 20 --weights foo -o out", &["unknown weighting scheme 'foo'"]);
    refused("pareto toy --targets 20 -o toy/intrinsics.txt", &["intrinsics.txt is not a folder"]);
    wrong("pareto toy --targets 20 --device gpu -o out", &["gpu", "vulkan:NUMBER"]);
    wrong("pareto toy --targets 20 --repeat 0 -o out", &["--repeat", "1..=1000"]);
    wrong("pareto toy --targets 20 --samples 8,8,8 -o out", &["--samples", "PixelNeRF", "--model FILE"]);
    wrong("pareto toy --targets 20 --device cpu --only sampler -o out", &["--only sampler", "exact; leave out 0.01"]);
    wrong("pareto toy --targets 20 --device cpu --beside =3 -o out", &["--beside", "PyTorch=5.8"]);
    wrong("pareto toy --targets 20", &["required"]);
}

/// Ctrl-C while it measures: nothing appears, and what was there stays.
#[cfg(unix)]
fn ctrl_c_leaves_what_was_there() {
    use std::io::{BufRead, BufReader};
    use std::process::Stdio;
    use viewfuse_tests::patience::{end, send};
    let folder = toy();
    fs::create_dir(folder.join("out")).expect("a folder");
    const OLDER: &[u8] = b"device,setting,best,older";
    fs::write(folder.join("out/pareto.csv"), OLDER).expect("an older result");
    let arguments = NETWORK.replace("--repeat 2", "--repeat 1000");
    let mut run = command(&folder, &format!("{arguments} -o out"));
    let run = run.env("VIEWFUSE_PROGRESS", "0").stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = run.spawn().expect("the command starts");
    let mut news = BufReader::new(child.stderr.take().expect("a pipe")).lines();
    assert!(news.any(|line| line.expect("text").contains("round 1 of 1000")), "it ended before it measured");
    // The pipe is read to its end while the command ends.
    let rest = std::thread::spawn(move || news.map(|line| line.expect("text")).last());
    send("-INT", &child);
    assert_eq!(end(&mut child).expect("an end").code(), Some(130));
    let said = rest.join().expect("what it said");
    assert_eq!(said.as_deref(), Some("viewfuse: interrupted; nothing half-written is left behind"));
    assert_eq!(names_in(&folder.join("out")), ["pareto.csv"]);
    assert_eq!(fs::read(folder.join("out/pareto.csv")).expect("a file"), OLDER);
}
