//! What a result is made by, what it needs, and the plan: the state of each.

use crate::repository;
use crate::stamp::{Stamps, digest};
use anyhow::Context;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A part of making a result. Words in capitals in braces stand for places ([`Folders::line`]), a last `/*` for the subfolders.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    /// A command line; what it prints goes into the result's first file, below the line.
    Print(String),
    /// A folder, and the command line that makes it, whole; it is not run again where the folder is.
    Once(&'static str, &'static str),
    /// A command line that leaves files: data, unfinished work, or the result itself.
    Run(String),
    /// A file that a step left becomes a file of the result, by this name. Its path begins in the repository or at a place.
    Keep(String, &'static str),
}

/// What must be there before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    /// A data set that nobody can generate: a folder of this name, and where it is from.
    Data(&'static str, &'static str),
    /// A Python that imports this.
    Python(&'static str),
    /// A program that answers `--version`.
    Program(&'static str),
}

/// CPU hours of making a result.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Hours {
    /// From the times of one picture or step.
    Estimated(f64),
    /// When it was last made on two cores, before stamps were kept.
    Measured(f64),
}

/// A result.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    pub(crate) name: &'static str,
    /// What it says.
    pub(crate) what: &'static str,
    /// Its files, the printed one first.
    pub(crate) files: &'static [&'static str],
    pub(crate) needs: Vec<Need>,
    pub(crate) hours: Hours,
    /// Files and folders of the repository that a result is older than when they change.
    pub(crate) dated_by: Vec<&'static str>,
    pub(crate) steps: Vec<Step>,
}

/// Where things are.
#[derive(Clone, Debug)]
pub(crate) struct Folders {
    /// Given data sets.
    pub(crate) data: Option<PathBuf>,
    /// Generated data and unfinished work.
    pub(crate) work: PathBuf,
    /// Results and their stamps.
    pub(crate) out: PathBuf,
    /// The command with all of its features, if it is not to be built.
    pub(crate) command: Option<PathBuf>,
    /// A Python that has PyTorch.
    pub(crate) python: String,
}

/// How a row stands.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum State {
    /// Made from what is there now.
    UpToDate,
    /// Made on a day from something else.
    Older(String),
    /// There, from before stamps were kept.
    Undated,
    /// Not there.
    Missing,
}

impl Folders {
    /// The default places.
    pub(crate) fn new(is_quick: bool) -> Folders {
        let out = if is_quick { "out/quick" } else { "host/research/results" };
        let work = if is_quick { "out/quick/work" } else { "out/research" };
        Folders {
            data: None,
            work: repository().join(work),
            out: repository().join(out),
            command: None,
            python: "python3".to_owned(),
        }
    }

    /// The words of a command line, with places and the subfolders of `FOLDER/*`. Quotes hold words with blanks together.
    pub(crate) fn line(&self, text: &str) -> anyhow::Result<Vec<String>> {
        let mut words = Vec::new();
        for word in split(text) {
            let word = self.path(&word);
            let Some((start, folder)) = word.strip_suffix("/*").map(|word| word.split_once('=').unwrap_or(("", word)))
            else {
                words.push(word);
                continue;
            };
            let entries = std::fs::read_dir(folder).with_context(|| folder.to_owned())?;
            let mut folders: Vec<PathBuf> =
                entries.filter_map(|entry| Some(entry.ok()?.path())).filter(|path| path.is_dir()).collect();
            folders.sort();
            let equals = if start.is_empty() { "" } else { "=" };
            words.extend(folders.iter().map(|path| format!("{start}{equals}{}", path.display())));
        }
        Ok(words)
    }

    /// A word with the places that it names.
    pub(crate) fn path(&self, word: &str) -> String {
        let data = self.data.as_deref().unwrap_or(Path::new("data"));
        word.replace("{DATA}", &data.display().to_string())
            .replace("{WORK}", &self.work.display().to_string())
            .replace("{PYTHON}", &self.python)
    }
}

/// The words of a text; blanks between quotes are part of a word.
fn split(text: &str) -> Vec<String> {
    let (mut words, mut is_quoted) = (vec![String::new()], false);
    for letter in text.chars() {
        match letter {
            '"' => is_quoted = !is_quoted,
            ' ' if !is_quoted => words.push(String::new()),
            letter => words.last_mut().into_iter().for_each(|word| word.push(letter)),
        }
    }
    words.retain(|word| !word.is_empty());
    words
}

impl Need {
    /// Whether it is there.
    pub(crate) fn is_met(self, folders: &Folders) -> bool {
        let succeeds = |program: &str, argument: &[&str]| {
            let silent = Command::new(program).args(argument).stdout(Stdio::null()).stderr(Stdio::null()).status();
            silent.is_ok_and(|status| status.success())
        };
        match self {
            Need::Data(name, _) => folders.data.as_ref().is_some_and(|data| data.join(name).is_dir()),
            Need::Python(module) => succeeds(&folders.python, &["-c", &format!("import {module}")]),
            Need::Program(name) => succeeds(name, &["--version"]),
        }
    }

    /// What a person must provide.
    pub(crate) fn text(self) -> String {
        match self {
            Need::Data(name, from) => format!("data {name} ({from})"),
            Need::Python(module) => format!("a Python with {module}"),
            Need::Program(name) => name.to_owned(),
        }
    }
}

impl Row {
    /// The digest of all that the result is made from: its command lines, and the files that date it.
    pub(crate) fn inputs(&self) -> anyhow::Result<String> {
        let steps: Vec<String> = self.steps.iter().map(|step| format!("{step:?}")).collect();
        digest(&steps.join("\n"), &self.dated_by).with_context(|| self.name.to_owned())
    }

    /// What it needs and is not there.
    pub(crate) fn lacks(&self, folders: &Folders) -> Vec<String> {
        self.needs.iter().filter(|need| !need.is_met(folders)).map(|need| need.text()).collect()
    }

    /// How it stands in a folder with these stamps.
    pub(crate) fn state(&self, folders: &Folders, stamps: &Stamps) -> anyhow::Result<State> {
        Ok(match stamps.of(self.name) {
            _ if self.files.iter().any(|file| !folders.out.join(file).exists()) => State::Missing,
            None => State::Undated,
            Some(stamp) if stamp.inputs == self.inputs()? => State::UpToDate,
            Some(stamp) => State::Older(stamp.made.clone()),
        })
    }
}

/// Prints the plan.
pub(crate) fn show(rows: &[Row], folders: &Folders) -> anyhow::Result<()> {
    let stamps = Stamps::read(&folders.out)?;
    let (mut all, mut due) = (0.0, 0.0);
    println!("| result | what | state | CPU hours | lacks | files |\n|---|---|---|---|---|---|");
    for row in rows {
        let state = row.state(folders, &stamps)?;
        let (hours, how) = match (stamps.of(row.name), row.hours) {
            (Some(stamp), _) if stamp.cpu_seconds > 0.0 => (stamp.cpu_seconds / 3600.0, "measured"),
            (_, Hours::Measured(hours)) => (hours, "measured"),
            (_, Hours::Estimated(hours)) => (hours, "estimated"),
        };
        all += hours;
        let said = match &state {
            State::UpToDate => "up to date".to_owned(),
            State::Older(made) => format!("made {made}, its inputs changed since"),
            State::Undated => "there, undated".to_owned(),
            State::Missing => "not made".to_owned(),
        };
        if state != State::UpToDate {
            due += hours;
        }
        let lacks = row.lacks(folders).join("; ");
        println!("| {} | {} | {said} | {hours:.3}, {how} | {lacks} | {} |", row.name, row.what, row.files.join(", "));
    }
    println!("\n{} results, {all:.1} CPU hours; {due:.1} for those that are not up to date", rows.len());
    Ok(())
}
