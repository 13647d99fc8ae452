//! Finished frames of a run that is not: what an interrupted run continues from. It survives a kill at any time.
//!
//! `frames.jsonl` begins with a line that says which run it is of, followed by a line for each frame whose files are all
//! there. A last line without a line break is not whole and does not count.

use crate::record::FrameRecord;
use serde::{Deserialize, Serialize};
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use viewfuse_job::files::{WriteError, remove_if_there};

/// Name of the file.
pub const JOURNAL: &str = "frames.jsonl";

/// The first line.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    run: String,
}

/// A finished frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FinishedFrame {
    /// Its record.
    pub frame: FrameRecord,
    /// Names of its files in the folder.
    pub files: Vec<String>,
}

/// The journal of a run.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    run: String,
    /// How much of the file is whole and of this run.
    whole: u64,
    file: Option<File>,
}

impl Journal {
    /// The journal of a folder for a run, and the frames that an earlier start of the same run has finished: those whose
    /// files are all there. `run` is any text that differs for runs that would write different frames. Nothing is
    /// written yet.
    ///
    /// # Errors
    /// [`WriteError::Io`] if there is a journal that cannot be read.
    pub fn open(folder: &Path, run: &str) -> Result<(Journal, Vec<FinishedFrame>), WriteError> {
        let path = folder.join(JOURNAL);
        let bytes = match fs::read(&path) {
            Err(cause) if cause.kind() == std::io::ErrorKind::NotFound => Vec::new(),
            Err(cause) => return Err(WriteError::Io { path, cause }),
            Ok(bytes) => bytes,
        };
        let mut journal = Journal { path, run: run.to_owned(), whole: 0, file: None };
        let mut lines = bytes.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n"));
        let head = lines.next().and_then(|line| Some((line.len(), serde_json::from_slice::<Head>(line).ok()?)));
        let Some((length, _)) = head.filter(|(_, head)| head.run == run) else { return Ok((journal, Vec::new())) };
        journal.whole = length as u64;
        let mut frames: Vec<FinishedFrame> = Vec::new();
        for line in lines {
            // What another program wrote ends it.
            let Ok(finished) = serde_json::from_slice::<FinishedFrame>(line) else { break };
            journal.whole += line.len() as u64;
            if finished.files.iter().all(|file| folder.join(file).is_file()) {
                frames.retain(|earlier| earlier.frame.target != finished.frame.target);
                frames.push(finished);
            }
        }
        Ok((journal, frames))
    }

    /// Begins to write: before the first file of a frame, so that no journal of another run stays beside it.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn begin(&mut self) -> Result<(), WriteError> {
        if self.file.is_some() {
            return Ok(());
        }
        let failed = |cause| WriteError::Io { path: self.path.clone(), cause };
        if let Some(folder) = self.path.parent() {
            fs::create_dir_all(folder).map_err(failed)?;
        }
        let mut file = OpenOptions::new().create(true).append(true).open(&self.path).map_err(failed)?;
        file.set_len(self.whole).map_err(failed)?;
        if self.whole == 0 {
            let head = line_of(&self.path, &Head { run: self.run.clone() })?;
            file.write_all(&head).map_err(failed)?;
        }
        self.file = Some(file);
        Ok(())
    }

    /// Adds a frame whose files are written.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn add(&mut self, finished: &FinishedFrame) -> Result<(), WriteError> {
        self.begin()?;
        let line = line_of(&self.path, finished)?;
        let written = self.file.as_mut().map_or(Ok(()), |file| file.write_all(&line));
        written.map_err(|cause| WriteError::Io { path: self.path.clone(), cause })
    }

    /// Removes it: the run is finished.
    ///
    /// # Errors
    /// [`WriteError`].
    pub fn remove(self) -> Result<(), WriteError> {
        drop(self.file);
        remove_if_there(&self.path)
    }
}

fn line_of(path: &Path, value: &impl Serialize) -> Result<Vec<u8>, WriteError> {
    let encoded = serde_json::to_vec(value);
    let mut line = encoded.map_err(|cause| WriteError::Encode { path: path.to_path_buf(), cause: cause.into() })?;
    line.push(b'\n');
    Ok(line)
}
