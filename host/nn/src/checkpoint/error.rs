//! The errors of checkpoints.
//!
//! Every message is one line and begins with the path of the file, followed by the place or tensor in it.

use super::pickle::PickleError;
use std::path::{Path, PathBuf};
use viewfuse_job::files::WriteError;

/// Why a checkpoint cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The operating system reported an error while reading it.
    #[error("{0}: cannot be read: {1}")]
    Read(PathBuf, std::io::Error),
    /// It is not a checkpoint: what it appears to be, and what to do.
    #[error("{0}: not a checkpoint: {1}")]
    NoCheckpoint(PathBuf, String),
    /// It is a checkpoint with invalid content: the problem, with the entry or tensor.
    #[error("{0}: {1}")]
    Content(PathBuf, String),
    /// Its description of its tensors cannot be read: the problem and its position.
    #[error("{0}: {1}")]
    Pickle(PathBuf, PickleError),
    /// It would take more memory than the supported networks.
    #[error(
        "{}: {what} would take {bytes} bytes of memory, at most {limit} are allowed; the file is damaged, malicious, \
         or of another network", path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// A tensor, or all of them.
        what: String,
        /// Memory that reading it would take.
        bytes: u128,
        /// The limit.
        limit: u64,
    },
    /// Its tensors are not those of the architecture: those that are missing, unexpected, or of another shape.
    #[error("{0}: {1}")]
    Tensors(PathBuf, String),
    /// There is no tensor of this name.
    #[error("{0}: has no tensor '{1}'")]
    NoTensor(PathBuf, String),
    /// NaN, infinity, or a value out of the requested type's range.
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
        /// The problem.
        problem: &'static str,
    },
    /// An output file cannot be written.
    #[error(transparent)]
    Write(WriteError),
    /// The work was cancelled.
    #[error(transparent)]
    Interrupted(viewfuse_job::progress::Interrupted),
}

/// A problem with the content of a file, without the file's path.
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
    /// The error with the file's path.
    pub(super) fn of(self, path: &Path) -> CheckpointError {
        let path = path.to_path_buf();
        match self {
            Problem::Read(cause) => CheckpointError::Read(path, cause),
            Problem::Pickle(fault) => CheckpointError::Pickle(path, fault),
            Problem::NoCheckpoint(what) => CheckpointError::NoCheckpoint(path, what),
            Problem::Content(what) => CheckpointError::Content(path, what),
            Problem::TooLarge { what, bytes, limit } => CheckpointError::TooLarge { path, what, bytes, limit },
        }
    }
}

/// A name, shortened for messages.
pub(super) fn shortened(name: &str) -> String {
    const LONGEST: usize = 100;
    let mut short: String = name.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if name.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    short
}
