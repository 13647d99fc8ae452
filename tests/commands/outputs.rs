//! Outputs that would replace something else: refused before work begins, with everything as it was.

use super::{assert_refused, assert_wrong_arguments, done, run};
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_tests::command::{names_in, toy};
use viewfuse_tests::scenes::{Folder, middlebury};

viewfuse_tests::trials![
    pictures_do_not_replace_photographs,
    files_do_not_replace_lists,
    tables_do_not_replace_those_of_others,
    an_evaluation_keeps_its_record,
    names_that_meet_in_a_file,
    inputs_are_not_replaced,
    no_option_names_both_an_input_and_an_output,
    files_of_a_person_are_no_pictures_of_a_run,
    a_record_lists_what_its_run_wrote,
    #[cfg(unix)]
    links_to_nothing_are_noticed_first,
    what_a_kill_left_is_removed,
    #[cfg(target_os = "linux")]
    names_that_no_file_has_are_noticed_first,
    files_are_no_folders_of_pictures,
];

const RENDER: &str = "render toy --targets 20 --size 16x16 --device cpu";
const EVALUATE: &str = "evaluate toy --targets 20 --weights mean --size 16x16 --device cpu";

/// Every file below a folder with its content.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let files = viewfuse_tests::command::files_below(folder).into_iter().map(|(path, _)| path);
    files.filter(|path| path.is_file()).map(|path| (path.clone(), fs::read(&path).expect("a file"))).collect()
}

/// The arguments are wrong, and every file is what it was.
#[track_caller]
fn assert_kept(folder: &Folder, arguments: &str, parts: &[&str]) {
    let before = contents(folder);
    assert_wrong_arguments(folder, arguments, parts);
    assert_eq!(contents(folder), before, "viewfuse {arguments} changed a file");
}

fn pictures_do_not_replace_photographs() {
    let folder = toy();
    for out in ["toy/rgb", "toy", "./toy/../toy/rgb/", "toy/pose", "toy/images", "toy/images_8/new", "toy/masks"] {
        assert_kept(&folder, &format!("{RENDER} -o {out}"), &["the scene toy is read from this folder"]);
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("toy/rgb", folder.join("elsewhere")).expect("a link");
        assert_kept(&folder, &format!("{RENDER} -o elsewhere"), &["elsewhere", "the scene toy is read from"]);
    }
    for command in [
        "pareto toy --targets 20 --views 3 --size 16x16 --repeat 1 --device cpu",
        "export toy --layout transforms",
        "evaluate toy --protocol random --weights mean --size 16x16 --device cpu",
    ] {
        assert_kept(&folder, &format!("{command} -o toy/rgb"), &["toy/rgb", "is read from this folder"]);
    }
    // Photographs that lie in the scene's own folder.
    let flat = middlebury();
    let before = contents(&flat);
    assert_wrong_arguments(&flat, "render . --targets toy0001 -o .", &["is read from this folder"]);
    assert_eq!(contents(&flat), before);
    // A folder of one's own in the scene's stays possible, also a second time.
    for _ in 0..2 {
        done(&folder, &format!("{RENDER} -o toy/out"));
    }
    assert!(folder.join("toy/out/000020.png").is_file());
    assert!(done(&folder, "inspect toy").contains("24 photographs"));
}

fn files_do_not_replace_lists() {
    let folder = toy();
    for out in ["toy/intrinsics.txt", "toy/rgb/000003.png", "toy/rgb/new.png"] {
        assert_kept(&folder, &format!("inspect toy -o {out}"), &[out, "is read from this file"]);
        assert_kept(&folder, &format!("{EVALUATE} -o {out}"), &[out, "is read from this file"]);
    }
    for _ in 0..2 {
        done(&folder, "inspect toy -o toy/cameras.png");
    }
}

fn tables_do_not_replace_those_of_others() {
    let folder = toy();
    let pareto = "pareto toy --targets 20 --views 3 --size 16x16 --repeat 1 --only exact --device cpu";
    let evaluate = "evaluate toy --protocol random --weights mean --size 16x16 --device cpu";
    let files = [("pareto.csv", pareto), ("pareto.svg", pareto), ("pareto.json", pareto), ("scores.csv", evaluate)];
    for (place, (name, command)) in files.into_iter().enumerate() {
        folder.write(&format!("{place}/{name}"), "precious");
        let parts = [name, "was not written by viewfuse"];
        assert_kept(&folder, &format!("{command} -o {place}"), &parts);
        // Their own they replace.
        for _ in 0..2 {
            done(&folder, &format!("{command} -o own{place}"));
        }
    }
}

fn an_evaluation_keeps_its_record() {
    let folder = toy();
    let run = "evaluate toy --protocol random --trials 2 --weights mean --size 16x16 --device cpu -o out";
    done(&folder, run);
    let before = contents(&folder);
    let parts = ["out/run.json: is not the record of a render", "another folder"];
    assert_refused(&folder, &format!("{RENDER} -o out"), &parts);
    assert_eq!(contents(&folder), before);
    assert!(done(&folder, run).contains("0 jobs done; 2 of 2"), "it goes on");
    // Nor is the record of a render taken for that of an evaluation.
    done(&folder, &format!("{RENDER} -o pictures"));
    let before = contents(&folder);
    assert_refused(&folder, &run.replace("-o out", "-o pictures"), &["pictures/run.json"]);
    assert_eq!(contents(&folder), before);
}

fn names_that_meet_in_a_file() {
    let scene = toy();
    for (kind, ending) in [("rgb", "png"), ("pose", "txt")] {
        for (from, to) in [("000020", "x"), ("000021", "x_depth"), ("000022", "y_sheet"), ("000023", "y_confidence")] {
            let name = |name: &str| scene.join(format!("toy/{kind}/{name}.{ending}"));
            fs::rename(name(from), name(to)).expect("another name");
        }
    }
    let small = "--size 16x16 --device cpu -o out";
    let parts = ["'x'", "'x_depth'", "x_depth.png", "different folders"];
    assert_refused(&scene, &format!("render toy --targets x,x_depth {small}"), &parts);
    done(&scene, &format!("render toy --targets x,y_sheet {small}"));
    assert!(names_in(&scene.join("out")).contains(&"y_sheet_sheet.png".to_owned()));
}

fn inputs_are_not_replaced() {
    let folder = toy();
    let checkpoint = viewfuse_tests::places::data("pixelnerf_small.safetensors");
    fs::copy(checkpoint, folder.file("runs/model.safetensors")).expect("a copy");
    let model = "runs/model.safetensors";
    assert_kept(&folder, &format!("convert {model} ./{model} --half"), &["is the input", "another name"]);
    folder.write("cars_train/a/intrinsics.txt", "").write("cars_val/a/intrinsics.txt", "");
    let parts = ["runs/model.safetensors", "is the input"];
    assert_kept(&folder, &format!("train weighting {model} cars -o runs"), &parts);
    assert_kept(&folder, &format!("train pixelnerf cars --from {model} -o runs"), &parts);
    done(&folder, "evaluate toy --protocol random --weights mean --size 16x16 --device cpu -o out");
    assert_kept(&folder, "report out -o out/run.json", &["out/run.json", "a page is written", "run.html"]);
    folder.write("mine.html", "<p>My own page.");
    assert_kept(&folder, "report out -o mine.html", &["mine.html", "was not written by viewfuse"]);
    for _ in 0..2 {
        done(&folder, "report out -o out/page.html");
        done(&folder, "inspect toy -o map.png");
        done(&folder, "evaluate toy --targets 20 --views 3 --weights mean --size 16x16 --device cpu -o scores.csv");
    }
    // Pictures and tables that others wrote stay.
    fs::copy(folder.join("toy/rgb/000020.png"), folder.file("mine.png")).expect("a copy");
    folder.write("mine.csv", "name,grade\na,1\n");
    for arguments in ["inspect toy -o mine.png", "evaluate toy --targets 20 --size 16x16 -o mine.csv"] {
        assert_kept(&folder, arguments, &["mine.", "was not written by viewfuse"]);
    }
}

/// Whichever options they are, and however the path is written.
fn no_option_names_both_an_input_and_an_output() {
    let folder = toy();
    folder.write("p.csv", "x,y,z,look_x,look_y,look_z\n0.1,0.2,1.3,0,0,0\n");
    let checkpoint = viewfuse_tests::places::data("pixelnerf_small.safetensors");
    fs::copy(checkpoint, folder.file("m.safetensors")).expect("a copy");
    fs::copy(viewfuse_tests::places::data("attention.safetensors"), folder.file("a.ply")).expect("a copy");
    for (arguments, input) in [
        ("weights toy --camera-path p.csv --npy p.csv", "p.csv"),
        ("weights toy --camera-path p.csv --npy ./toy/../p.csv", "p.csv"),
        ("select toy --count 3 --camera-path p.csv -o p.csv", "p.csv"),
        ("evaluate toy --targets 20 --model m.safetensors -o m.safetensors", "m.safetensors"),
        ("evaluate toy --targets 20 --lpips alex=x.pth,heads=p.csv -o p.csv", "p.csv"),
        ("select toy --count 3 --targets 20 --weights attention:m.safetensors -o m.safetensors", "m.safetensors"),
        ("evaluate toy --targets 20 --weights mine=attention:p.csv -o p.csv", "p.csv"),
        ("optimise toy --weights attention:a.ply --size 16x16 -o a.ply", "a.ply"),
        ("optimise toy --resume a.ply --size 16x16 -o toy/../a.ply", "a.ply"),
        ("points toy --weights attention:a.ply --size 16x16 -o a.ply", "a.ply"),
    ] {
        assert_kept(&folder, arguments, &[input, "is the input", "another name"]);
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("p.csv", folder.join("link.csv")).expect("a link");
        assert_kept(&folder, "weights toy --camera-path p.csv --npy link.csv", &["link.csv: is the input p.csv"]);
    }
    // The same name elsewhere is another file.
    done(&folder, "weights toy --camera-path p.csv --npy toy/p.csv");
}

/// A folder without a record, and one whose record names other targets.
fn files_of_a_person_are_no_pictures_of_a_run() {
    let folder = toy();
    for mine in ["000020.png", "000020_depth.npy", "000020_sheet.png", "video.gif"] {
        let file = format!("out-{mine}/{mine}");
        folder.write(&file, "mine");
        let out = format!("out-{mine}");
        let parts = [&*file, "no earlier run wrote this file", "another folder"];
        assert_refused(&folder, &format!("{RENDER} --video gif -o {out}"), &parts);
        assert_refused(&folder, &format!("{RENDER} --video gif --replace -o {out}"), &parts);
        done(&folder, &format!("{} --video gif -o {out}-b", RENDER.replace("20", "21")));
        folder.write(&format!("{out}-b/000020.png"), "mine");
        let parts = ["000020.png", "no earlier run wrote this file"];
        assert_refused(&folder, &format!("{RENDER} -o {out}-b"), &parts);
        assert_eq!(fs::read(folder.join(file)).expect("it stays"), b"mine");
    }
    // What a run wrote is replaced by the next one.
    for _ in 0..2 {
        done(&folder, &format!("{RENDER} --video gif -o again"));
    }
}

/// Beside the pictures of a run a person's own video, and depths of another program.
fn a_record_lists_what_its_run_wrote() {
    let folder = toy();
    let run_in =
        |more: &str| format!("render toy --targets 20,21 --size 16x16 --device cpu --pictures-only -o out {more}");
    super::done_with_warnings(&folder, &run_in("--weights mean"));
    for own in ["out/video.webp", "out/000020_depth.npy"] {
        folder.write(own, "mine");
        assert_refused(&folder, &run_in("--weights mean --video webp"), &[own]);
        assert_refused(&folder, &run_in("--weights mean --video webp --replace"), &[own]);
        assert_eq!(fs::read(folder.join(own)).expect("a file"), b"mine");
        folder.remove(own);
    }
    folder.write("out/video.mp4", "mine");
    super::done_with_warnings(&folder, &run_in("--weights distance --video webp --replace"));
    assert_eq!(fs::read(folder.join("out/video.mp4")).expect("a file"), b"mine");
    // Its own video goes with it.
    let record = super::read_json(folder.join("out/run.json"));
    assert_eq!(record["videos"], serde_json::json!(["video.webp"]));
    super::done_with_warnings(&folder, &run_in("--weights error --replace"));
    assert!(!folder.join("out/video.webp").exists() && folder.join("out/video.mp4").exists());
}

#[cfg(unix)]
fn links_to_nothing_are_noticed_first() {
    use std::os::unix::fs::symlink;
    let folder = toy();
    symlink("nowhere/at/all", folder.join("out")).expect("a link");
    for arguments in [
        format!("{RENDER} -o out"),
        format!("{EVALUATE} -o out"),
        "inspect toy -o out".to_owned(),
        "report toy -o out".to_owned(),
        "convert toy/rgb/000000.png out/a.safetensors".to_owned(),
        "train pixelnerf cars -o out".to_owned(),
    ] {
        assert_refused(&folder, &arguments, &["cannot be written: out is a link to nothing"]);
    }
}

fn what_a_kill_left_is_removed() {
    let folder = toy();
    for left in [
        "out/.viewfuse-unfinished-aB3xYz",
        "learn/.viewfuse-unfinished-000001/rgb/0.png",
        "learn/.viewfuse-unfinished-000002/x",
    ] {
        folder.write(left, "half of a file");
    }
    // Of other programs, and of people.
    for other in ["out/.viewfuse-backup", "out/.hidden", "learn/.unfinished-drafts/x"] {
        folder.write(other, "whole");
    }
    done(&folder, &format!("{RENDER} -o out"));
    let hidden = |name: &str| {
        let names = names_in(&folder.join(name));
        names.into_iter().filter(|name| name.starts_with('.')).collect::<Vec<_>>()
    };
    assert_eq!(hidden("out"), [".hidden", ".viewfuse-backup"]);
    done(&folder, "export toy --layout transforms -o learn/toy");
    assert_eq!(hidden("learn"), [".unfinished-drafts"]);
    // What another process still writes stays.
    let path = folder.join("out/.viewfuse-unfinished-busyyy");
    let busy = fs::File::create(&path).expect("a file");
    busy.lock().expect("a lock");
    done(&folder, &format!("{RENDER} -o out"));
    assert!(path.exists());
    busy.unlock().expect("unlocked");
    done(&folder, &format!("{RENDER} -o out"));
    assert!(!path.exists());
}

/// Nothing is printed: the work has not begun.
#[cfg(target_os = "linux")]
fn names_that_no_file_has_are_noticed_first() {
    let folder = toy();
    let long = "x".repeat(300);
    for arguments in [
        format!("{EVALUATE} -o {long}.csv"),
        format!("{RENDER} -o new/{long}"),
        format!("optimise toy --size 16x16 --device cpu -o {long}.ply"),
    ] {
        let refused = run(&folder, &arguments);
        assert_eq!((refused.code, refused.stdout.as_str()), (Some(1), ""), "{}", refused.stderr);
        assert!(
            refused.stderr.ends_with("cannot be written: File name too long (os error 36)\n"),
            "{}",
            refused.stderr
        );
        assert_eq!(names_in(&folder), ["toy"]);
    }
}

fn files_are_no_folders_of_pictures() {
    let folder = toy();
    for (name, way) in [
        ("clip.mp4", "--output clip --video mp4 writes clip/video.mp4"),
        ("new/clip.GIF", "--output new/clip --video gif writes new/clip/video.gif"),
        ("view.png", "--output view is one"),
    ] {
        let parts = [&format!("{name}: is the name of a file"), way];
        assert_kept(&folder, &format!("{RENDER} -o {name}"), &parts);
    }
    // A folder that is there is one, whatever its name is.
    fs::create_dir(folder.join("old.gif")).expect("a folder");
    done(&folder, &format!("{RENDER} -o old.gif"));
}
