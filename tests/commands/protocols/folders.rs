//! The folder of an evaluation: killed, split, gone on with, refused.

use crate::{assert_refused, assert_wrong_arguments, done, killed_when, list_of, number_of, read_json, run, text_of};
use serde_json::Value;
use std::fs;
use std::path::Path;
use viewfuse_core::attention::POSE_FEATURES;
use viewfuse_tests::command::{Outcome, change_poses, f32_bytes, names_in, safetensors, toy, toy_twice};

viewfuse_tests::trials![
    shards_together_are_the_whole,
    a_killed_run_ends_in_the_same_numbers,
    other_settings_are_refused,
    parameters_of_the_same_name_are_told_apart,
    data_sets_and_published_metrics,
    one_writer_a_shard,
    pictures_show_sources_predictions_and_truth,
    arguments_that_do_not_fit,
];

const RUN: &str = "evaluate toy --protocol random --trials 6 --targets-per-trial 2 --size 24x24 --device cpu \
     --weights mean --weights error:alpha=1 --weights l1";

/// Lines of all journals without what time and place say, by number of job.
pub(super) fn finished(folder: &Path) -> Vec<Value> {
    let mut lines = Vec::new();
    for name in names_in(folder).iter().filter(|name| name.ends_with(".jsonl")) {
        for line in fs::read_to_string(folder.join(name)).expect("a journal").lines() {
            let mut job: Value = serde_json::from_str(line).unwrap_or_else(|error| panic!("{name}: {error}: {line}"));
            for score in job["scores"].as_array_mut().expect("scores") {
                assert!(score["seconds"].take().as_f64().expect("a time") >= 0.0);
            }
            lines.push(job);
        }
    }
    lines.sort_by_key(|job| job["job"].as_u64());
    lines
}

/// A CSV file without its last column, the time.
fn scores(folder: &Path) -> Vec<String> {
    let text = fs::read_to_string(folder.join("scores.csv")).expect("the scores");
    text.lines().map(|line| line.rsplit_once(',').expect("a last column").0.to_owned()).collect()
}

/// Rows of printed tables without their last column, the time; and the title.
fn printed(text: &str) -> Vec<String> {
    let is_row = |line: &&str| {
        line.contains("random:")
            || [" mean", " l1", " error", " nearest", " warped"].iter().any(|name| line.starts_with(name))
    };
    let without_time = |line: &str| line.trim_end().rsplit_once(' ').map_or("", |(row, _)| row).trim_end().to_owned();
    text.lines().filter(is_row).map(without_time).collect()
}

fn shards_together_are_the_whole() {
    let folder = toy();
    let whole = done(&folder, &format!("{RUN} -o whole"));
    assert!(whole.contains("6 jobs done; 6 of 6 are in whole"), "{whole}");
    assert_eq!(printed(&whole).len(), 1 + 6, "{whole}");
    // Out of order, and the second of three last.
    for (shard, part) in [("2/3", "missing: 0, 1, 3, 4"), ("0/3", "missing: 1, 4;"), ("1/3", "6 of 6 are in parts")] {
        let text = done(&folder, &format!("{RUN} -o parts --shard {shard}"));
        assert!(text.contains(&format!("shard {shard}: 2 jobs done")) && text.contains(part), "{text}");
        if shard == "1/3" {
            assert_eq!(printed(&text), printed(&whole));
        } else {
            assert!(printed(&text).is_empty() && !folder.join("parts/scores.csv").exists(), "{text}");
        }
    }
    assert_eq!(finished(&folder.join("parts")), finished(&folder.join("whole")));
    assert_eq!(scores(&folder.join("parts")), scores(&folder.join("whole")));
    // Six jobs with two targets, three baselines and three schemes each.
    assert_eq!(scores(&folder.join("whole")).len(), 1 + 6 * 2 * 6);
    assert_eq!(scores(&folder.join("whole"))[0], "job,scene,trial,scheme,target,sources,psnr_db,ssim,psnr-corrected");
    let journals = names_in(&folder.join("parts"));
    assert_eq!(journals.iter().filter(|name| name.contains("-of-3.jsonl")).count(), 3, "{journals:?}");
    // Once more without shards: nothing is left to do, and the tables are printed.
    let again = done(&folder, &format!("{RUN} -o parts"));
    assert!(again.contains("0 jobs done; 6 of 6"), "{again}");
    assert_eq!(printed(&again), printed(&whole));
    // Pictures are of the first jobs, whoever did them.
    let pictures = |run: &str| names_in(&folder.join(run).join("pictures"));
    assert_eq!(pictures("parts"), pictures("whole"));
    for name in pictures("whole") {
        let [a, b] =
            ["parts", "whole"].map(|run| fs::read(folder.join(run).join("pictures").join(&name)).expect("a file"));
        assert_eq!(a, b, "{name}");
    }
}

#[cfg(unix)]
fn a_killed_run_ends_in_the_same_numbers() {
    let folder = toy();
    let run = RUN.replace("--trials 6", "--trials 40").replace("24x24", "40x40");
    done(&folder, &format!("{run} -o undisturbed"));
    let journal = folder.join("killed/scores-0-of-1.jsonl");
    let line_count = || fs::read(&journal).map_or(0, |text| text.iter().filter(|byte| **byte == b'\n').count());
    let mut kept = Vec::new();
    for kill in 1..=3 {
        let least = line_count() + 2;
        killed_when(&folder, &format!("{run} -o killed"), || line_count() >= least);
        let text = fs::read(&journal).expect("a journal");
        assert!(text.starts_with(&kept), "kill {kill} changed what was done");
        kept = text[..=text.iter().rposition(|byte| *byte == b'\n').expect("a line")].to_vec();
    }
    let before = line_count();
    assert!(before < 40, "all was done before the last kill");
    // A kill in the middle of a line.
    fs::write(&journal, [&kept[..], b"{\"job\":39,\"scene\":0,\"scene_na"].concat()).expect("half a line");
    let text = done(&folder, &format!("{run} -o killed"));
    assert!(text.contains(&format!("{} jobs done; 40 of 40", 40 - before)), "{before} before: {text}");
    assert!(fs::read(&journal).expect("a journal").starts_with(&kept));
    assert_eq!(finished(&folder.join("killed")), finished(&folder.join("undisturbed")));
    assert_eq!(scores(&folder.join("killed")), scores(&folder.join("undisturbed")));
    // No temporary file of the killed ones stays beside the pictures that the report shows.
    let shown = |name: &&String| !name.starts_with(".viewfuse-");
    let [a, b] = ["killed", "undisturbed"].map(|run| names_in(&folder.join(run).join("pictures")));
    assert_eq!(a.iter().filter(shown).collect::<Vec<_>>(), b.iter().collect::<Vec<_>>());
}

fn other_settings_are_refused() {
    let folder = toy_twice();
    let first = RUN.replace("--trials 6", "--trials 1");
    done(&folder, &format!("{first} -o out"));
    let refused = |arguments: &str, parts: &[&str]| assert_refused(&folder, &format!("{arguments} -o out"), parts);
    let beginning = "out/run.json: is of an evaluation with other settings (";
    refused(&first.replace("--trials 1", "--trials 2"), &[beginning, "trials: 2 here, 1 there)", "use another folder"]);
    refused(&first.replace("24x24", "16x16"), &["size: 16x16 here, 24x24 there"]);
    refused(&first.replace("random", "random:sources=4"), &["protocol: random:sources=4 here, random:sources=3 there"]);
    refused(&format!("{first} --seed 3"), &["seed: 3 here, 0 there"]);
    refused(&format!("{first} --weights frobenius"), &["schemes: "]);
    refused(&first.replace(" toy ", " toy again "), &["with other settings (scenes: toy, again here, toy there)"]);
    refused(&format!("{first} --exact"), &["exact: true here, false there"]);
    // Threads, pictures and shards change no number.
    done(&folder, &format!("{first} --threads 1 --pictures 0 --shard 0/2 -o out"));
    // Another camera: another scene of the same name.
    let pose = folder.join("toy/pose/000003.txt");
    let text = fs::read_to_string(&pose).expect("a pose");
    change_poses(&folder, |view, matrix| matrix[3] += if view == 3 { 0.1 } else { 0.0 });
    refused(&first, &["cameras, photographs, masks or sizes of toy"]);
    fs::write(&pose, text).expect("a file");
    let intrinsics = folder.join("toy/intrinsics.txt");
    let text = fs::read_to_string(&intrinsics).expect("intrinsics");
    let moved: Vec<&str> = text.split_whitespace().collect();
    fs::write(
        &intrinsics,
        text.replacen(
            &format!("{} {}", moved[0], moved[1]),
            &format!("{} {}", moved[0], 0.9 * moved[1].parse::<f64>().expect("a number")),
            1,
        ),
    )
    .expect("a file");
    refused(&first, &["cameras, photographs, masks or sizes of toy"]);
    fs::write(&intrinsics, text).expect("a file");
    // Another photograph under the same name.
    let photograph = folder.join("toy/rgb/000003.png");
    let before = fs::read(&photograph).expect("a photograph");
    fs::copy(folder.join("toy/rgb/000004.png"), &photograph).expect("another one");
    refused(&first, &["cameras, photographs, masks or sizes of toy"]);
    // Of the same length, as files that are not compressed have.
    let mut of_its_length = before.clone();
    let middle = of_its_length.len() / 2;
    of_its_length[middle] ^= 1;
    fs::write(&photograph, of_its_length).expect("a file");
    refused(&first, &["cameras, photographs, masks or sizes of toy"]);
    fs::write(&photograph, before).expect("a file");

    // Damage is told with file and line.
    let journal = folder.join("out/scores-0-of-1.jsonl");
    let whole = fs::read_to_string(&journal).expect("a journal");
    fs::write(&journal, format!("{whole}nonsense\n")).expect("a file");
    refused(&first, &["out/scores-0-of-1.jsonl:2: is not of an evaluation"]);
    fs::write(&journal, whole.replace("\"scene\":0,", "\"scene\":1,")).expect("a file");
    refused(&first, &["out: job 0 has other views"]);
    // Lines of another evaluation, put beside these.
    fs::write(&journal, whole.replace("\"settings\":\"", "\"settings\":\"0")).expect("a file");
    refused(&first, &["out: job 0 was done with other settings than run.json states"]);
    assert_refused(&folder, "report out -o page.html", &["out: job 0 was done with other settings"]);
    fs::write(folder.join("out/run.json"), "{}").expect("a file");
    refused(&first, &["out/run.json: is not of an evaluation"]);
}

fn parameters_of_the_same_name_are_told_apart() {
    const N: usize = POSE_FEATURES;
    let folder = toy();
    let write = |scale: f32| {
        let matrix = |shift: usize| f32_bytes((0..N * N).map(|i| scale * ((i + shift) % 7) as f32 * 0.1));
        let tensors = [("query_layer.weight", 0), ("key_layer.weight", 3)];
        let tensors = tensors.map(|(name, shift)| (name, "F32", [N, N], matrix(shift)));
        let tensors: Vec<_> =
            tensors.iter().map(|(name, kind, shape, bytes)| (*name, *kind, &shape[..], bytes.clone())).collect();
        fs::write(folder.join("own.safetensors"), safetensors(&tensors)).expect("a file");
    };
    write(1.0);
    let run = format!("{} --weights attention:own.safetensors -o out", RUN.replace("--trials 6", "--trials 1"));
    done(&folder, &run);
    done(&folder, &run);
    write(1.5);
    assert_refused(&folder, &run, &["out/run.json", "other settings (own.safetensors: "]);
}

fn data_sets_and_published_metrics() {
    let folder = toy();
    for name in ["cars_test", "cars_train"] {
        fs::create_dir(folder.join(name)).expect("a folder");
    }
    fs::rename(folder.join("toy"), folder.join("cars_test/lorry")).expect("another place");
    let run = RUN.replace("--trials 6", "--trials 1").replace(" toy ", " cars --split test ");
    done(&folder, &format!("{run} -o plain"));
    done(&folder, &format!("{run} --metrics-as viewattention -o published"));
    let [plain, published] = ["plain", "published"].map(|run| finished(&folder.join(run)).remove(0));
    assert_eq!((&plain["scene_name"], &published["sources"]), (&Value::from("lorry"), &plain["sources"]));
    // Pictures are stretched to their own range first: other numbers of the same pictures.
    assert_ne!(plain["scores"][0]["values"], published["scores"][0]["values"]);
    assert_refused(
        &folder,
        &format!("{run} --metrics-as viewattention -o plain"),
        &["metrics-as: viewattention here, plain there"],
    );
    assert_refused(&folder, &run.replace("--split test", "--split val -o x"), &["cars", "val"]);
    assert_wrong_arguments(&folder, &format!("{run} --fid net.pth -o fid"), &["--fid", "viewfuse compare"]);
    // A file that is no network leaves no folder behind, whose settings would then be wrong.
    fs::write(folder.join("net.safetensors"), safetensors(&[("x", "F32", &[1], f32_bytes([1.0]))])).expect("a file");
    assert_refused(&folder, &format!("{run} --lpips alex=net.safetensors -o lpips"), &["net.safetensors"]);
}

fn one_writer_a_shard() {
    let folder = toy();
    let first = RUN.replace("--trials 6", "--trials 1");
    done(&folder, &format!("{first} -o out"));
    let journal = fs::File::options().append(true).open(folder.join("out/scores-0-of-1.jsonl")).expect("a journal");
    journal.lock().expect("a lock");
    assert_refused(&folder, &format!("{first} -o out"), &["scores-0-of-1.jsonl: another process", "--shard"]);
    done(&folder, &format!("{first} -o out --shard 1/2"));
    // A process that another test starts at this moment has the file open too until it runs its program: closing is not
    // enough.
    journal.unlock().expect("unlocked");
    done(&folder, &format!("{first} -o out"));
}

fn pictures_show_sources_predictions_and_truth() {
    let folder = toy();
    done(&folder, &format!("{RUN} --pictures 2 -o out"));
    let pictures = folder.join("out/pictures");
    let described: Vec<String> = names_in(&pictures).into_iter().filter(|name| name.ends_with(".json")).collect();
    assert_eq!(described, ["job-00000.json", "job-00001.json"]);
    let jobs = finished(&folder.join("out"));
    for (name, job) in described.iter().zip(&jobs) {
        let shown = read_json(pictures.join(name));
        let open = |file: &Value| {
            let file = text_of(file);
            image::open(pictures.join(file)).unwrap_or_else(|error| panic!("{file}: {error}")).to_rgb8()
        };
        assert_eq!(open(&shown["truth"]).dimensions(), (24, 24));
        let names: Vec<&Value> = list_of(&shown["sources"]).iter().map(|source| &source["name"]).collect();
        assert_eq!(names, list_of(&job["sources"]).iter().collect::<Vec<_>>());
        let schemes = list_of(&shown["schemes"]);
        assert_eq!(
            schemes.iter().map(|scheme| scheme["scheme"].as_str()).collect::<Vec<_>>(),
            [Some("mean"), Some("error:alpha=1"), Some("l1")]
        );
        for scheme in schemes {
            let weights: Vec<f64> = list_of(&scheme["weights"]).iter().filter_map(Value::as_f64).collect();
            assert!(weights.len() == 3 && (weights.iter().sum::<f64>() - 1.0).abs() < 1.0e-5, "{weights:?}");
            // The picture is the one that was scored.
            let score = list_of(&job["scores"])
                .iter()
                .find(|score| (&score["scheme"], &score["target"]) == (&scheme["scheme"], &shown["target"]));
            assert_eq!(score.expect("a score")["values"][0], scheme["values"][0]);
            let (picture, truth) = (open(&scheme["file"]), open(&shown["truth"]));
            let psnr = viewfuse_core::metrics::psnr(&picture, &truth);
            assert!((psnr - number_of(&scheme["values"][0][1])).abs() < 1.0e-9, "{psnr}");
        }
    }
}

fn arguments_that_do_not_fit() {
    let folder = toy();
    let wrong = |arguments: &str, parts: &[&str]| assert_wrong_arguments(&folder, arguments, parts);
    wrong("evaluate toy --protocol random --shard 0/2", &["required"]);
    wrong("evaluate toy --protocol farthest -o out", &["farthest", "random[:sources=N]"]);
    wrong("evaluate toy --protocol random --targets 3 -o out", &["--protocol", "--targets"]);
    wrong("evaluate toy --shard 0/2 -o out", &["required"]);
    for option in ["--trials 7", "--targets-per-trial 2", "--pictures 3"] {
        wrong(&format!("evaluate toy {option}"), &["required"]);
    }
    for option in ["--trials 7", "--targets-per-trial 2"] {
        let name = option.split(' ').next().expect("a word");
        let parts = [name, "the protocol nearest:2 draws nothing"];
        wrong(&format!("evaluate toy --protocol nearest:2 {option}"), &parts);
    }
    wrong("evaluate toy --protocol random --shard 2/2 -o out", &["2/2", "counted from 0"]);
    let refused = |arguments: &str, parts: &[&str]| assert_refused(&folder, arguments, parts);
    refused("evaluate toy --protocol fixed -o out", &["toy: has no view '56'"]);
    refused("evaluate toy --protocol count:sources=30 -o out", &["fits none of the scenes", "34 are needed"]);
    refused("evaluate toy --protocol random -o toy/intrinsics.txt", &["intrinsics.txt"]);
    refused("evaluate toy nowhere --protocol random -o out", &["nowhere"]);
    let Outcome { code, stdout, .. } =
        run(&folder, "evaluate toy --protocol close:degrees=25 --size 16x16 --device cpu --weights mean -o out");
    assert!(code == Some(0) && stdout.contains("close:sources=5,degrees=25, sources: 5; 1 scene"), "{stdout}");
}
