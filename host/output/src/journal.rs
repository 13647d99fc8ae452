//! Finished frames of a run that is not: what an interrupted run continues from. It survives a kill at any time.
//!
//! `frames.jsonl` begins with a line that says which run it is of and which targets it has, followed by a line for each
//! frame whose files are all there; of other targets some files may be there. A last line without a line break is not
//! whole and does not count.

use crate::depth::DepthFormat;
use crate::record::{FrameRecord, SUFFIXES};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use viewfuse_job::files::{Journal, JournalLines, WriteError, remove_if_there};

/// Name of the file.
pub const JOURNAL: &str = "frames.jsonl";

/// Most bytes of a line.
const MAX_LINE: u64 = 16 << 20;

/// What every journal begins with, as [`Head`] is written.
const BEGINNING: &[u8] = b"{\"run\":\"";

/// The names of a target's files, whether they are there or not.
pub(crate) fn files_of(target: &str) -> Vec<String> {
    let pictures = SUFFIXES.iter().map(|suffix| format!("{target}{suffix}.png"));
    let depths = DepthFormat::ALL.map(|format| format!("{target}_depth.{format}"));
    pictures.chain(depths).collect()
}

/// The first line.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    run: String,
    /// The names of its targets.
    #[serde(default)]
    targets: Vec<String>,
}

/// A finished frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FinishedFrame {
    /// Its record.
    pub frame: FrameRecord,
    /// Names of its files in the folder.
    pub files: Vec<String>,
}

/// What is read of a line where only the files count.
#[derive(Deserialize)]
struct FinishedFiles {
    files: Vec<String>,
}

/// The journal of a run.
#[derive(Debug)]
pub struct FrameJournal {
    path: PathBuf,
    head: Head,
    /// How much of the file is whole and of this run.
    whole: u64,
    lines: Option<Journal>,
}

/// A journal that is there, behind its first line.
struct Reading {
    path: PathBuf,
    lines: JournalLines,
    /// Which run it is of; `None` if the first line is not whole.
    head: Option<Head>,
}

impl Reading {
    /// `None` if there is none.
    fn open(folder: &Path) -> Result<Option<Reading>, WriteError> {
        let path = folder.join(JOURNAL);
        let failed = |cause| WriteError::Io { path: path.clone(), cause };
        let Some(mut lines) = JournalLines::open(&path, MAX_LINE).map_err(failed)? else { return Ok(None) };
        let head = match lines.next_line() {
            Ok(Some(line)) => serde_json::from_slice(&line).ok(),
            // A kill in the middle of the first line.
            Ok(None) if lines.is_begun_like(BEGINNING) => return Ok(Some(Reading { path, lines, head: None })),
            // What has a longer line is not of this program.
            Ok(None) | Err(_) => None,
        };
        match head {
            Some(head) => Ok(Some(Reading { path, lines, head: Some(head) })),
            None => Err(WriteError::Foreign(path)),
        }
    }

    /// The next line that is whole.
    fn line(&mut self) -> Result<Option<Vec<u8>>, WriteError> {
        self.lines.next_line().map_err(|cause| WriteError::Io { path: self.path.clone(), cause })
    }
}

impl FrameJournal {
    /// The journal of a folder for a run, and the frames that an earlier start of the same run has finished: those
    /// whose files are all there. `run` is any text that differs for runs that would write different frames, which are
    /// of these targets. Nothing is written yet.
    ///
    /// # Errors
    /// [`WriteError::Io`] if there is a journal that cannot be read, [`WriteError::Foreign`] if what has its name is
    /// none.
    pub fn open(
        folder: &Path,
        run: &str,
        targets: &[String],
    ) -> Result<(FrameJournal, Vec<FinishedFrame>), WriteError> {
        let head = Head { run: run.to_owned(), targets: targets.to_vec() };
        let mut journal = FrameJournal { path: folder.join(JOURNAL), head, whole: 0, lines: None };
        let mut frames: Vec<FinishedFrame> = Vec::new();
        let Some(mut reading) = Reading::open(folder)? else { return Ok((journal, frames)) };
        if reading.head.as_ref().is_none_or(|head| head.run != run) {
            return Ok((journal, frames));
        }
        journal.whole = reading.lines.whole();
        while let Some(line) = reading.line()? {
            // What another program wrote ends it.
            let Ok(finished) = serde_json::from_slice::<FinishedFrame>(&line) else { break };
            journal.whole = reading.lines.whole();
            if finished.files.iter().all(|file| folder.join(file).is_file()) {
                frames.retain(|earlier| earlier.frame.target != finished.frame.target);
                frames.push(finished);
            }
        }
        Ok((journal, frames))
    }

    /// Whether a folder has one, of whichever run.
    pub(crate) fn is_in(folder: &Path) -> bool {
        matches!(Reading::open(folder), Ok(Some(_)))
    }

    /// The files that a run may have written by the journal of a folder, whichever run it is of: those that are listed,
    /// and those of its targets, which it began to write.
    pub(crate) fn files_of_any_run(folder: &Path) -> Vec<String> {
        let Ok(Some(mut reading)) = Reading::open(folder) else { return Vec::new() };
        let targets = reading.head.iter().flat_map(|head| &head.targets);
        let mut files: Vec<String> = targets.flat_map(|target| files_of(target)).collect();
        while let Ok(Some(line)) = reading.line() {
            let Ok(finished) = serde_json::from_slice::<FinishedFiles>(&line) else { break };
            files.extend(finished.files);
        }
        files
    }

    /// Removes the journal of whichever run from a folder.
    ///
    /// # Errors
    /// [`WriteError`]: above all [`WriteError::Foreign`] if what has its name is none.
    pub(crate) fn remove_any(folder: &Path) -> Result<(), WriteError> {
        match Reading::open(folder)? {
            Some(reading) => remove_if_there(&reading.path),
            None => Ok(()),
        }
    }

    /// Begins to write: before the first file of a frame, so that no journal of another run stays beside it.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn begin(&mut self) -> Result<(), WriteError> {
        if self.lines.is_some() {
            return Ok(());
        }
        let failed = |cause| WriteError::Io { path: self.path.clone(), cause };
        if let Some(folder) = self.path.parent() {
            fs::create_dir_all(folder).map_err(failed)?;
            // Nothing is cut that appeared in the meantime and is not of this program.
            Reading::open(folder)?;
        }
        let mut lines = Journal::append(&self.path).map_err(failed)?;
        lines.cut(self.whole).map_err(failed)?;
        if self.whole == 0 {
            lines.add(line_of(&self.path, &self.head)?).map_err(failed)?;
        }
        self.lines = Some(lines);
        Ok(())
    }

    /// Adds a frame whose files are written.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn add(&mut self, finished: &FinishedFrame) -> Result<(), WriteError> {
        self.begin()?;
        let line = line_of(&self.path, finished)?;
        let written = self.lines.as_mut().map_or(Ok(()), |lines| lines.add(line));
        written.map_err(|cause| WriteError::Io { path: self.path.clone(), cause })
    }

    /// Removes it: the run is finished.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn remove(self) -> Result<(), WriteError> {
        drop(self.lines);
        remove_if_there(&self.path)
    }
}

fn line_of(path: &Path, value: &impl Serialize) -> Result<Vec<u8>, WriteError> {
    serde_json::to_vec(value).map_err(|cause| WriteError::Encode { path: path.to_path_buf(), cause: cause.into() })
}
