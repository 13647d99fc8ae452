//! Kills without a warning while two runs want one folder: one of them has it, nothing of both is mixed, and nothing is
//! lost that was finished. `VIEWFUSE_KILLS=N` kills N times; the tests do it a few times.

use super::command;
use super::kill::{Files, assert_whole, is_unfinished, undisturbed};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, SystemTime};
use viewfuse::output::journal::JOURNAL;
use viewfuse::output::run::RECORD;
use viewfuse_tests::command::{files_below, toy, unheard};

viewfuse_tests::trials![killed_while_two_race];

/// Two commands that write to one place.
const RACES: [[&str; 2]; 3] = [
    [
        "render toy --orbit 4 --size 24x24 --weights mean --device cpu -o OUT",
        "render toy --orbit 4 --size 24x24 --weights distance:power=3 --device cpu -o OUT",
    ],
    [
        "evaluate toy --protocol random --trials 4 --targets-per-trial 1 --weights mean --size 16x16 --device cpu -o \
            OUT",
        "evaluate toy --protocol random --trials 4 --targets-per-trial 1 --weights mean --size 16x16 --device cpu -o \
            OUT",
    ],
    ["points toy --size 32x32 -o OUT/toy.ply", "points toy --size 24x24 -o OUT/toy.ply"],
];

/// Kills in the ordinary tests.
const FEW: usize = 2 * RACES.len();

/// What a command makes, by its bytes: pictures and points. Records hold times.
fn is_result(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "png" || extension == "ply")
}

/// Which of two runs made each of these files; an error if it was neither, or both of them some.
fn maker<'a>(
    files: impl Iterator<Item = (&'a PathBuf, &'a Vec<u8>)>,
    like: &[Files; 2],
) -> Result<Option<usize>, String> {
    let mut makers: BTreeSet<usize> = BTreeSet::from([0, 1]);
    let mut count = 0;
    for (path, bytes) in files.filter(|(path, _)| is_result(path)) {
        makers.retain(|run| like[*run].get(path) == Some(bytes));
        count += 1;
        if makers.is_empty() {
            return Err(format!("{} is of no run, or of another than the files before it", path.display()));
        }
    }
    Ok(makers.into_iter().next().filter(|_| count > 0))
}

/// The files of each frame that a journal lists, with the time of their last change.
fn journaled_frames(out: &Path) -> Vec<Vec<(PathBuf, SystemTime)>> {
    let Ok(text) = fs::read_to_string(out.join(JOURNAL)) else { return Vec::new() };
    let whole = text.split_inclusive('\n').skip(1).filter(|line| line.ends_with('\n'));
    let lines = whole.map(|line| serde_json::from_str::<Value>(line).expect("a line of the journal"));
    let changed = |name: &str| fs::metadata(out.join(name)).and_then(|about| about.modified()).expect("a listed file");
    let files = |line: Value| {
        let names = line["files"].as_array().cloned().unwrap_or_default();
        names.iter().filter_map(Value::as_str).map(|name| (PathBuf::from(name), changed(name))).collect()
    };
    lines.map(files).collect()
}

/// Nothing is mixed: what a record or a journal speaks of is of one run, which is returned.
#[track_caller]
fn assert_unmixed(out: &Path, whole: &Files, like: &[Files; 2]) -> Option<usize> {
    let listed: BTreeSet<PathBuf> = journaled_frames(out).into_iter().flatten().map(|(name, _)| name).collect();
    let of_journal = maker(whole.iter().filter(|(path, _)| listed.contains(*path)), like);
    let of_journal = of_journal.unwrap_or_else(|mixed| panic!("the journal's files: {mixed}"));
    if whole.keys().any(|path| path.ends_with(RECORD)) && listed.is_empty() {
        maker(whole.iter(), like).unwrap_or_else(|mixed| panic!("the record's files: {mixed}"));
    }
    of_journal
}

fn killed_while_two_race() {
    let kills = std::env::var("VIEWFUSE_KILLS").map_or(FEW, |count| count.parse().expect("VIEWFUSE_KILLS is a number"));
    let folder = toy();
    let mut known: Vec<([Files; 2], Duration)> = Vec::new();
    let (mut random, mut in_the_middle, mut went_on) = (0x2545_f491_4f6c_dd1d_u64 ^ kills as u64, 0, 0);
    for kill in 0..kills {
        let race = kill % RACES.len();
        let out = folder.join(format!("out{race}"));
        let commands = RACES[race].map(|arguments| arguments.replace("OUT", &format!("out{race}")));
        let clear = || {
            if out.is_dir() {
                fs::remove_dir_all(&out).expect("an output")
            }
        };
        if known.len() < RACES.len() {
            let made = [0, 1].map(|run| {
                clear();
                undisturbed(&folder, &commands[run], &out)
            });
            let longest = made[0].1.max(made[1].1);
            known.push((made.map(|(files, _)| files), longest));
        }
        let (like, time) = &known[race];
        // By turns an empty folder and what the last race left.
        if (kill / RACES.len()).is_multiple_of(2) {
            clear();
        }
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        // Two at once take longer than one alone.
        let moment = time.mul_f64(1.5 * (random >> 33) as f64 / f64::from(1_u32 << 31));
        let mut runs = [0, 1].map(|run| unheard(command(&folder, &commands[run])));
        sleep(moment);
        in_the_middle += usize::from(runs.iter_mut().any(|run| run.try_wait().expect("a process").is_none()));
        // One of them, the other, or both; the one that is left has its time.
        let who = (random >> 20) % 3;
        for (index, run) in runs.iter_mut().enumerate() {
            if who == 2 || who == index as u64 {
                run.kill().expect("a kill");
            }
            run.wait().expect("an end");
        }
        let whole = assert_whole(&out, &Files::new());
        let of_journal = assert_unmixed(&out, &whole, like);
        // The run that was interrupted goes on: what it had finished is not made again.
        let mut finished = journaled_frames(&out);
        let next = of_journal.unwrap_or(kill % 2);
        went_on += usize::from(!finished.is_empty());
        if finished.iter().flatten().filter(|(path, _)| is_result(path)).count()
            == like[next].keys().filter(|path| is_result(path)).count()
        {
            // Killed between the last frame and the record, which tells what only a frame of its own run knows: that
            // frame is made again.
            finished.pop();
        }
        super::done(&folder, &commands[next]);
        let after = assert_whole(&out, &Files::new());
        assert!(after.keys().eq(like[next].keys()), "{}: {:?}", commands[next], after.keys());
        for (path, bytes) in after.iter().filter(|(path, _)| is_result(path)) {
            assert!(like[next].get(path) == Some(bytes), "{}: another {}", commands[next], path.display());
        }
        for (name, changed) in finished.into_iter().flatten() {
            let now = fs::metadata(out.join(&name)).and_then(|about| about.modified()).expect("a file");
            assert_eq!(now, changed, "{} was made again", name.display());
        }
        let left = files_below(&out).into_iter().map(|(path, _)| path).find(|path| is_unfinished(path));
        assert_eq!(left, None, "{} left something", commands[next]);
    }
    println!("{kills} kills, {in_the_middle} of them in the middle; {went_on} runs went on from a journal");
}
