//! Output files that appear whole or not at all.

use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Why an output could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The operating system refused.
    #[error("{}: cannot be written: {cause}", path.display())]
    Io {
        /// The file that was to appear.
        path: PathBuf,
        /// What the system said.
        cause: std::io::Error,
    },
    /// The picture could not be encoded.
    #[error("{}: cannot be encoded: {cause}", path.display())]
    Encode {
        /// The file that was to appear.
        path: PathBuf,
        /// What the encoder said.
        cause: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// A file that is written piece by piece and appears when it is finished. Dropped before, it leaves nothing behind.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    writer: BufWriter<NamedTempFile>,
}

impl WholeFile {
    /// Begins a file. Until it is finished it is a temporary one beside `path`. Missing folders are made.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn create(path: &Path) -> Result<WholeFile, WriteError> {
        let failed = |cause| WriteError::Io { path: path.to_path_buf(), cause };
        let folder = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        std::fs::create_dir_all(folder).map_err(failed)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(".viewfuse-");
        // The default is readable by the owner only, which is wrong for a result.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o644));
        }
        let writer = BufWriter::new(builder.tempfile_in(folder).map_err(failed)?);
        Ok(WholeFile { path: path.to_path_buf(), writer })
    }

    /// Adds bytes.
    ///
    /// # Errors
    /// [`WriteError::Io`].
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
        self.writer.write_all(bytes).map_err(|cause| WriteError::Io { path: self.path.clone(), cause })
    }

    /// Makes it appear, in place of what may have been there.
    ///
    /// # Errors
    /// [`WriteError::Io`]; nothing is left behind then.
    pub fn finish(self) -> Result<(), WriteError> {
        let WholeFile { path, writer } = self;
        let finished = writer
            .into_inner()
            .map_err(|error| error.into_error())
            .and_then(|file| file.persist(&path).map_err(|error| error.error));
        finished.map(drop).map_err(|cause| WriteError::Io { path, cause })
    }
}

/// Writes `bytes` to a temporary file beside `path` and renames it into place. Missing folders are made.
///
/// # Errors
/// [`WriteError::Io`]; nothing is left behind then.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    let mut file = WholeFile::create(path)?;
    file.write(bytes)?;
    file.finish()
}

/// Checks, before long work, that a file can appear at `path`: it is no folder, and the nearest folder above it that
/// exists takes new files. Nothing is left behind.
///
/// # Errors
/// [`WriteError::Io`].
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let failed = |cause| WriteError::Io { path: path.to_path_buf(), cause };
    if path.is_dir() {
        return Err(failed(std::io::Error::other("it is a folder")));
    }
    let above = || path.ancestors().skip(1).map(|folder| if folder == "" { Path::new(".") } else { folder });
    let Some(nearest) = above().find(|folder| folder.exists()) else { return Ok(()) };
    if !nearest.is_dir() {
        return Err(failed(std::io::Error::other(format!("{} is not a folder", nearest.display()))));
    }
    tempfile::tempfile_in(nearest).map_err(failed)?;
    Ok(())
}

/// Removes a file; that it is not there is no error.
///
/// # Errors
/// [`WriteError::Io`] if the system refuses.
pub fn remove_if_there(path: &Path) -> Result<(), WriteError> {
    match std::fs::remove_file(path) {
        Err(cause) if cause.kind() != std::io::ErrorKind::NotFound => {
            Err(WriteError::Io { path: path.to_path_buf(), cause })
        }
        _ => Ok(()),
    }
}
