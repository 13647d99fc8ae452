//! The folder of an evaluation: an interrupted run resumes, and several machines can share it.
//!
//! ```text
//! run.json              what is evaluated; written first, and compared by every later run
//! scores-I-of-N.jsonl   finished jobs of shard I of N, a line each
//! pictures/             of a few jobs: sources, predictions, truth (`gallery`)
//! scores.csv            every score, once all jobs are finished
//! ```
//!
//! Readers merge the lines of all shards by number of job. The result does not depend on the number of shards, on
//! changes of that number during the run, or on restarts.

mod journal;
mod settings;

pub use journal::{Finished, JobJournal, Shard};
pub use settings::{SceneSettings, Settings};

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use viewfuse_job::files::{WriteError, read_at_most, write_whole};
use viewfuse_job::hint::{Hint, Hinted};

/// Name of the file of settings.
pub const SETTINGS: &str = "run.json";

/// Most jobs of an evaluation.
pub const MAX_JOBS: usize = 10_000_000;

/// Most bytes of the file of settings.
const LONGEST_SETTINGS: u64 = 1 << 30;

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// A file cannot be read or written.
    #[error("{}: {doing}: {cause}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What could not be done.
        doing: &'static str,
        /// What the system said.
        cause: std::io::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A file, or a line of it, was not written by this program.
    #[error("{}{}: is not of an evaluation, or damaged: {cause}", path.display(), line.map_or(String::new(),
        |line| format!(":{line}")))]
    Json {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: Option<usize>,
        /// What is wrong with it.
        cause: serde_json::Error,
    },
    /// The folder is that of another evaluation.
    #[error(
        "{}: is of an evaluation with other settings ({}); use another folder, or the same settings to resume it",
        path.display(), differences.join("; ")
    )]
    Different {
        /// The file of settings.
        path: PathBuf,
        /// What differs, and how.
        differences: Vec<String>,
    },
    /// The settings have more jobs than an evaluation can have.
    #[error("{}: job_count is {count}; at most {MAX_JOBS} jobs are possible", path.display())]
    JobCount {
        /// The file of settings.
        path: PathBuf,
        /// Its number of jobs.
        count: usize,
    },
    /// A finished job does not belong to this evaluation, although the settings are the same.
    #[error("{}: job {job} has other views than this version of the program would use; use another \
        folder", path.display())]
    OtherJob {
        /// The folder.
        path: PathBuf,
        /// Its number.
        job: usize,
    },
    /// A finished job is of an evaluation with other settings, whose lines were put here.
    #[error("{}: job {job} was done with other settings than {SETTINGS} states; use another folder", path.display())]
    OtherSettings {
        /// The folder.
        path: PathBuf,
        /// Its number.
        job: usize,
    },
    /// Another process runs the same shard.
    #[error("{}: another process is writing to it", path.display())]
    Busy {
        /// The journal.
        path: PathBuf,
    },
}

impl Hinted for FolderError {
    fn hint(&self) -> Option<Hint> {
        match self {
            FolderError::Busy { .. } => Some(Hint::Shard),
            _ => None,
        }
    }
}

/// The folder of an evaluation.
#[derive(Clone, Debug)]
pub struct RunFolder {
    path: PathBuf,
    settings: Settings,
}

impl RunFolder {
    /// Begins an evaluation, or resumes it.
    ///
    /// # Errors
    /// [`FolderError`]: above all, if the folder is that of an evaluation with other settings.
    pub fn begin(path: &Path, settings: Settings) -> Result<RunFolder, FolderError> {
        let file = path.join(SETTINGS);
        // An empty file is of a machine that lost its power: as if the evaluation had not begun.
        if file.metadata().is_ok_and(|file| file.len() > 0) {
            let found = RunFolder::open(path)?;
            let differences = settings.differences(&found.settings);
            if !differences.is_empty() {
                return Err(FolderError::Different { path: file, differences });
            }
            return Ok(found);
        }
        // Files of somebody else's are found before anything is written beside them.
        let journals = if path.is_dir() { journal::journals(path)? } else { Vec::new() };
        journals.iter().try_for_each(|journal| journal::check(journal).map(drop))?;
        let json = serde_json::to_vec_pretty(&settings);
        let json = json.map_err(|cause| FolderError::Json { path: file.clone(), line: None, cause })?;
        // Several shards may do this at once: they write the same content.
        write_whole(&file, &json)?;
        Ok(RunFolder { path: path.to_path_buf(), settings })
    }

    /// Opens the folder of an evaluation that has begun.
    ///
    /// # Errors
    /// [`FolderError`].
    pub fn open(path: &Path) -> Result<RunFolder, FolderError> {
        let file = path.join(SETTINGS);
        let unreadable = |cause| FolderError::Io { path: file.clone(), doing: "cannot be read", cause };
        let text = read_at_most(&file, LONGEST_SETTINGS).map_err(unreadable)?;
        let foreign = |cause| FolderError::Json { path: file.clone(), line: None, cause };
        let settings: Settings = serde_json::from_slice(&text).map_err(foreign)?;
        if settings.job_count > MAX_JOBS {
            return Err(FolderError::JobCount { path: file, count: settings.job_count });
        }
        Ok(RunFolder { path: path.to_path_buf(), settings })
    }

    /// The folder's path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What is evaluated.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The journal of a shard, opened for appending. An incomplete last line of a killed process is removed.
    ///
    /// # Errors
    /// [`FolderError`]; [`FolderError::Busy`] while another process has it open.
    pub fn journal(&self, shard: Shard) -> Result<JobJournal, FolderError> {
        JobJournal::open(&self.path, shard)
    }

    /// Every finished job of every shard, by number. For a job that was run twice, the first shard's result.
    ///
    /// # Errors
    /// [`FolderError`]; [`FolderError::OtherSettings`] for a job of an evaluation with other settings.
    pub fn finished(&self) -> Result<BTreeMap<usize, Finished>, FolderError> {
        let (mut finished, settings) = (BTreeMap::new(), self.settings.digest());
        for journal in journal::journals(&self.path)? {
            for line in journal::read(&journal)? {
                if line.settings != settings {
                    return Err(FolderError::OtherSettings { path: self.path.clone(), job: line.job });
                }
                finished.entry(line.job).or_insert(line);
            }
        }
        Ok(finished)
    }
}

/// Numbers of jobs that are not finished.
pub fn missing(job_count: usize, finished: &BTreeMap<usize, Finished>) -> Vec<usize> {
    (0..job_count).filter(|job| !finished.contains_key(job)).collect()
}
