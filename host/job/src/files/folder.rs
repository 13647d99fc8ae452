//! Output folders that appear completely or not at all.

use super::folder_of;
use super::unfinished::{PREFIX, Unfinished, clean};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// A folder that is filled under a temporary name beside its own and appears when it is finished. Dropped before that,
/// it leaves nothing.
#[derive(Debug)]
pub struct WholeFolder {
    path: PathBuf,
    temporary: TempDir,
    unfinished: Unfinished,
}

impl WholeFolder {
    /// Begins the folder `path`; its parent is created where it is missing.
    ///
    /// # Errors
    /// If `path` does not end in a name, or the system reports an error.
    pub fn create(path: &Path) -> io::Result<WholeFolder> {
        let name = path.file_name().ok_or_else(|| io::Error::other("it does not name a folder"))?;
        let parent = folder_of(path);
        fs::create_dir_all(parent)?;
        clean(parent);
        let make = |builder: &mut tempfile::Builder<'_, '_>| builder.tempdir_in(parent);
        let (temporary, unfinished) = Unfinished::make(PREFIX, make, |made: &TempDir| made.path().to_path_buf())?;
        // A temporary folder is closed to others; the result, a folder inside it, has the ordinary permissions.
        fs::create_dir(temporary.path().join(name))?;
        Ok(WholeFolder { path: path.to_path_buf(), temporary, unfinished })
    }

    /// Where to put its files.
    pub fn path(&self) -> PathBuf {
        self.temporary.path().join(self.path.file_name().unwrap_or_default())
    }

    /// Renames it into place; an empty folder is replaced.
    ///
    /// # Errors
    /// If the system reports an error; then nothing remains.
    pub fn finish(self) -> io::Result<()> {
        let from = self.path();
        let WholeFolder { path, temporary, unfinished } = self;
        unfinished.finish(|| {
            if path.is_dir() {
                fs::remove_dir(&path)?;
            }
            fs::rename(from, &path)
        })?;
        temporary.close()
    }
}
