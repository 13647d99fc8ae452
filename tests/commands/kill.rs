//! Kills without a warning, at random moments of every command that writes: no half-written file, nothing lost that was
//! finished, and the same command goes on. `VIEWFUSE_KILLS=N` kills N times; the tests do it a few times.

use super::{command, done};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};
use viewfuse::nn::checkpoint::Checkpoint;
use viewfuse::output::journal::JOURNAL;
use viewfuse::output::run::RECORD;
use viewfuse::scene::SceneFrame;
use viewfuse::scene::gaussians::GaussianScene;
use viewfuse_tests::command::{files_below, toy, unheard};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![killed_at_any_moment];

/// Files of an output folder.
pub(super) type Files = BTreeMap<PathBuf, Vec<u8>>;

/// Every command that writes, into the folder `OUT`. The others (`compare`, `devices`, `verify`, `check`, `bench`) only
/// print; `view` keeps nothing.
const COMMANDS: [&str; 20] = [
    "render toy --orbit 4 --size 24x24 --device cpu -o OUT",
    "render toy --targets 20,21 --depth exr,npy --alpha --size 24x24 --device cpu -o OUT",
    "render toy --between 2 6 --frames 4 --size 16x16 --video webp,y4m --device cpu -o OUT",
    "evaluate toy --protocol random --trials 4 --targets-per-trial 1 --weights mean --size 16x16 --device cpu -o OUT",
    "evaluate toy --targets 20,21 --weights mean --size 16x16 --device cpu -o OUT/scores.csv",
    "pareto toy --targets 20 --views 3 --size 16x16 --repeat 1 --device cpu -o OUT",
    "report run --training small -o OUT/page.html",
    "select toy --count 3 --targets 20,21 --json -o OUT/views.json",
    "weights toy --targets 20,21 --npy OUT/weights.npy",
    "points toy --size 32x32 -o OUT/toy.ply",
    "optimise toy --size 24x24 --iterations 40 --device cpu -o OUT/gaussians.ply",
    "inspect toy -o OUT/cameras.png",
    "scenes make cars OUT --train 3 --val 1 --test 0 --views 2 --test-views 2 --size 64",
    "scenes photograph room OUT --views 3 --size 64x48",
    "export toy --layout transforms -o OUT/toy",
    "convert small/model.safetensors OUT/small.safetensors --half",
    "convert weighting/model.safetensors OUT/attention.h",
    "train pixelnerf learn/cars --width 8 --objects 1 --rays 8 --coarse 4 --fine 2 --side 16 --steps 12 \
     --validate-every 4 --write-every 0 -o OUT",
    "train genvs learn/cars --width 4 --objects 1 --samples 4 --side 16 --steps 3 --validate-every 3 --write-every 0 \
        -o OUT",
    "train weighting small/model.safetensors learn/cars --objects 1 --rays 4 --steps 4 --validate-every 4 \
     --write-every 0 -o OUT",
];

/// Those of them that refuse a folder that is there.
const NEVER_OVER: [&str; 2] = ["export", "scenes photograph"];

/// What the commands read, made before the first kill.
const INPUTS: [&str; 5] = ["toy", "learn", "small", "weighting", "run"];

/// Kills in the ordinary tests: each command once.
const FEW: usize = COMMANDS.len();

/// What all commands need.
fn folder() -> Folder {
    let folder = toy();
    for arguments in [
        "scenes make cars learn --train 2 --val 1 --test 0 --views 9 --test-views 9 --size 64",
        "train pixelnerf learn/cars --width 8 --objects 1 --rays 8 --coarse 4 --fine 2 --side 16 --steps 4 \
         --validate-every 4 -o small",
        "train weighting small/model.safetensors learn/cars --objects 1 --rays 4 --steps 1 --validate-every 1 -o \
            weighting",
        "evaluate toy --protocol random --trials 2 --targets-per-trial 1 --weights mean --size 16x16 --device cpu -o \
            run",
    ] {
        done(&folder, arguments);
    }
    folder
}

/// Every file that is an input, with its bytes.
fn inputs(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let files = INPUTS.iter().flat_map(|name| files_below(&folder.join(name)));
    files.filter(|(path, _)| path.is_file()).map(|(path, _)| (path.clone(), fs::read(&path).expect("a file"))).collect()
}

/// Every file is whole: it is read by whatever reads its kind, or is `like` the one that an undisturbed run wrote.
/// Hidden ones are those that a kill leaves.
#[track_caller]
pub(super) fn assert_whole(folder: &Path, like: &Files) -> Files {
    let mut whole = Files::new();
    if !folder.is_dir() {
        return whole;
    }
    for (path, _) in files_below(folder) {
        let inside = path.strip_prefix(folder).expect("inside").to_path_buf();
        if is_hidden(&inside) || !path.is_file() {
            continue;
        }
        let bytes = fs::read(&path).expect("a file");
        let text = || String::from_utf8(bytes.clone()).unwrap_or_else(|_| panic!("{}: no text", path.display()));
        match path.extension().and_then(|extension| extension.to_str()).unwrap_or_default() {
            // A decoder reads a JPEG that is cut off, too.
            "jpg" if !bytes.ends_with(&[0xff, 0xd9]) => panic!("{}: has no end", path.display()),
            "png" | "jpg" => {
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
            "html" => assert!(text().trim_end().ends_with("</html>"), "{}", path.display()),
            "csv" | "txt" => assert!(text().ends_with('\n'), "{}", path.display()),
            "safetensors" => drop(Checkpoint::open(&path).unwrap_or_else(|error| panic!("{error}"))),
            // Also a scene that is not finished, to go on from.
            "ply" if GaussianScene::read(&path, &SceneFrame::FILE).is_ok() => {}
            "exr" | "npy" | "ply" | "webp" | "y4m" | "h" => {
                assert!(like.get(&inside).is_none_or(|like| *like == bytes), "{} is not what it was", path.display());
            }
            other => panic!("{}: what is {other}?", path.display()),
        }
        whole.insert(inside, bytes);
    }
    whole
}

/// Whether it is a file that a kill leaves, or in such a folder.
fn is_hidden(path: &Path) -> bool {
    path.components().any(|part| part.as_os_str().to_string_lossy().starts_with('.'))
}

/// The first of the finished files that are no longer there. A journal goes when its run is done, record and video of a
/// render when another one begins to write over its pictures.
fn lost<'a>(finished: &'a Files, now: &Files) -> Option<&'a PathBuf> {
    let may_go =
        |name: &Path| name.ends_with(JOURNAL) || name.ends_with(RECORD) || name.file_stem() == Some("video".as_ref());
    finished.keys().find(|name| !may_go(name) && !now.contains_key(*name))
}

/// What an undisturbed run wrote, and its time.
pub(super) fn undisturbed(folder: &Path, arguments: &str, out: &Path) -> (Files, Duration) {
    let start = Instant::now();
    done(folder, arguments);
    let time = start.elapsed();
    let files = assert_whole(out, &Files::new());
    assert!(!files.is_empty(), "viewfuse {arguments} wrote nothing");
    (files, time)
}

fn killed_at_any_moment() {
    let kills = std::env::var("VIEWFUSE_KILLS").map_or(FEW, |count| count.parse().expect("VIEWFUSE_KILLS is a number"));
    let folder = folder();
    let before = inputs(folder.path());
    let mut first: Vec<(Files, Duration)> = Vec::new();
    let (mut random, mut too_late, mut in_a_file) = (0x9e37_79b9_7f4a_7c15_u64 ^ kills as u64, 0, 0);
    for kill in 0..kills {
        let name = format!("out{}", kill % COMMANDS.len());
        let arguments = &COMMANDS[kill % COMMANDS.len()].replace("OUT", &name);
        let out = folder.path().join(name);
        if first.len() < COMMANDS.len() {
            first.push(undisturbed(folder.path(), arguments, &out));
        }
        let (like, time) = &first[kill % COMMANDS.len()];
        // By turns into an empty folder and over what an earlier run finished. Scenes never go over what is there.
        let is_never_over = NEVER_OVER.iter().any(|name| arguments.starts_with(name));
        let is_over = (kill % COMMANDS.len() + kill / COMMANDS.len()) % 2 == 1 && !is_never_over;
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mut moment = time.mul_f64((random >> 33) as f64 / f64::from(1_u32 << 31));
        let earlier = loop {
            if !is_over && out.is_dir() {
                fs::remove_dir_all(&out).expect("an output");
            }
            let earlier = assert_whole(&out, like);
            let mut child = unheard(command(&folder, arguments));
            sleep(moment);
            let is_in_the_middle = child.try_wait().expect("a process").is_none();
            child.kill().expect("a kill");
            child.wait().expect("an end");
            if is_in_the_middle {
                break earlier;
            }
            // The machine is faster than it was when the time was taken.
            too_late += 1;
            moment /= 2;
        };
        let finished = assert_whole(&out, like);
        assert_eq!(lost(&earlier, &finished), None, "viewfuse {arguments} lost what an earlier run finished");
        assert_eq!(inputs(folder.path()), before, "viewfuse {arguments} changed an input");
        in_a_file += usize::from(out.is_dir() && files_below(&out).iter().any(|(path, _)| is_unfinished(path)));
        if is_never_over && out.is_dir() {
            fs::remove_dir_all(&out).expect("an output");
        }
        // The same command goes on, keeps what was finished, and leaves nothing of the kill.
        done(folder.path(), arguments);
        let after = assert_whole(&out, like);
        assert_eq!(lost(&finished, &after), None, "viewfuse {arguments} lost what it had finished");
        assert!(after.keys().eq(like.keys()), "viewfuse {arguments}: {:?} instead of {:?}", after.keys(), like.keys());
        let left = files_below(&out).into_iter().map(|(path, _)| path).find(|path| is_unfinished(path));
        assert_eq!(left, None, "viewfuse {arguments} left something");
    }
    println!("{kills} kills, {in_a_file} of them while a file was written; {too_late} more came too late");
}

pub(super) fn is_unfinished(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'))
}
