//! What can be wrong with a checkpoint.
//!
//! Every message is one line and begins with the path of the file, followed by the place or tensor in it.

use super::pickle::PickleError;
use std::path::{Path, PathBuf};
use viewfuse_job::files::WriteError;

/// Why a checkpoint cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The operating system did not let us read it.
    #[error("{}: cannot be read: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// It is something else.
    #[error("{}: no checkpoint: {what}", path.display())]
    NoCheckpoint {
        /// The file.
        path: PathBuf,
        /// What it seems to be, and what to do.
        what: String,
    },
    /// It is a checkpoint that cannot be used.
    #[error("{}: {what}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, with which entry or tensor in it.
        what: String,
    },
    /// Its description of itself cannot be read.
    #[error("{}: {fault}", path.display())]
    Pickle {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        fault: PickleError,
    },
    /// More than any network that is meant here.
    #[error(
        "{}: {what} would take {bytes} bytes of memory, at most {limit} are allowed; the file is damaged, malicious, or \
         of another network", path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// A tensor, or all of them.
        what: String,
        /// What reading it takes.
        bytes: u128,
        /// What it may take.
        limit: u64,
    },
    /// Tensors are not those of the architecture.
    #[error("{}: {detail}", path.display())]
    Tensors {
        /// The file.
        path: PathBuf,
        /// Which are missing, unexpected, or of another shape.
        detail: String,
    },
    /// There is no tensor of this name.
    #[error("{}: has no tensor '{tensor}'", path.display())]
    NoTensor {
        /// The file.
        path: PathBuf,
        /// The name.
        tensor: String,
    },
    /// NaN, infinity, or a value beyond what the type that is asked for holds.
    #[error("{}: tensor '{tensor}': element {index} is {value:?}, {problem}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// The tensor.
        tensor: String,
        /// Flat index of the first such element, row-major.
        index: u64,
        /// Its value.
        value: f64,
        /// What is wrong with it.
        problem: &'static str,
    },
    /// A file that was to be made cannot be.
    #[error(transparent)]
    Write(WriteError),
    /// The work was stopped.
    #[error(transparent)]
    Interrupted(viewfuse_job::progress::Interrupted),
}

/// What can be wrong with the content of a file, before it is said which file.
#[derive(Debug)]
pub(super) enum Problem {
    Read(std::io::Error),
    Pickle(PickleError),
    NoCheckpoint(String),
    Content(String),
    TooLarge { what: String, bytes: u128, limit: u64 },
}

impl From<std::io::Error> for Problem {
    fn from(cause: std::io::Error) -> Problem {
        match cause.kind() {
            std::io::ErrorKind::UnexpectedEof => Problem::Content("ends too early; the file is cut off".to_owned()),
            _ => Problem::Read(cause),
        }
    }
}

impl From<PickleError> for Problem {
    fn from(fault: PickleError) -> Problem {
        Problem::Pickle(fault)
    }
}

impl Problem {
    /// The error of this file.
    pub(super) fn of(self, path: &Path) -> CheckpointError {
        let path = path.to_path_buf();
        match self {
            Problem::Read(cause) => CheckpointError::Read { path, cause },
            Problem::Pickle(fault) => CheckpointError::Pickle { path, fault },
            Problem::NoCheckpoint(what) => CheckpointError::NoCheckpoint { path, what },
            Problem::Content(what) => CheckpointError::Content { path, what },
            Problem::TooLarge { what, bytes, limit } => CheckpointError::TooLarge { path, what, bytes, limit },
        }
    }
}

/// A name as far as messages repeat it.
pub(super) fn shortened(name: &str) -> String {
    const LONGEST: usize = 100;
    let mut short: String = name.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if name.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    short
}
