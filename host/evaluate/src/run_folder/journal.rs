//! Finished jobs, a line each. They survive a kill at any time.

use super::FolderError;
use crate::Score;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use viewfuse_job::files::{Journal, JournalLines, WriteError};

/// The jobs of a process: those whose number modulo `count` is `index`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 0.
    pub index: usize,
    /// How many there are.
    pub count: usize,
}

impl Shard {
    /// All jobs.
    pub const ALL: Shard = Shard { index: 0, count: 1 };

    /// Whether the job with this number belongs to it.
    pub fn does(&self, job: usize) -> bool {
        job % self.count == self.index
    }
}

impl FromStr for Shard {
    type Err = String;

    /// `INDEX/COUNT`.
    fn from_str(text: &str) -> Result<Shard, String> {
        let numbers = text.split_once('/').and_then(|(index, count)| Some((index.parse().ok()?, count.parse().ok()?)));
        match numbers {
            Some((index, count)) if index < count => Ok(Shard { index, count }),
            _ => Err("a shard is INDEX/COUNT, counted from 0: 0/4, 1/4, 2/4 and 3/4 are all of four".to_owned()),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

/// A finished job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finished {
    /// Its number.
    pub job: usize,
    /// Index of the scene, from 0.
    pub scene: usize,
    /// The scene's name.
    pub scene_name: String,
    /// Number of the trial.
    pub trial: u32,
    /// The device that ran it.
    pub device: String,
    /// The evaluation's settings ([`Settings::digest`](super::Settings::digest)).
    #[serde(default)]
    pub settings: String,
    /// Names of the sources.
    pub sources: Vec<String>,
    /// Scores of every scheme at every target.
    pub scores: Vec<Score>,
}

/// Most bytes of a line.
const MAX_LINE: u64 = 64 << 20;
/// What every line begins with, as [`Finished`] is written.
const BEGINNING: &[u8] = b"{\"job\":";

/// The journal of one shard. While it is open, no other process opens it.
#[derive(Debug)]
pub struct JobJournal {
    path: PathBuf,
    lines: Journal,
}

impl JobJournal {
    pub(super) fn open(folder: &Path, shard: Shard) -> Result<JobJournal, FolderError> {
        let path = folder.join(format!("scores-{}-of-{}.jsonl", shard.index, shard.count));
        let failed = |doing, cause| FolderError::Io { path: path.clone(), doing, cause };
        let lines = Journal::append(&path).map_err(|cause| failed("cannot be opened", cause))?;
        if !lines.lock() {
            return Err(FolderError::Busy { path });
        }
        // Nothing is cut before all of it is known to be of an evaluation.
        if let Some(whole) = check(&path)? {
            lines.cut(whole).map_err(|cause| failed("its unfinished last line cannot be removed", cause))?;
        }
        Ok(JobJournal { path, lines })
    }

    /// Adds a finished job; it is on disk when this returns.
    ///
    /// # Errors
    /// [`FolderError`].
    pub fn add(&mut self, finished: &Finished) -> Result<(), FolderError> {
        let path = || self.path.clone();
        let line =
            serde_json::to_vec(finished).map_err(|cause| FolderError::Json { path: path(), line: None, cause })?;
        self.lines.add(line).map_err(|cause| FolderError::Io { path: path(), doing: "cannot be written", cause })
    }
}

/// The journals of a folder, sorted by name.
pub(super) fn journals(folder: &Path) -> Result<Vec<PathBuf>, FolderError> {
    let failed = |cause| FolderError::Io { path: folder.to_path_buf(), doing: "cannot be read", cause };
    let mut journals = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if name.starts_with("scores-") && name.ends_with(".jsonl") {
            journals.push(path);
        }
    }
    journals.sort();
    Ok(journals)
}

/// Checks that all of a journal is of an evaluation; where it is to be cut if its last line is not whole.
///
/// # Errors
/// [`FolderError`]: above all, if it is a file of somebody else's.
pub(super) fn check(path: &Path) -> Result<Option<u64>, FolderError> {
    let Some(lines) = each_line(path, drop)? else { return Ok(None) };
    if lines.is_begun_like(BEGINNING) {
        Ok((!lines.unfinished().is_empty()).then_some(lines.whole()))
    } else {
        Err(WriteError::Foreign(path.to_path_buf()).into())
    }
}

/// The finished jobs of a journal. A last line without a line break is being written or is incomplete, and is ignored.
pub(super) fn read(path: &Path) -> Result<Vec<Finished>, FolderError> {
    let mut jobs = Vec::new();
    each_line(path, |finished| jobs.push(finished))?;
    Ok(jobs)
}

/// Calls `each` with what every whole line says; returns the lines behind the last one, if there is a journal.
fn each_line(path: &Path, mut each: impl FnMut(Finished)) -> Result<Option<JournalLines>, FolderError> {
    let failed = |cause| FolderError::Io { path: path.to_path_buf(), doing: "cannot be read", cause };
    let Some(mut lines) = JournalLines::open(path, MAX_LINE).map_err(failed)? else { return Ok(None) };
    let mut number = 1;
    while let Some(line) = lines.next_line().map_err(failed)? {
        let of_line = |cause| FolderError::Json { path: path.to_path_buf(), line: Some(number), cause };
        each(serde_json::from_slice(&line).map_err(of_line)?);
        number += 1;
    }
    Ok(Some(lines))
}
