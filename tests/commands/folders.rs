//! Output folders that hold something already: a person's own files, an earlier run, a run that is not finished yet.

use super::{assert_refused, command, done, killed_when, list_of, read_json, run, text_of};
use serde_json::Value;
use std::fs;
use std::path::Path;
use viewfuse_tests::command::{files_below, names_in, toy, unheard};
use viewfuse_tests::patience::{end, send, wait_while_running};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    a_file_with_the_name_of_a_journal_is_left_alone,
    #[cfg(unix)]
    links_pipes_and_devices_are_no_journals,
    a_journal_that_was_cut_anywhere_is_continued,
    two_runs_do_not_mix_in_one_folder,
    an_earlier_run_is_replaced_as_a_whole_or_not_at_all,
    a_target_is_added_to_a_run_of_the_same_settings,
    what_is_found_of_the_sources_is_kept_where_asked,
];

const RENDER: &str =
    "render toy --targets 20 --sources 0..3 --size 24x24 --device cpu --weights mean --no-sheets -o out";
const EVALUATE: &str =
    "evaluate toy --protocol random:sources=2 --targets-per-trial 1 --weights mean --size 24x24 --device cpu -o out";

/// What reads and writes which journal.
const JOURNALS: [(&str, &str); 2] = [(RENDER, "frames.jsonl"), (EVALUATE, "scores-0-of-1.jsonl")];

fn a_file_with_the_name_of_a_journal_is_left_alone() {
    for (arguments, name) in JOURNALS {
        let folder = toy();
        let path = format!("out/{name}");
        for text in [
            "my notes\n", "my notes", "{\"frame\": 1}\n", "{\"job\": \"all\"}\n", "{\"jo", "\n",
            "[1, 2]\n{\"run\":\"a\"}\n",
        ] {
            // The beginning of a line of its own is what a kill leaves.
            if name.starts_with("scores") && text == "{\"jo" {
                continue;
            }
            folder.write(&path, text);
            assert_refused(&folder, arguments, &[name]);
            assert_eq!(fs::read_to_string(folder.join(&path)).expect("a file"), text);
        }
        fs::remove_file(folder.join(&path)).expect("removed");
        done(&folder, arguments);
    }
    // A run that keeps no journal removes one of an earlier run, and nothing else.
    let folder = toy();
    let sequence = "render toy --targets 20,21 --sources 0..2 --size 16x16 --model genvs:small --steps 2 --samples 8 \
        --reuse 1 --device cpu -o out";
    folder.write("out/frames.jsonl", "my notes\n");
    assert_refused(&folder, sequence, &["frames.jsonl"]);
    assert_eq!(fs::read(folder.join("out/frames.jsonl")).expect("a file"), b"my notes\n");
}

#[cfg(unix)]
fn links_pipes_and_devices_are_no_journals() {
    use std::os::unix::fs::symlink;
    for (arguments, name) in JOURNALS {
        let folder = toy();
        let precious = folder.join("precious.jsonl");
        // What a run of this program would cut.
        fs::write(&precious, "{\"run\":\"another\"}\n{\"job\":").expect("a file");
        fs::create_dir(folder.join("out")).expect("a folder");
        let path = folder.join("out").join(name);
        for target in [precious.as_path(), Path::new("/dev/zero"), Path::new("nowhere")] {
            symlink(target, &path).expect("a link");
            assert_refused(&folder, arguments, &[name, "it is a link"]);
            fs::remove_file(&path).expect("removed");
        }
        assert_eq!(fs::read(&precious).expect("a file"), b"{\"run\":\"another\"}\n{\"job\":");
        let made = std::process::Command::new("mkfifo").arg(&path).status().expect("mkfifo runs");
        assert!(made.success());
        assert_refused(&folder, arguments, &[name, "no ordinary file"]);
        // Zeros without end, as a file that takes no room on the disk.
        fs::remove_file(&path).expect("removed");
        fs::File::create(&path).expect("a file").set_len(3 << 30).expect("a sparse file");
        assert_refused(&folder, arguments, &[name]);
    }
}

/// A kill may cut a journal in the middle of its first line.
fn a_journal_that_was_cut_anywhere_is_continued() {
    let folder = toy();
    done(&folder, RENDER);
    let expected = files_below(&folder.join("out"));
    for text in ["", "{", "{\"run\"", "{\"run\":\"", "{\"run\":\"0123"] {
        folder.write("out/frames.jsonl", text);
        done(&folder, RENDER);
        let names: Vec<_> = files_below(&folder.join("out")).into_iter().map(|(path, _)| path).collect();
        assert_eq!(names, expected.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>(), "{text:?}");
    }
}

fn two_runs_do_not_mix_in_one_folder() {
    let folder = toy();
    let long = "render toy --orbit 2000 --size 24x24 --device cpu --weights mean --no-sheets -o out";
    let mut first = unheard(command(&folder, long));
    wait_while_running(&mut first, || folder.join("out/orbit-000.png").exists());
    // The same run, and another one; what the first one writes meanwhile is its own.
    for arguments in [long, RENDER, &format!("{RENDER} --replace")] {
        let second = command(&folder, arguments).output().expect("the command starts");
        let said = String::from_utf8_lossy(&second.stderr).into_owned();
        assert_eq!(second.status.code(), Some(1), "{said}");
        assert!(
            said.contains("out") && (said.contains("another process is writing") || said.contains("earlier run")),
            "{said}"
        );
    }
    assert!(!folder.join("out/000020.png").exists());
    send("-INT", &first);
    assert_eq!(end(&mut first).expect("it ends").code(), Some(130));
    // Whoever was interrupted holds the folder no longer.
    done(&folder, &format!("{RENDER} --replace"));
    // Exports appear as a whole: of two, one.
    let both = [(); 2].map(|()| unheard(command(&folder, "export toy --layout colmap -o exported")));
    let codes = both.map(|mut export| end(&mut export).expect("it ends").code());
    assert!(codes.contains(&Some(0)), "{codes:?}");
    let alone = Folder::new();
    done(&folder, &format!("export toy --layout colmap -o {}", alone.join("exported").display()));
    let files = |folder: &Path| -> Vec<(String, u64)> {
        let named = |(path, length): (std::path::PathBuf, u64)| {
            (path.file_name().expect("a name").to_string_lossy().into_owned(), length)
        };
        files_below(&folder.join("exported")).into_iter().map(named).collect()
    };
    assert_eq!(files(&folder), files(&alone));
}

fn an_earlier_run_is_replaced_as_a_whole_or_not_at_all() {
    let folder = toy();
    let orbit = "render toy --orbit 4 --size 24x24 --device cpu --weights mean --video webp -o out";
    done(&folder, orbit);
    folder.write("out/notes.txt", "mine");
    assert_refused(&folder, RENDER, &["out: has 9 files of an earlier run", "orbit-000.png", "--replace"]);
    // The same targets replace it without a question.
    done(&folder, orbit);
    assert_eq!(names_in(&folder.join("out")).len(), 4 * 2 + 3);
    done(&folder, &format!("{RENDER} --replace"));
    let names = names_in(&folder.join("out"));
    assert_eq!(names, ["000020.png", "000020_depth.png", "notes.txt", "run.json"]);
    // A record that names files elsewhere removes none.
    let record = fs::read_to_string(folder.join("out/run.json")).expect("a record");
    folder.write("elsewhere.png", "mine");
    folder.write("out/run.json", record.replace("\"target\": \"000020\"", "\"target\": \"../elsewhere\""));
    done(&folder, &format!("{} --replace", RENDER.replace("--targets 20", "--targets 21")));
    assert_eq!(fs::read_to_string(folder.join("elsewhere.png")).expect("a file"), "mine");
    assert_eq!(fs::read_to_string(folder.join("out/notes.txt")).expect("a file"), "mine");
}

/// The same settings are the same options and sources; what is there stays, whatever happens to the new run.
fn a_target_is_added_to_a_run_of_the_same_settings() {
    let folder = toy();
    let render = |more: &str, output: &str| {
        format!("render toy --sources 0..3 --size 24x24 --device cpu --weights mean --no-sheets {more} -o {output}")
    };
    let record = |output: &str| -> Value { read_json(folder.join(output).join("run.json")) };
    let targets = |record: &Value| -> Vec<String> {
        let frames = list_of(&record["frames"]);
        frames.iter().map(|frame| text_of(&frame["target"]).to_owned()).collect()
    };
    let pictures = |output: &str| {
        let is_picture = |name: &String| name.ends_with(".png");
        let names = names_in(&folder.join(output)).into_iter().filter(is_picture);
        names
            .map(|name| (name.clone(), fs::read(folder.join(output).join(name)).expect("a picture")))
            .collect::<Vec<_>>()
    };
    done(&folder, &render("--targets 20", "out"));
    let said = done(&folder, &render("--targets 21,22", "out"));
    assert!(said.contains("\nadded to 1 of an earlier run with the same settings and sources\n"), "{said}");
    done(&folder, &render("--targets 20,21,22", "whole"));
    assert!(pictures("out") == pictures("whole"), "other pictures than those of one run");
    let (added, whole) = (record("out"), record("whole"));
    assert_eq!((&added["earlier"], &whole["earlier"]), (&1.into(), &0.into()));
    assert_eq!((targets(&added), &added["settings"]), (targets(&whole), &whole["settings"]));
    for (here, other) in list_of(&added["frames"]).iter().zip(list_of(&whole["frames"])) {
        for key in ["world_from_camera", "weights", "psnr"] {
            assert_eq!(here[key].to_string().get(..8), other[key].to_string().get(..8), "{key}");
        }
    }
    // One of them again: the others stay.
    done(&folder, &render("--targets 20", "out"));
    assert_eq!(targets(&record("out")), ["000021", "000022", "000020"]);
    assert!(pictures("out") == pictures("whole"));

    for (arguments, reason) in [
        (render("--targets 23 --seed 1", "out"), "their settings were others"),
        (render("--targets 23", "out").replace("--no-sheets", ""), "their settings were others"),
        (render("--targets 23", "out").replace("0..3", "0..4"), "their sources were others"),
        (render("--targets 2", "out"), "a source"),
        (render("--targets 23 --video webp", "out"), "a video is of all pictures of one run"),
    ] {
        assert_refused(&folder, &arguments, &[reason]);
    }
    // A run that is killed while it adds loses nothing; only it may go on.
    killed_when(&folder, &render("--orbit 800", "out"), || folder.join("out/orbit-002.png").exists());
    assert_eq!(targets(&record("out")), ["000021", "000022", "000020"]);
    assert_refused(&folder, &render("--targets 23", "out"), &["another run was interrupted there"]);
    assert!(whole_of(&pictures("whole"), &pictures("out")), "a picture is lost");
    // It may warn of what the sources do not show.
    let rendered = |arguments: &str| assert_eq!(run(&folder, arguments).code, Some(0), "{arguments}");
    rendered(&render("--orbit 3", "other"));
    done(&folder, &render("--targets 20", "other"));
    // Fewer cameras of the same names are elsewhere.
    assert_refused(&folder, &render("--orbit 2", "other"), &["cameras of the same names were elsewhere"]);
    // A path that is whole is replaced, beside what stays.
    rendered(&render("--orbit 3", "other"));
    assert_eq!(targets(&record("other")), ["000020", "orbit-000", "orbit-001", "orbit-002"]);
}

/// Whether all of these are among others.
fn whole_of(all: &[(String, Vec<u8>)], others: &[(String, Vec<u8>)]) -> bool {
    all.iter().all(|file| others.contains(file))
}

/// `--cache` without `--model`: the default field has options, too.
fn what_is_found_of_the_sources_is_kept_where_asked() {
    let folder = Folder::new();
    let scene = viewfuse_tests::places::data("room");
    let render = |output: &str, more: &str| {
        let arguments = "--targets 002 --sources 003..005 --size 48x36 --weights mean --no-sheets --device cpu";
        done(&folder, &format!("render {} {arguments} {more} -o {output}", scene.display()));
        fs::read(folder.join(output).join("002.png")).expect("a picture")
    };
    let plain = render("plain", "");
    let first = render("first", "--cache kept");
    let kept = files_below(&folder.join("kept"));
    assert!(kept.len() >= 3, "{kept:?}");
    let second = render("second", "--cache kept");
    assert!(plain == first && first == second, "another picture");
    assert_eq!(files_below(&folder.join("kept")), kept);
}
