//! Makes results: each whole or not at all, and none that is up to date.

use crate::plan::{Folders, Row, State, Step};
use crate::repository;
use crate::stamp::{Stamp, Stamps, cpu_seconds, machine, today};
use anyhow::{Context, bail, ensure};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use viewfuse_job::files::write_whole;

/// Builds the command with all of its features, once.
const BUILD: [&str; 5] = ["build", "--release", "-p", "viewfuse-cli", "--all-features"];

/// Makes all rows that are not up to date and lack nothing. One that fails does not stop the others.
pub(crate) fn all(rows: &[Row], folders: &Folders) -> anyhow::Result<()> {
    std::fs::create_dir_all(&folders.out)?;
    std::fs::create_dir_all(&folders.work)?;
    let mut stamps = Stamps::read(&folders.out)?;
    let (mut made, mut failed, mut left_out, start) = (0, 0, 0, Instant::now());
    let mut command = folders.command.clone();
    for row in rows {
        if row.state(folders, &stamps)? == State::UpToDate {
            println!("{}: up to date", row.name);
            continue;
        }
        let lacks = row.lacks(folders);
        if !lacks.is_empty() {
            println!("{}: left out, it lacks {}", row.name, lacks.join("; "));
            left_out += 1;
            continue;
        }
        if command.is_none() {
            command = Some(build()?);
        }
        println!("{}: {} steps", row.name, row.steps.len());
        match result(row, folders, command.as_deref().unwrap_or(Path::new("viewfuse"))) {
            Ok(stamp) => {
                println!("{}: made in {:.1} s, {:.1} CPU seconds", row.name, stamp.wall_seconds, stamp.cpu_seconds);
                stamps.add(&folders.out, row.name, stamp)?;
                made += 1;
            }
            Err(error) => {
                eprintln!("{}: {error:#}", row.name);
                failed += 1;
            }
        }
    }
    println!("{made} made, {failed} failed, {left_out} left out, in {:.0} s", start.elapsed().as_secs_f64());
    ensure!(failed == 0, "{failed} results could not be made");
    Ok(())
}

/// The command, built.
fn build() -> anyhow::Result<PathBuf> {
    let status = Command::new(cargo()).args(BUILD).current_dir(repository()).status().context("cargo")?;
    ensure!(status.success(), "the command could not be built");
    // Both are in the folder of this profile.
    let own = std::env::current_exe()?;
    let folder = own.parent().context("this program lies in no folder")?;
    Ok(folder.join("viewfuse"))
}

/// The cargo that this was started by.
fn cargo() -> PathBuf {
    std::env::var_os("CARGO").map_or_else(|| PathBuf::from("cargo"), PathBuf::from)
}

/// Makes a result. Its files appear when all steps are done.
fn result(row: &Row, folders: &Folders, command: &Path) -> anyhow::Result<Stamp> {
    let (before, start, inputs) = (cpu_seconds(), Instant::now(), row.inputs()?);
    let mut printed = String::new();
    let mut kept = Vec::new();
    for step in &row.steps {
        match step {
            Step::Once(folder, _) if Path::new(&folders.path(folder)).exists() => {}
            Step::Once(_, line) => drop(done(line, folders, command, Stdio::null())?),
            Step::Run(line) => drop(done(line, folders, command, Stdio::null())?),
            Step::Print(line) => {
                let text = done(line, folders, command, Stdio::piped())?;
                let gap = if printed.is_empty() { "" } else { "\n" };
                let lines: String = text.lines().map(|line| format!("{}\n", line.trim_end())).collect();
                printed += &format!("{gap}$ {}\n{lines}", shown(line));
            }
            Step::Keep(from, name) => {
                let from = repository().join(folders.path(from));
                kept.push((*name, std::fs::read(&from).with_context(|| from.display().to_string())?));
            }
        }
    }
    if !printed.is_empty() {
        kept.push((row.files[0], printed.into_bytes()));
    }
    for (name, bytes) in kept {
        write_whole(&folders.out.join(name), &bytes)?;
    }
    let missing: Vec<_> = row.files.iter().filter(|file| !folders.out.join(file).exists()).collect();
    ensure!(missing.is_empty(), "its steps made no {missing:?}");
    Ok(Stamp {
        inputs,
        made: today(),
        machine: machine(),
        cpu_seconds: cpu_seconds() - before,
        wall_seconds: start.elapsed().as_secs_f64(),
    })
}

/// A command line as it stands in a result: without the places of this machine.
fn shown(line: &str) -> String {
    line.replace("{DATA}/", "").replace("{WORK}", "DATA").replace("{PYTHON}", "python3")
}

/// Runs a command line in the repository; what it printed, if that is wanted.
fn done(line: &str, folders: &Folders, viewfuse: &Path, output: Stdio) -> anyhow::Result<String> {
    println!("  {line}");
    let words = folders.line(line)?;
    let (environment, words) = words.split_at(words.iter().take_while(|word| is_assignment(word)).count());
    let [program, arguments @ ..] = words else { bail!("an empty command line") };
    let own = std::env::current_exe()?;
    let program = match program.as_str() {
        "viewfuse" => viewfuse,
        "viewfuse-research" => &own,
        "cargo" => &cargo(),
        other => Path::new(other),
    };
    let mut child = Command::new(program);
    child.args(arguments).current_dir(repository()).stdin(Stdio::null()).stdout(output);
    child.envs(environment.iter().filter_map(|word| word.split_once('=')));
    let child = child.output().with_context(|| program.display().to_string())?;
    let error = String::from_utf8_lossy(&child.stderr);
    ensure!(child.status.success(), "{line}\n{}: {}", child.status, error.trim_end());
    String::from_utf8(child.stdout).context("it printed no text")
}

/// `NAME=VALUE`, which is a variable of the environment.
fn is_assignment(word: &str) -> bool {
    word.split_once('=').is_some_and(|(name, _)| {
        !name.is_empty() && name.chars().all(|letter| letter.is_ascii_uppercase() || letter == '_')
    })
}
