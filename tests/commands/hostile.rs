//! Input from somebody else, and a machine that is full or closed: no panic, no abort, nothing on the terminal but
//! text.

use super::{BINARY, assert_refused, binary, command, run};
use serde_json::json;
use std::fs::{self, OpenOptions};
use std::process::Stdio;
use viewfuse_tests::checkpoints::safetensors;
use viewfuse_tests::command::{Outcome, toy};

viewfuse_tests::trials![
    a_decoder_that_panics_is_an_error,
    nothing_controls_the_terminal,
    names_control_the_terminal_in_no_command,
    lists_that_are_no_lists_are_wrong_arguments,
    #[cfg(unix)]
    standard_error_may_be_full_or_closed,
    #[cfg(unix)]
    devices_without_an_end,
];

/// A palette of four bytes, with transparency: the decoder takes colours of three.
const PALETTE: &[u8] = include_bytes!("../data/fuzz/fell/images/palette.png");

fn a_decoder_that_panics_is_an_error() {
    let folder = toy();
    folder.write("palette.png", PALETTE);
    let parts = ["palette.png: not a readable image: the decoder panicked"];
    assert_refused(&folder, "compare palette.png toy/rgb/000000.png", &parts);
    assert_refused(&folder, "compare toy/rgb/000000.png palette.png", &parts);
    // The same as a mask, of the photograph's shape at another scale, which is read on all cores.
    for view in 0..24 {
        folder.write(&format!("toy/masks/{view:06}.png"), PALETTE);
    }
    let parts = ["toy/masks/0000", ".png: not a readable image: the decoder panicked"];
    assert_refused(&folder, "render toy --targets 20 --size 16x16 --device cpu -o out", &parts);
}

fn nothing_controls_the_terminal() {
    let folder = toy();
    let evil = "\u{1b}]0;owned\u{7}\u{1b}[31mred\u{9b}0m\u{202e}";
    let header = json!({"__metadata__": {evil: evil}, evil: {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}});
    folder.write("evil.safetensors", safetensors(&header.to_string(), &[0; 4]));
    assert_harmless(&run(&folder, "convert evil.safetensors out.safetensors"));
    // In the name of a scene, of a photograph whose pose is missing, and of nothing at all.
    let scene = "sc\u{1b}[2Jene";
    fs::rename(folder.join("toy"), folder.join(scene)).expect("a folder of that name");
    let inspect = |path: &str| {
        let mut inspect = command(&folder, "inspect");
        inspect.arg(path);
        Outcome::of(inspect)
    };
    assert_harmless(&inspect(scene));
    let rgb = folder.join(scene).join("rgb");
    fs::rename(rgb.join("000003.png"), rgb.join("\u{1b}]0;3.png")).expect("a file of that name");
    assert_harmless(&inspect(scene));
    assert_harmless(&inspect("no\u{1b}[2Jsuch\nscene"));
}

/// Commands that print names of scenes, views, targets, files or schemes, for the scene `SCENE`, whose view `VIEW`
/// and camera path have names of their own.
const NAMING: [&str; 24] = [
    "inspect SCENE --views",
    "inspect SCENE --json",
    "inspect SCENE -o NAME.png",
    "weights SCENE --targets VIEW",
    "weights SCENE --targets VIEW --json",
    "weights SCENE --targets VIEW --csv",
    "weights SCENE --targets VIEW --npy NAME.npy",
    "weights SCENE --camera-path PATH --csv",
    "weights SCENE --targets 3",
    "select SCENE --targets VIEW --count 3",
    "select SCENE --targets VIEW --count 3 -o NAME.txt",
    "points SCENE --sources 0,1,2 --size 16x16 --device cpu -o NAME.ply",
    "optimise SCENE --sources 0,1,2 --left-out VIEW --size 16x16 --iterations 2 --device cpu -o NAME.ply",
    "render SCENE --targets VIEW --sources 0,1,2 --size 16x16 --device cpu -o NAME",
    "render SCENE --camera-path PATH --sources 0,1,2 --size 16x16 --device cpu -o path",
    "evaluate SCENE --targets VIEW --sources 0,1,2 --size 16x16 --weights mean --device cpu",
    "evaluate SCENE --targets VIEW --sources 0,1,2 --size 16x16 --weights mean --device cpu -o NAME.csv",
    "evaluate SCENE --protocol nearest:2 --targets VIEW --size 16x16 --weights mean --device cpu -o NAME-p",
    "pareto SCENE --targets VIEW --sources 0,1,2 --size 16x16 --repeat 1 --only exact --device cpu -o NAME-q",
    "export SCENE --layout srn -o NAME-srn",
    "pose SCENE -o NAME-posed",
    "compare NAME.png NAME.png",
    "convert NAME out.safetensors",
    "verify NAME --device cpu",
];

/// No name reaches the terminal as it is: neither in what a command says nor in its progress, each change of which is
/// a line here.
fn names_control_the_terminal_in_no_command() {
    let folder = toy();
    let (scene, name) = ("sc\u{1b}[2Jene", "v\u{1b}]0;owned\u{7}\u{9b}31m\u{202e}w");
    let toy = folder.join("toy");
    for (file, extension) in [("rgb", "png"), ("pose", "txt")] {
        let to = toy.join(file).join(format!("{name}.{extension}"));
        fs::rename(toy.join(file).join(format!("000020.{extension}")), to).expect("a file of that name");
    }
    fs::rename(toy, folder.join(scene)).expect("a folder of that name");
    let path = format!("name,x,y,z,look_x,look_y,look_z\na{name},0.1,0.2,1.3,0,0,0\nb{name},0.2,0.1,1.3,0,0,0\n");
    folder.write(&format!("{name}-path.csv"), path);
    let (mut shown, mut failed) = (0, Vec::new());
    for arguments in NAMING {
        let mut command = command(&folder, "");
        let words = arguments.split_whitespace().map(|word| match word {
            "PATH" => format!("{name}-path.csv"),
            _ => word.replace("SCENE", scene).replace("NAME", name).replace("VIEW", name),
        });
        let outcome = command.args(words).env("VIEWFUSE_PROGRESS", "0").output().expect("it starts");
        let said = String::from_utf8([outcome.stdout, outcome.stderr].concat()).expect("text");
        let controls = |letter: char| !"\n\t".contains(letter) && (letter.is_control() || letter == '\u{202e}');
        assert!(!said.contains(controls), "{arguments}: {said:?}");
        shown += said.matches("\\u001b").count();
        if !outcome.status.success() {
            failed.push((arguments, said));
        }
    }
    // Those that have nothing to do: a message is a message.
    let refused = ["pose", "convert", "verify"];
    let is_refused = |arguments: &str| refused.iter().any(|words| arguments.contains(words));
    assert!(failed.iter().all(|(arguments, _)| is_refused(arguments)), "{failed:#?}");
    assert!(shown > 60, "names are shown: {shown}");
}

#[track_caller]
fn assert_harmless(outcome: &Outcome) {
    let shown = format!("{}{}", outcome.stdout, outcome.stderr);
    assert!(shown.contains("\\u001b"), "the name is shown: {shown:?}");
    let controls = |character: char| character != '\n' && (character.is_control() || character == '\u{202e}');
    assert!(!shown.contains(controls), "{shown:?}");
}

fn lists_that_are_no_lists_are_wrong_arguments() {
    let folder = toy();
    for list in ["5..2", "all/0", "..3", "3..", "all/x"] {
        for arguments in [
            format!("weights toy --target {list}"),
            format!("evaluate toy --targets {list} --weights mean"),
            format!("render toy --targets {list} -o out"),
            format!("render toy --targets 20 --sources {list} -o out"),
            format!("evaluate toy --protocol nearest:2 --weights mean --targets {list}"),
        ] {
            let Outcome { code, stderr, .. } = run(&folder, &arguments);
            assert_eq!(code, Some(2), "{arguments}: {stderr}");
            assert!(stderr.contains(list) && stderr.lines().count() == 1, "{arguments}: {stderr}");
        }
    }
    let Outcome { code, stderr, .. } = run(&folder, "weights toy --target 20 --weights error:alpha=1,alpha=0");
    assert!(code == Some(2) && stderr.contains("alpha is given twice"), "{stderr}");
}

/// What is said there is lost; what is done and returned is not.
#[cfg(unix)]
fn standard_error_may_be_full_or_closed() {
    let folder = toy();
    // A warning: the photographs' borders are of several colours.
    folder.image("toy/rgb/000003.png", 128, 128);
    let warns = "render toy --targets 20 --size 16x16 --device cpu -o out";
    assert!(run(&folder, warns).stderr.contains("warning"), "it has something to say");
    for (arguments, code) in
        [(warns, 0), ("inspect nowhere", 1), ("inspect --nonsense", 2), ("render toy --targets 5..2 -o out", 2)]
    {
        let full = OpenOptions::new().write(true).open("/dev/full").expect("a full device");
        let mut run = command(&folder, arguments);
        let status = run.stdout(Stdio::null()).stderr(full).status().expect("it starts");
        assert_eq!(status.code(), Some(code), "{arguments} with a full standard error");
        // A pipe that nobody reads any more.
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let mut run = command(&folder, arguments);
        let status = run.stdout(Stdio::null()).stderr(writer).status().expect("it starts");
        assert_eq!(status.code(), Some(code), "{arguments} with a broken standard error");
        let mut shell = std::process::Command::new("sh");
        shell.current_dir(&folder).args(["-c", &format!("exec \"$0\" {arguments} >&- 2>&-"), BINARY]);
        assert_eq!(shell.status().expect("a shell").code(), Some(code), "{arguments} with closed outputs");
    }
}

/// `/dev/zero` has no end: what reads files reads a limited number of bytes.
#[cfg(unix)]
fn devices_without_an_end() {
    use std::os::unix::fs::symlink;
    let folder = toy();
    let zero = |name: &str| {
        let path = folder.file(name);
        let _ = fs::remove_file(&path);
        symlink("/dev/zero", path).expect("a link");
    };
    zero("zero");
    // Nor has a pipe that nobody writes to.
    let made = std::process::Command::new("mkfifo").arg(folder.join("pipe")).status().expect("mkfifo runs");
    assert!(made.success());
    zero("run/run.json");
    zero("json/transforms.json");
    zero("srn/intrinsics.txt");
    folder.image("srn/rgb/1.png", 16, 16).write("srn/pose/1.txt", "1");
    zero("llff/poses_bounds.npy");
    folder.image("llff/images/1.png", 16, 16);
    for arguments in [
        "verify zero --device cpu",
        "convert zero out.safetensors",
        "convert zero out.h",
        "compare zero zero --device cpu",
        "report run -o page.html",
        "report --pareto zero -o page.html",
        "weights toy --target 20 --weights attention:zero",
        "inspect json",
        "inspect srn",
        "inspect llff",
        "render toy --targets 20 --size 16x16 --model zero --device cpu -o out",
        "render toy --targets 20 --size 16x16 --model pipe --device cpu -o out",
        "convert pipe out.safetensors",
    ] {
        let mut limited = std::process::Command::new("sh");
        // Four GiB of addresses: more would be taken by a reader without a limit.
        let script = format!("ulimit -v 4194304; exec \"$0\" {arguments}");
        limited.current_dir(&folder).args(["-c", &script, binary(arguments)]);
        let Outcome { code, stderr, .. } = Outcome::of(limited);
        assert_eq!(code, Some(1), "{arguments}: {stderr}");
        assert!(stderr.starts_with("viewfuse: ") && stderr.lines().count() == 1, "{arguments}: {stderr}");
    }
}
