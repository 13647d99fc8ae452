//! `viewfuse-lab train`: what a run leaves, and that it ends in the same numbers however often it is killed.
#![cfg(unix)]

use super::{assert_refused, assert_wrong_arguments, command, done, killed_when, read_json, start};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use viewfuse::job::files::FolderLock;
use viewfuse_tests::command::{files_below, interrupt, names_in};
use viewfuse_tests::patience;
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    a_killed_run_goes_on_and_ends_in_the_same_numbers,
    ctrl_c_writes_the_state_first,
    genvs_goes_on_too,
    data_are_told_by_what_is_in_them,
    wrong_input_is_told,
    scores_are_finite_and_of_other_scenes,
    numbers_without_sense_are_refused,
    a_damaged_state_is_refused_and_an_empty_one_is_none,
    a_loss_is_shown_once_there_is_one,
    curves_are_there_while_it_runs,
    more_steps_go_on_from_fewer,
];

/// Small enough for a second a run.
const PIXELNERF: &str = "train pixelnerf learn/cars --width 16 --objects 2 --rays 12 --coarse 8 --fine 4 --steps 30 \
    --sources 1,2,3,5 --side 32 --sides 16,32 --least-crop 0.7 --weights mean --weights error:alpha=1 --validate-every \
    10 --write-every 0";
const GENVS: &str = "train genvs learn/cars --width 4 --objects 1 --samples 8 --side 32 --steps 3 --sources 1,3 \
    --least-crop 0.7 --weights error:alpha=1 --weights mean --validate-every 3 --write-every 0";

fn scenes() -> Folder {
    let folder = Folder::new();
    done(&folder, "scenes make cars learn --train 2 --val 1 --test 0 --views 10 --test-views 10 --size 64");
    folder
}

fn bytes(folder: &Path, name: &str) -> Vec<u8> {
    fs::read(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Starts a run and kills it without a warning as soon as it has written a model.
fn kill(folder: &Path, arguments: &str, model: &str) {
    killed_when(folder, arguments, || folder.join(model).exists());
}

fn a_killed_run_goes_on_and_ends_in_the_same_numbers() {
    let folder = scenes();
    let said = done(&folder, &format!("{PIXELNERF} -o whole"));
    assert!(said.contains("30 steps in") && said.ends_with("whole/model.safetensors\n"), "{said}");
    assert_eq!(
        names_in(&folder.join("whole")),
        ["curve.csv", "curve.svg", "model.safetensors", "record.json", "state.safetensors",]
    );
    let record = read_json(folder.join("whole/record.json"));
    assert_eq!((&record["steps"], record["scores"].as_array().map(Vec::len)), (&30.into(), Some(3)));
    assert!(String::from_utf8_lossy(&bytes(&folder, "whole/curve.svg")).starts_with("<svg"));

    kill(&folder, &format!("{PIXELNERF} -o parts"), "parts/model.safetensors");
    let half = read_json(folder.join("parts/record.json"));
    assert!(half["steps"].as_u64() < Some(30), "it was killed too late to tell anything");
    // On another number of threads, too.
    done(&folder, &format!("{PIXELNERF} -o parts --threads 1"));
    assert_eq!(bytes(&folder, "parts/model.safetensors"), bytes(&folder, "whole/model.safetensors"));
    // And what it learned is a model that renders.
    let scene = "learn/cars_val/000000";
    done(
        &folder,
        &format!("render {scene} --model whole/model.safetensors --sources 0,1,2 --targets 5 --size 16x16 -o out"),
    );

    // A run of other settings is not gone on with, and nothing of it is lost.
    let before = bytes(&folder, "whole/state.safetensors");
    let other = PIXELNERF.replace("--rays 12", "--rays 13");
    assert_refused(
        &folder,
        &format!("{other} -o whole"),
        &["whole/state.safetensors", "settings.rays was 12 and is 13"],
    );
    assert_eq!(bytes(&folder, "whole/state.safetensors"), before);

    // Neither is a network replaced whose state is gone, nor one that another process trains.
    fs::create_dir(folder.join("kept")).expect("a folder");
    fs::copy(folder.join("whole/model.safetensors"), folder.join("kept/model.safetensors")).expect("a copy");
    assert_refused(&folder, &format!("{PIXELNERF} -o kept"), &["kept/model.safetensors: is there, and no state"]);
    assert_eq!(names_in(&folder.join("kept")), ["model.safetensors"]);
    let lock = FolderLock::take(&folder.join("whole")).expect("the lock");
    assert_refused(&folder, &format!("{PIXELNERF} -o whole"), &["whole: another process is writing to this folder"]);
    drop(lock);
    // A folder of one split is not the other one's, too.
    let set = PIXELNERF.replace("learn/cars", "learn/cars_train");
    assert_refused(
        &folder,
        &format!("{set} -o set"),
        &["learn/cars_train: is the folder of the train split", "learn/cars"],
    );

    // The weighting for it: the same again, with both embeddings; a scheme that evaluate knows.
    for embedding in ["fourier", "flat"] {
        let weighting = format!(
            "train weighting whole/model.safetensors learn/cars --embedding {embedding} --objects 1 --rays 6 --steps 4 \
             --validate-every 4 --write-every 0"
        );
        done(&folder, &format!("{weighting} -o {embedding}"));
        kill(&folder, &format!("{weighting} -o {embedding}2"), &format!("{embedding}2/model.safetensors"));
        done(&folder, &format!("{weighting} -o {embedding}2"));
        let model = format!("{embedding}/model.safetensors");
        assert_eq!(bytes(&folder, &format!("{embedding}2/model.safetensors")), bytes(&folder, &model));
        let table = done(&folder, &format!("weights {scene} --sources 0,1,2 --target 5 --weights attention:{model}"));
        assert!(table.contains("attention") && table.contains(&model), "{table}");
    }
}

fn ctrl_c_writes_the_state_first() {
    let folder = scenes();
    let long = PIXELNERF.replace("--steps 30", "--steps 100000").replace("--write-every 0", "--write-every 1000");
    // The first state appears when the run is asked to end: nothing else writes it.
    let arguments = format!("{long} --validate-every 5 -o run").replace(" --validate-every 10", "");
    let mut child = start(&folder, &arguments);
    let mut news = BufReader::new(child.stdout.take().expect("its output"));
    let mut first = String::new();
    news.read_line(&mut first).expect("text");
    assert!(first.starts_with("step 5: "), "{first}");
    interrupt(child, "-INT");
    let record = read_json(folder.join("run/record.json"));
    assert!(record["steps"].as_u64() >= Some(5) && folder.join("run/state.safetensors").exists(), "{record}");
}

fn genvs_goes_on_too() {
    let folder = scenes();
    done(&folder, &format!("{GENVS} -o whole"));
    kill(&folder, &format!("{GENVS} -o parts"), "parts/state.safetensors");
    done(&folder, &format!("{GENVS} -o parts"));
    assert_eq!(bytes(&folder, "parts/model.safetensors"), bytes(&folder, "whole/model.safetensors"));

    // From what it learned, a network goes on as it was: at a rate of zero it stays so, to the bit.
    let model = "whole/model.safetensors";
    let from = GENVS.replace("--width 4", &format!("--from {model} --rate 0"));
    done(&folder, &format!("{from} -o more"));
    assert_eq!(bytes(&folder, "more/model.safetensors"), bytes(&folder, model));
    let small = from.replace("--side 32", "--side 16");
    assert_refused(&folder, &format!("{small} -o out"), &[model, "for pictures of 32x32 pixels", "not of 16x16"]);
    assert_wrong_arguments(&folder, &format!("{from} --width 4 -o out"), &["--from", "--width"]);
}

fn data_are_told_by_what_is_in_them() {
    let folder = scenes();
    let first = PIXELNERF.replace("--steps 30", "--steps 2");
    done(&folder, &format!("{first} -o run"));
    let from = first.replace("--width 16", "--from run/model.safetensors --rate 0");
    done(&folder, &format!("{from} -o more"));
    assert_refused(&folder, &format!("{from} -o fewer --levels 2"), &["the setting levels is 2", "more levels"]);
    assert_eq!(bytes(&folder, "more/model.safetensors"), bytes(&folder, "run/model.safetensors"));

    // A run goes on where its scenes lie elsewhere now, and does not where they are others under the same names.
    fs::rename(folder.join("learn"), folder.join("moved")).expect("a folder");
    done(&folder, &format!("{} -o run", first.replace("learn/", "moved/")));
    done(&folder, "scenes make cars learn --train 2 --val 1 --test 0 --views 10 --test-views 10 --size 64 --seed 2");
    assert_refused(&folder, &format!("{first} -o run"), &["run/state.safetensors", "settings", "data was"]);
    // Nor from another network of the same name.
    let moved = from.replace("learn/", "moved/");
    done(&folder, &format!("{moved} -o more"));
    done(&folder, &format!("{} --seed 3 -o other", first.replace("learn/", "moved/")));
    fs::rename(folder.join("other/model.safetensors"), folder.join("run/model.safetensors")).expect("a file");
    assert_refused(&folder, &format!("{moved} -o more"), &["more/state.safetensors", "checkpoint was"]);
}

fn wrong_input_is_told() {
    let folder = scenes();
    let refused = |arguments: &str, parts: &[&str]| assert_refused(&folder, arguments, parts);
    refused("train pixelnerf learn/lorries -o out", &["lorries"]);
    refused("train weighting learn/cars.json learn/cars -o out", &["learn/cars.json"]);
    fs::write(folder.join("state.safetensors"), "nothing").expect("a file");
    refused("train pixelnerf learn/cars -o .", &["./state.safetensors: is not the state of a training run"]);
    if cfg!(target_os = "linux") {
        // Nobody can make a folder there; it is noticed before the first of many steps.
        refused("train pixelnerf learn/cars --steps 1000000 -o /proc/out", &["/proc/out/", "cannot be written"]);
    }
    assert_wrong_arguments(&folder, "train genvs learn/cars -o out --width 5", &["a multiple of 4"]);
    let attention = "train pixelnerf learn/cars -o out --weights cross-attention";
    assert_wrong_arguments(&folder, attention, &["--weights", "formulas only"]);
    refused("train pixelnerf learn/cars -o out --sources 3,10", &["has 10 photographs; 11 are needed"]);
    refused("train genvs learn/cars -o out --sources 3,9 --targets 2", &["has 10 photographs; 11 are needed"]);
    // Nothing is written among the data, nor over files of another program.
    for inside in ["learn/cars_train", "learn/cars_train/000000/rgb", "learn/cars_val/000000/rgb/new"] {
        assert_wrong_arguments(
            &folder,
            &format!("train pixelnerf learn/cars -o {inside}"),
            &[inside, "the scene", "is there"],
        );
    }
    folder.write("mine/record.json", "{}");
    refused("train pixelnerf learn/cars -o mine", &["mine/record.json: is there, and no state"]);
    // Validation has three sources, however few the steps have.
    done(&folder, "scenes make cars few --train 1 --val 1 --test 0 --views 3 --test-views 3 --size 64");
    refused("train genvs few/cars --side 16 -o out --sources 1 --targets 1", &["has 3 photographs; 4 are needed"]);
    assert!(!folder.join("out").exists());
}

/// Pictures without an error have a score, from which a run goes on; and what is in both splits is told.
fn scores_are_finite_and_of_other_scenes() {
    let folder = scenes();
    for (name, _) in files_below(&folder.join("learn")) {
        if name.extension().is_some_and(|ending| ending == "png") {
            let white = image::open(&name).expect("a picture").to_rgb8();
            let white = image::RgbImage::from_pixel(white.width(), white.height(), image::Rgb([255; 3]));
            white.save(&name).expect("a white picture");
        }
    }
    // Of one object by its content, whatever it is called.
    let files = files_below(&folder.join("learn/cars_train/000001"));
    for (name, _) in files.into_iter().filter(|(name, _)| name.is_file()) {
        let inside = name.strip_prefix(folder.join("learn/cars_train/000001")).expect("inside").to_owned();
        folder.write(&format!("learn/cars_val/000009/{}", inside.display()), fs::read(&name).expect("a file"));
    }
    let run = PIXELNERF.replace("--steps 30", "--steps 12 --rate 0.05");
    let outcome = super::run(&folder, &format!("{run} -o run"));
    assert_eq!(outcome.code, Some(0), "{}", outcome.stderr);
    let parts = ["1 of the 2 scenes of validation are scenes of training, too (", "000009"];
    assert!(parts.iter().all(|part| outcome.stderr.contains(part)), "{}", outcome.stderr);
    let record = read_json(folder.join("run/record.json"));
    let finite =
        |scores: &[serde_json::Value]| scores.iter().all(|score| score[1].as_f64().is_some_and(|score| score <= 100.0));
    assert!(record["scores"].as_array().is_some_and(|scores| finite(scores)), "{record}");
    let longer = super::run(&folder, &format!("{} -o run", run.replace("--steps 12", "--steps 14")));
    assert_eq!(longer.code, Some(0), "{}", longer.stderr);
}

/// Numbers with which nothing would be computed, learned or written, or that no memory holds.
fn numbers_without_sense_are_refused() {
    let folder = scenes();
    let wrong = |model: &str, option: &str, parts: &[&str]| {
        let arguments = format!("train {model} learn/cars -o out {option}");
        assert_wrong_arguments(&folder, &arguments, parts);
    };
    for option in ["objects", "rays", "width"] {
        for value in ["0", "100000", "18446744073709551615"] {
            wrong("pixelnerf", &format!("--{option} {value}"), &[option, "from 1 to 1024"]);
        }
    }
    for value in ["0", "1", "100000"] {
        wrong("pixelnerf", &format!("--coarse {value}"), &["--coarse", "from 2 to 1024"]);
    }
    wrong("pixelnerf", "--fine 100000", &["--fine", "from 0 to 1024"]);
    for value in ["0", "5", "3.5"] {
        wrong("pixelnerf", &format!("--levels {value}"), &["--levels", "from 1 to 4"]);
    }
    for value in ["0", "2,300", "2,,3", "two"] {
        wrong("pixelnerf", &format!("--sources {value}"), &["--sources"]);
        wrong("genvs", &format!("--sources {value}"), &["--sources"]);
    }
    for value in ["0", "nan", "1.5", "-0.5"] {
        wrong("pixelnerf", &format!("--least-crop={value}"), &["--least-crop", "above 0, at most 1"]);
        if value != "0" {
            wrong("genvs", &format!("--largest-share={value}"), &["--largest-share", "from 0 to 1"]);
        }
    }
    wrong("pixelnerf", "--sides 32,33", &["--sides", "a multiple of 16"]);
    wrong("genvs", "--new-denoiser", &["required arguments"]);
    let larger = "train pixelnerf learn/cars -o out --side 32 --sides 32,48";
    assert_refused(&folder, larger, &["sides is 48", "a multiple of 16 from 16 to the side"]);
    for value in ["0", "8", "100000"] {
        wrong("pixelnerf", &format!("--side {value}"), &["--side", "a multiple of 16 from 16 to 1024"]);
    }
    for model in ["pixelnerf", "genvs"] {
        for value in ["nan", "-1", "inf", "2", "-0.001"] {
            wrong(model, &format!("--rate={value}"), &["--rate", "from 0 to 1"]);
        }
        for value in ["nan", "-1", "inf"] {
            wrong(model, &format!("--write-every={value}"), &["--write-every", "from 0 to 86400"]);
        }
    }
    let all = "train pixelnerf learn/cars -o out --objects 1024 --rays 1024 --coarse 1024 --width 1024";
    assert_refused(&folder, all, &["objects", "at most 2^28"]);
    let all = "train genvs learn/cars -o out --objects 1024 --sources 3";
    assert_refused(&folder, all, &["objects is 1024", "volume", "at most 2^30"]);
    // The least that can be computed.
    let least = "--side 16 --objects 1 --rays 1 --coarse 2 --fine 0 --width 1 --steps 1";
    done(&folder, &format!("train pixelnerf learn/cars -o least {least}"));
}

/// The state of a run with this in the place of its progress.
fn with_progress(state: &[u8], progress: &str) -> Vec<u8> {
    let length = u64::from_le_bytes(state[..8].try_into().expect("a length")) as usize;
    let mut header: serde_json::Value = serde_json::from_slice(&state[8..8 + length]).expect("a header");
    header["__metadata__"]["progressed"] = progress.into();
    let mut text = header.to_string();
    text.push_str(&" ".repeat(text.len().next_multiple_of(8) - text.len()));
    [&(text.len() as u64).to_le_bytes(), text.as_bytes(), &state[8 + length..]].concat()
}

fn a_damaged_state_is_refused_and_an_empty_one_is_none() {
    let folder = scenes();
    let run = format!("{} -o run", PIXELNERF.replace("--steps 30", "--steps 2"));
    done(&folder, &run);
    let path = folder.join("run/state.safetensors");
    let state = fs::read(&path).expect("a state");
    let sound = r#"{"steps":1,"seconds":1.0,"losses":[[1,0.5]],"pending":[0.0,0],"scores":[[1,12.0]]}"#;
    for (from, to) in [
        ("12.0", "1e308"),
        ("12.0", "-1e308"),
        ("[1,12.0]", "[7,12.0]"),
        ("0.5", "1e300"),
        ("[0.0,0]", "[1e308,1]"),
        ("1.0,", "-1.0,"),
    ] {
        fs::write(&path, with_progress(&state, &sound.replace(from, to))).expect("a file");
        assert_refused(&folder, &run, &["run/state.safetensors: is not the state", "out of range"]);
    }
    fs::write(&path, with_progress(&state, sound)).expect("a file");
    done(&folder, &run);
    // A machine that lost its power leaves an empty file: the run begins again, and no other in its place.
    fs::write(&path, "").expect("a file");
    let before = bytes(&folder, "run/model.safetensors");
    assert_refused(&folder, &format!("{run} --seed 5"), &["run/model.safetensors: is there, and no state"]);
    assert!(bytes(&folder, "run/model.safetensors") == before);
    let again = super::run(&folder, &run);
    assert!(again.code == Some(0) && again.stdout.contains("2 steps in"), "{}", again.stderr);
    assert!(again.stderr.contains("run/state.safetensors: is empty") && again.stderr.contains("begins anew"));
    // Numbers that are none, as of a rate that is too high: of what was written nothing is lost.
    let broken = [&state[..state.len() - 4000], &[0xff; 4000]].concat();
    fs::write(&path, &broken).expect("a file");
    let on = run.replace("--steps 2", "--steps 9").replace("--write-every 0", "--write-every 1000");
    let failed = super::run(&folder, &on);
    for part in ["step 3: the loss is not finite", "the state that was written last is kept", "--rate"] {
        assert!(failed.code == Some(1) && failed.stderr.contains(part), "{}", failed.stderr);
    }
    assert!(fs::read(&path).expect("a state") == broken);
    fs::remove_file(&path).expect("a file");
    fs::create_dir(&path).expect("a folder in the way");
    assert_refused(&folder, &run, &["run/state.safetensors: cannot be written: it is a folder"]);
}

fn a_loss_is_shown_once_there_is_one() {
    let folder = scenes();
    let run = PIXELNERF.replace("--validate-every 10", "--validate-every 1").replace("--steps 30", "--steps 2");
    let said = done(&folder, &format!("{run} -o run"));
    assert!(said.contains("step 1: loss 0.") && !said.contains("NaN"), "{said}");
}

/// A long run tells how far it is: on the terminal, in its folder before its state is written for the first time, and
/// on a report's page.
fn curves_are_there_while_it_runs() {
    let folder = scenes();
    let long = PIXELNERF.replace("--steps 30", "--steps 100000").replace("--write-every 0", "--write-every 1000");
    let mut run = command(&folder, &format!("{long} -o run"));
    let run = run.env("VIEWFUSE_PROGRESS", "0").stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = run.spawn().expect("the command starts");
    let curve = || fs::read_to_string(folder.join("run/curve.csv")).unwrap_or_default();
    patience::wait_while_running(&mut child, || curve().lines().count() > 2);
    done(&folder, "report --training run -o page.html");
    assert!(!folder.join("run/model.safetensors").exists());
    child.kill().expect("a process to kill");
    let said = String::from_utf8(child.wait_with_output().expect("a dead process").stderr).expect("text");
    let live = said.lines().filter(|line| line.contains(" %, training: step "));
    let live: Vec<&str> = live.collect();
    assert!(live.iter().any(|line| line.contains(" step 9, loss 0.") && !line.contains("PSNR")), "{said}");
    assert!(live.iter().any(|line| line.contains(" step 19, loss 0.") && line.contains(", PSNR dB ")), "{said}");
    let page = fs::read_to_string(folder.join("page.html")).expect("a page");
    assert!(page.contains("<strong>Not finished: </strong>") && page.contains(" of 100000 steps"), "{page:.300}");
    assert!(page.contains("data:image/svg+xml;base64,"));

    // The table has the points of the record.
    done(&folder, &format!("{} -o whole", PIXELNERF.replace("--steps 30", "--steps 70")));
    let record = read_json(folder.join("whole/record.json"));
    let table = fs::read_to_string(folder.join("whole/curve.csv")).expect("a table");
    let cells: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(cells[0], ["step", "loss", "PSNR dB"]);
    for (column, key, count) in [(1, "losses", 1), (2, "scores", 7)] {
        let there = cells.iter().skip(1).filter(|cells| !cells[column].is_empty());
        let points: Vec<serde_json::Value> =
            there.map(|cells| serde_json::json!([number(cells[0]) as u32, number(cells[column])])).collect();
        assert_eq!(points.len(), count, "{table}");
        assert_eq!(serde_json::Value::from(points), record[key], "{table}");
    }
    done(&folder, "report --training whole -o page.html");
    assert!(!fs::read_to_string(folder.join("page.html")).expect("a page").contains("Not finished"));
}

fn number(text: &str) -> f64 {
    text.parse().unwrap_or_else(|_| panic!("{text:?} is no number"))
}

fn more_steps_go_on_from_fewer() {
    let folder = scenes();
    let run = |steps: u32| format!("{} -o run", PIXELNERF.replace("--steps 30", &format!("--steps {steps}")));
    let record = || read_json(folder.join("run/record.json"));
    done(&folder, &run(4));
    assert!(record()["extended"].is_null(), "{}", record());
    let short = bytes(&folder, "run/model.safetensors");
    let said = done(&folder, &run(7));
    assert!(said.starts_with("goes on at step 4 of a run of 4: from here the rate is that of 7 steps\n"), "{said}");
    assert!(said.contains("7 steps in"), "{said}");
    assert_eq!((&record()["steps"], &record()["extended"]), (&7.into(), &serde_json::json!([[4, 4]])));
    let long = bytes(&folder, "run/model.safetensors");
    assert!(long != short, "it learned");
    // Once more: there is nothing to do, and nothing is said of it.
    assert!(!done(&folder, &run(7)).contains("goes on"));
    assert_eq!(bytes(&folder, "run/model.safetensors"), long);
    assert_eq!(record()["extended"], serde_json::json!([[4, 4]]));
    // Fewer steps are another run.
    assert_refused(&folder, &run(5), &["run/state.safetensors", "schedule.steps was 7"]);
}
