//! Kills without a warning, at random moments of every command that writes: no half-written file, nothing lost that was
//! finished, and the same command goes on. `VIEWFUSE_KILLS=N` kills N times; the tests do it a few times.

use super::{BINARY, done};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse_tests::command::{command, files_below, toy};
use viewfuse_tests::places::data;
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![killed_at_any_moment];

/// Every command that writes, and where.
const COMMANDS: [(&str, &str); 9] = [
    ("render toy --orbit 4 --size 24x24 --device cpu -o out", "out"),
    (
        "evaluate toy --protocol random --trials 4 --targets-per-trial 1 --weights mean --size 16x16 --device cpu -o out",
        "out",
    ),
    ("evaluate toy --targets 20,21 --weights mean --size 16x16 --device cpu -o out/scores.csv", "out"),
    ("scenes make toys out --train 3 --val 1 --test 0 --views 2 --test-views 2 --size 64", "out"),
    ("export toy --layout transforms -o out/toy", "out"),
    ("convert small.safetensors out/small.safetensors --half", "out"),
    ("inspect toy -o out/cameras.png", "out"),
    ("pareto toy --targets 20 --views 3 --size 16x16 --repeat 1 --device cpu -o out", "out"),
    (
        "train pixelnerf learn/toys --width 8 --objects 1 --rays 8 --coarse 4 --fine 2 --side 16 --steps 12 \
         --validate-every 4 --write-every 0 -o out",
        "out",
    ),
];

/// Kills in the ordinary tests: each command once.
const FEW: usize = COMMANDS.len();

/// What all commands need.
fn folder() -> Folder {
    let folder = toy();
    fs::copy(data("pixelnerf_small.safetensors"), folder.path().join("small.safetensors")).expect("a copy");
    done(folder.path(), "scenes make toys learn --train 2 --val 1 --test 0 --views 8 --test-views 8 --size 64");
    folder
}

/// Every file is whole: it is read by whatever reads its kind. Hidden ones are those that a kill leaves.
#[track_caller]
fn assert_whole(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut whole = BTreeMap::new();
    if !folder.is_dir() {
        return whole;
    }
    for (path, _) in files_below(folder) {
        let inside = path.strip_prefix(folder).expect("inside").to_path_buf();
        let is_hidden = inside.components().any(|part| part.as_os_str().to_string_lossy().starts_with('.'));
        if is_hidden || !path.is_file() {
            continue;
        }
        let bytes = fs::read(&path).expect("a file");
        let text = || String::from_utf8(bytes.clone()).unwrap_or_else(|_| panic!("{}: no text", path.display()));
        match path.extension().and_then(|extension| extension.to_str()).unwrap_or_default() {
            "png" => {
                drop(image::load_from_memory(&bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
            }
            "json" => drop(
                serde_json::from_slice::<Value>(&bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display())),
            ),
            // The last line may be one that was being written.
            "jsonl" => text().split_inclusive('\n').filter(|line| line.ends_with('\n')).for_each(|line| {
                serde_json::from_str::<Value>(line).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            }),
            "svg" => assert!(text().trim_end().ends_with("</svg>"), "{}", path.display()),
            "csv" | "txt" => assert!(text().ends_with('\n'), "{}", path.display()),
            "safetensors" => drop(Checkpoint::open(&path).unwrap_or_else(|error| panic!("{error}"))),
            other => panic!("{}: what is {other}?", path.display()),
        }
        whole.insert(inside, bytes);
    }
    whole
}

fn killed_at_any_moment() {
    let kills = std::env::var("VIEWFUSE_KILLS").map_or(FEW, |count| count.parse().expect("VIEWFUSE_KILLS is a number"));
    let folder = folder();
    let inputs = |folder: &Path| -> Vec<(PathBuf, Vec<u8>)> {
        let files = ["toy", "learn", "small.safetensors"].map(|name| folder.join(name));
        let files =
            files.iter().flat_map(|path| if path.is_dir() { files_below(path) } else { vec![(path.clone(), 0)] });
        files
            .filter(|(path, _)| path.is_file())
            .map(|(path, _)| (path.clone(), fs::read(&path).expect("a file")))
            .collect()
    };
    let before = inputs(folder.path());
    let mut times = [Duration::ZERO; COMMANDS.len()];
    let (mut random, mut in_the_middle) = (0x9e37_79b9_7f4a_7c15_u64 ^ kills as u64, 0);
    for kill in 0..kills {
        let (arguments, out) = COMMANDS[kill % COMMANDS.len()];
        let out = folder.path().join(out);
        let time = &mut times[kill % COMMANDS.len()];
        if time.is_zero() {
            let start = Instant::now();
            done(folder.path(), arguments);
            *time = start.elapsed();
            fs::remove_dir_all(&out).expect("an output");
        }
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let moment = time.mul_f64((random >> 33) as f64 / f64::from(1_u32 << 31));
        let mut run = command(BINARY, folder.path(), arguments);
        let mut child = run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the command starts");
        sleep(moment);
        in_the_middle += usize::from(child.try_wait().expect("a process").is_none());
        child.kill().expect("a kill");
        child.wait().expect("an end");
        let finished = assert_whole(&out);
        assert_eq!(inputs(folder.path()), before, "viewfuse {arguments} changed an input");
        // What was whole may have been replaced by the next run, but is still there; and nothing hidden is.
        if out.join("toy").is_dir() {
            // An export never goes over one that is there.
            fs::remove_dir_all(out.join("toy")).expect("an output");
        }
        done(folder.path(), arguments);
        let after = assert_whole(&out);
        let gone: Vec<_> = finished.keys().filter(|name| !after.contains_key(*name)).collect();
        assert!(gone.is_empty(), "viewfuse {arguments}: finished files are gone: {gone:?}");
        let left: Vec<PathBuf> = files_below(&out).into_iter().map(|(path, _)| path).collect();
        let is_left = |path: &&PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        assert_eq!(left.iter().find(is_left), None, "viewfuse {arguments} left something");
        fs::remove_dir_all(&out).expect("an output");
    }
    println!("{kills} kills, {in_the_middle} while the command ran");
    assert!(in_the_middle * 2 > kills, "the kills come too late: {in_the_middle} of {kills} while the command ran");
}
