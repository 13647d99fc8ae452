//! Every experiment of viewfuse as a program, and one command that makes all of its results again:
//!
//! ```text
//! cargo run --release -p viewfuse-research -- plan [--quick] [NAME...]
//! cargo run --release -p viewfuse-research -- run [--quick] [--data DIR] [NAME...]
//! cargo run --release -p viewfuse-research -- EXPERIMENT ARGUMENT...
//! ```
//!
//! ```text
//! experiments  the programs
//! rows         what there is to make: a row a result
//! plan         rows with what they need, their state and their time
//! stamp        when a result was made, and from what
//! make         makes a result, whole or not at all
//! ```

mod experiments;
mod make;
mod plan;
mod rows;
mod stamp;

use anyhow::{Context, bail, ensure};
use plan::Folders;
use std::path::Path;
use std::process::ExitCode;

const USAGE: &str = "\
usage: viewfuse-research plan|run [OPTIONS] [NAME...]
       viewfuse-research EXPERIMENT ARGUMENT...

plan lists the results, what each needs, its CPU hours and whether it is up to date; run makes those that are not.
Without names: all of them.

  --quick       in minutes, on small scenes that come with the repository or are generated
  --data DIR    where the given data sets lie, each in a folder of its name
  --work DIR    where data are generated and unfinished work is kept [default: out/research]
  --out DIR     where results go [default: host/research/results; with --quick out/quick]
  --command FILE the command viewfuse with all features [default: it is built]
  --python FILE a Python that has PyTorch [default: python3]

experiments: ";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let done = match arguments.split_first() {
        Some((command, rest)) if command == "plan" || command == "run" => planned(command == "run", rest),
        Some((name, rest)) => experiments::run(name, rest),
        None => Err(anyhow::anyhow!("{USAGE}{}", experiments::names().join(", "))),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::FAILURE
        }
    }
}

/// The commands `plan` and `run`.
fn planned(is_run: bool, arguments: &[String]) -> anyhow::Result<()> {
    let is_quick = arguments.iter().any(|argument| argument == "--quick");
    let mut folders = Folders::new(is_quick);
    let mut names = Vec::new();
    let mut arguments = arguments.iter().filter(|argument| *argument != "--quick");
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().with_context(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--data" => folders.data = Some(std::path::absolute(value()?)?),
            "--work" => folders.work = std::path::absolute(value()?)?,
            "--out" => folders.out = std::path::absolute(value()?)?,
            "--command" => folders.command = Some(std::path::absolute(value()?)?),
            "--python" => folders.python = value()?.clone(),
            option if option.starts_with('-') => bail!("unknown option {option}\n{USAGE}"),
            name => names.push(name.to_owned()),
        }
    }
    let rows = rows::rows(is_quick);
    let unknown: Vec<&String> = names.iter().filter(|name| !rows.iter().any(|row| row.name == **name)).collect();
    ensure!(unknown.is_empty(), "no result is called {unknown:?}; `plan` lists them");
    let rows: Vec<_> =
        rows.into_iter().filter(|row| names.is_empty() || names.iter().any(|name| name == row.name)).collect();
    if is_run { make::all(&rows, &folders) } else { plan::show(&rows, &folders) }
}

/// The repository that this was built from: paths in command lines begin there.
fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(2).unwrap_or(Path::new("."))
}
