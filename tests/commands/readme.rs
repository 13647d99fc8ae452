//! The README's commands are run as they stand there, and its claims about itself hold.

use std::process::Command;
use viewfuse_tests::places::repository;

fn readme() -> String {
    std::fs::read_to_string(repository().join("README.md")).expect("the README")
}

/// The lines of all `sh` blocks.
fn commands() -> Vec<String> {
    let mut inside = false;
    let mut commands = Vec::new();
    for line in readme().lines() {
        match line {
            "```sh" => inside = true,
            "```" => inside = false,
            _ if inside => commands.push(line.to_owned()),
            _ => {}
        }
    }
    commands
}

#[test]
fn every_command_runs() {
    const PREFIX: &str = "cargo run --release -- ";
    let folder = tempfile::tempdir().expect("a folder");
    let ours: Vec<String> = commands().iter().filter_map(|line| Some(line.strip_prefix(PREFIX)?.to_owned())).collect();
    assert!(ours.len() >= 5, "{ours:?}");
    for command in ours {
        let out = folder.path().join("out").display().to_string();
        let arguments: Vec<String> =
            command
                .split_whitespace()
                .map(|word| {
                    if word == "out" || word.starts_with("out/") { word.replacen("out", &out, 1) } else { word.into() }
                })
                .collect();
        let output = Command::new(env!("CARGO_BIN_EXE_viewfuse"))
            .args(&arguments)
            .current_dir(repository())
            .output()
            .expect("the command starts");
        assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    }
    let pictures = ["000048.png", "000048_depth.png", "000048_sheet.png", "run.json", "toy/000021.png"];
    for file in pictures.into_iter().chain(["cameras.png", "scores.csv", "weighting/model.safetensors", "report.html"])
    {
        assert!(folder.path().join("out").join(file).exists(), "{file}");
    }
}

#[test]
fn the_test_command_is_the_one_that_ci_runs() {
    let test = "tests/run";
    assert!(commands().iter().any(|line| line == test), "{test} is not in the README");
    assert!(repository().join(test).is_file(), "{test}");
    let ci = std::fs::read_to_string(repository().join(".ci/run")).expect("the CI script");
    // CI asks for more by environment variables, which the README explains.
    let runs_it = |line: &&str| line.split_whitespace().find(|word| !word.contains('=')) == Some(test);
    let line = ci.lines().find(runs_it).expect("CI runs it");
    let readme = readme();
    for variable in line.split_whitespace().filter_map(|word| word.split_once('=')) {
        assert!(readme.contains(&format!("{}={}", variable.0, variable.1)), "{variable:?}");
    }
}

#[test]
fn what_it_links_to_is_there() {
    let text = readme();
    let links: Vec<&str> = text.split("](").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    assert!(!links.is_empty());
    // Within the page: what a heading is called there.
    let headings: Vec<String> = text
        .lines()
        .filter_map(|line| {
            Some(line.trim_start_matches('#').trim().to_lowercase().replace(' ', "-")).filter(|_| line.starts_with('#'))
        })
        .collect();
    let (inside, links): (Vec<&str>, Vec<&str>) = links.into_iter().partition(|link| link.starts_with('#'));
    for link in inside {
        assert!(headings.iter().any(|heading| *heading == link[1..]), "{link}");
    }
    for link in links {
        assert!(repository().join(link).exists(), "{link}");
    }
}

#[test]
fn core_depends_on_mathematics_only() {
    let tree = |extra: &[&str]| {
        let output = Command::new(env!("CARGO"))
            .args([
                "tree",
                "--offline",
                "--locked",
                "-p",
                "viewfuse-core",
                "-e",
                "normal,no-proc-macro",
                "--prefix",
                "none",
            ])
            .args(extra)
            .current_dir(repository())
            .output()
            .expect("cargo");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).expect("text")
    };
    let packages = tree(&[]);
    let names: Vec<&str> = packages.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert!(names.contains(&"glam") && names.contains(&"libm"), "{names:?}");
    assert!(names.iter().all(|name| ["viewfuse-core", "glam", "libm", "bytemuck"].contains(name)), "{names:?}");
    let features = tree(&["-f", "{p} {f}"]);
    let has_std = features.lines().any(|line| {
        line.rsplit(' ').next().is_some_and(|features| features.split(',').any(|feature| feature == "std"))
    });
    assert!(!has_std, "{features}");
}
