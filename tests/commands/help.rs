//! The help, what completes a command line, and what is said about one that was nearly right.

use super::{BINARY, assert_wrong_arguments, done, run};
use std::fs;
use std::path::Path;
use std::process::Command;
use viewfuse_tests::command::{self, names_in, toy};
use viewfuse_tests::scenes::Folder;

viewfuse_tests::trials![
    the_short_help_has_what_is_needed_first, what_was_nearly_written_is_suggested, commands_of_the_laboratory_are_told,
    shells_complete_and_pages_tell,
];

/// The long options that a help lists.
fn options(help: &str) -> Vec<&str> {
    let words = help.lines().filter_map(|line| {
        let line = line.trim_start();
        let line = line
            .get(..2)
            .filter(|start| start.starts_with('-') && *start != "--")
            .map_or(line, |_| line[3..].trim_start());
        line.strip_prefix("--")?.split([' ', ',', '.']).next()
    });
    words.collect()
}

fn the_short_help_has_what_is_needed_first() {
    let here = Path::new(".");
    for (command, most) in [("render", 14), ("view", 12), ("evaluate", 16)] {
        let [short, long] = ["-h", "--help"].map(|help| done(here, &format!("{command} {help}")));
        let [first, all] = [&short, &long].map(|help| options(help));
        assert!((8..=most).contains(&first.len()), "{command}: {first:?}");
        assert!(all.len() > 2 * first.len() && first.iter().all(|option| all.contains(option)), "{command}: {all:?}");
        assert!(
            first.contains(&"weights") && !first.contains(&"probe-step") && all.contains(&"probe-step"),
            "{command}"
        );
        assert!(short.lines().count() < 80, "{command}: {} lines", short.lines().count());
        for heading in ["Efforts", "Options of networks", "Options of PixelNeRF", "Options of GeNVS"] {
            assert!(long.contains(heading), "{command}: {heading}");
        }
    }
}

fn what_was_nearly_written_is_suggested() {
    let folder = toy();
    let weights = |scheme: &str, parts: &[&str]| {
        assert_wrong_arguments(&folder, &format!("render toy --targets 20 -o out --weights {scheme}"), parts);
    };
    weights(
        "eror:alpha=1",
        &["unknown weighting scheme 'eror'", "the nearest is 'error'", "auto (the best for the scene)"],
    );
    weights("atuo", &["the nearest is 'auto'"]);
    weights("qqqqqqqq", &["unknown weighting scheme 'qqqqqqqq'; there are: auto"]);
    for (arguments, meant) in
        [("rendr toy", "render"), ("inspct toy", "inspect"), ("render toy --wieghts mean", "--weights")]
    {
        let outcome = run(&folder, arguments);
        assert!(outcome.code == Some(2) && outcome.stderr.contains(meant), "{}", outcome.stderr);
    }
}

fn commands_of_the_laboratory_are_told() {
    let folder = Folder::new();
    for name in ["train", "scenes", "report"] {
        for rest in ["", " --help", " learn/cars -o out --steps 5"] {
            let line = format!("`cargo run --release -p viewfuse-lab -- {name}`");
            command::assert_wrong_arguments(BINARY, &folder, &format!("{name}{rest}"), &[&line]);
        }
    }
    let outcome = run(&folder, "trane");
    assert!(outcome.code == Some(2) && !outcome.stderr.contains("viewfuse-lab"), "{}", outcome.stderr);
}

fn shells_complete_and_pages_tell() {
    let folder = Folder::new();
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = done(&folder, &format!("completions {shell}"));
        assert!(script.contains("camera-path") && script.contains("evaluate"), "{shell}");
        done(&folder, &format!("completions {shell} -o scripts/{shell}"));
        assert_eq!(fs::read_to_string(folder.join("scripts").join(shell)).expect("a script"), script);
    }
    // What bash offers behind `viewfuse render --orb`.
    let ask = "source scripts/bash; COMP_WORDS=(viewfuse render --orb); COMP_CWORD=2; _viewfuse viewfuse --orb render; \
        echo ${COMPREPLY[@]}";
    if let Ok(answer) = Command::new("bash").args(["-c", ask]).current_dir(&folder).output() {
        assert_eq!(
            String::from_utf8_lossy(&answer.stdout).trim(),
            "--orbit",
            "{}",
            String::from_utf8_lossy(&answer.stderr)
        );
    }
    done(&folder, "completions man -o pages");
    let pages = names_in(&folder.join("pages"));
    assert!(pages.len() > 15 && pages.contains(&"viewfuse.1".to_owned()), "{pages:?}");
    let page = fs::read_to_string(folder.join("pages/viewfuse-render.1")).expect("a page");
    assert!(
        page.contains(".TH") && page.contains("camera\\-path") && page.contains("viewfuse render photos/"),
        "{page}"
    );
    assert!(done(&folder, "completions man").contains(".TH viewfuse"));
    // What an earlier version wrote is replaced, what somebody else wrote stays.
    done(&folder, "completions bash -o scripts/bash");
    done(&folder, "completions man -o pages");
    folder.write("profile", "source <(viewfuse completions bash)\n").write("other/viewfuse-render.1", "notes\n");
    for others in ["bash -o profile", "zsh -o scripts/bash", "fish -o other/viewfuse-render.1", "man -o other"] {
        assert_wrong_arguments(&folder, &format!("completions {others}"), &["would be replaced"]);
    }
}
