//! Output files that are written completely or not at all, and what is known of files before they are read or written.

mod bounded;
mod folder;
mod journal;
mod lock;
mod ordinary;
mod scratch;
mod unfinished;

pub use bounded::read_at_most;
pub use folder::WholeFolder;
pub use journal::{Journal, JournalLines};
pub use lock::FolderLock;
pub use ordinary::{is_ordinary, open_ordinary};
pub use scratch::Scratch;
pub use unfinished::{remove_all, remove_unfinished};

use std::io::ErrorKind::{NotADirectory, NotFound, PermissionDenied};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use unfinished::{PREFIX, Unfinished, clean};

/// Why an output could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The operating system reported an error.
    #[error("{}: cannot be written: {cause}", path.display())]
    Io {
        /// The output file.
        path: PathBuf,
        /// The system's error.
        cause: std::io::Error,
    },
    /// The picture could not be encoded.
    #[error("{}: cannot be encoded: {cause}", path.display())]
    Encode {
        /// The output file.
        path: PathBuf,
        /// The encoder's error.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
    /// Another process writes to the folder.
    #[error("{0}: another process is writing to this folder")]
    Busy(PathBuf),
    /// A file of this name is a person's own: it is neither continued nor removed.
    #[error("{0}: is not what this program keeps under this name; move it, or give another folder")]
    Foreign(PathBuf),
}

/// A file that is written in pieces and appears when it is finished. Dropped before that, it leaves no file.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    writer: BufWriter<NamedTempFile>,
    unfinished: Unfinished,
}

impl WholeFile {
    /// Begins a file. Until it is finished, its content is in a temporary file beside `path`. Missing folders are
    /// created.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn create(path: &Path) -> Result<WholeFile, WriteError> {
        let failed = |cause| WriteError::Io { path: path.to_path_buf(), cause };
        let folder = folder_of(path);
        std::fs::create_dir_all(folder).map_err(failed)?;
        let make = |builder: &mut tempfile::Builder<'_, '_>| {
            // The default is readable by the owner only, which is wrong for a result.
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt;
                builder.permissions(std::fs::Permissions::from_mode(0o644));
            }
            builder.tempfile_in(folder)
        };
        clean(folder);
        let (file, unfinished) = Unfinished::make(PREFIX, make, |file| file.path().to_path_buf()).map_err(failed)?;
        Ok(WholeFile { path: path.to_path_buf(), writer: BufWriter::new(file), unfinished })
    }

    /// The temporary file, for a program that writes the content.
    pub fn path(&self) -> &Path {
        self.writer.get_ref().path()
    }

    /// Appends bytes.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        self.writer.write_all(bytes).map_err(|cause| WriteError::Io { path: self.path.clone(), cause })
    }

    /// Renames it into place; an existing file is replaced. What is written is on disk before that: a machine that
    /// loses power keeps one of the two.
    ///
    /// # Errors
    /// [`WriteError::Io`]; then no temporary file remains.
    pub fn finish(self) -> Result<(), WriteError> {
        let WholeFile { path, writer, unfinished } = self;
        let finished = writer.into_inner().map_err(|error| error.into_error()).and_then(|file| {
            file.as_file().sync_data()?;
            unfinished.finish(|| file.persist(&path).map_err(|error| error.error))
        });
        finished.map(drop).map_err(|cause| WriteError::Io { path, cause })
    }
}

/// The folder that a file or folder lies in.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|parent| *parent != "").unwrap_or(Path::new("."))
}

/// Writes `bytes` to a temporary file beside `path` and renames it into place. Missing folders are created.
///
/// # Errors
/// [`WriteError::Io`]; then no temporary file remains.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let mut file = WholeFile::create(path)?;
    file.write(bytes)?;
    file.finish()
}

/// Checks, before long work, that `path` can be written: it is no folder, pipe or device, no part of it is a link to nothing or
/// has a name that the system does not take, and files can be created in the nearest existing folder above it. No file
/// remains.
///
/// # Errors
/// [`WriteError::Io`].
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let failed = |cause| WriteError::Io { path: path.to_path_buf(), cause };
    let dangles = |part: &&Path| part.is_symlink() && !part.exists();
    if let Some(link) = path.ancestors().find(dangles) {
        return Err(failed(std::io::Error::other(format!("{} is a link to nothing", link.display()))));
    }
    if path.is_dir() {
        return Err(failed(std::io::Error::other("it is a folder")));
    }
    if path.exists() && !path.is_file() {
        return Err(failed(std::io::Error::other("it is no ordinary file, and is left alone")));
    }
    let above = || path.ancestors().skip(1).map(|folder| if folder == "" { Path::new(".") } else { folder });
    let Some(nearest) = above().find(|folder| folder.exists()) else { return Ok(()) };
    // Names that the file system does not take, each alone: of those in folders that are missing nothing is said.
    let missing = path.strip_prefix(nearest).unwrap_or(path);
    for name in missing.components().map(|part| nearest.join(part)) {
        match std::fs::symlink_metadata(&name) {
            Err(cause) if !matches!(cause.kind(), NotFound | NotADirectory | PermissionDenied) => {
                return Err(failed(cause));
            }
            _ => {}
        }
    }
    if !nearest.is_dir() {
        return Err(failed(std::io::Error::other(format!("{} is not a folder", nearest.display()))));
    }
    tempfile::tempfile_in(nearest).map_err(failed)?;
    Ok(())
}

/// Removes a file; a missing file is no error.
///
/// # Errors
/// [`WriteError::Io`] if the system reports an error.
pub fn remove_if_there(path: &Path) -> Result<(), WriteError> {
    match std::fs::remove_file(path) {
        Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
            Err(WriteError::Io { path: path.to_path_buf(), cause })
        }
        _ => Ok(()),
    }
}
