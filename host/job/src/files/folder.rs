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
    /// If the system reports an error; then nothing of it remains, and an empty folder in its place does.
    pub fn finish(self) -> io::Result<()> {
        let from = self.path();
        let WholeFolder { path, temporary, unfinished } = self;
        unfinished.finish(|| {
            let renamed = fs::rename(&from, &path);
            if renamed.is_ok() || !path.is_dir() || !from.is_dir() {
                return renamed;
            }
            // Not every system renames over an empty folder.
            fs::remove_dir(&path)?;
            fs::rename(&from, &path).inspect_err(|_| {
                let _ = fs::create_dir(&path);
            })
        })?;
        temporary.close()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_empty_folder_is_replaced_or_left_alone() {
        let scratch = tempfile::tempdir().expect("a folder");
        let names = |folder: &Path| -> Vec<String> {
            let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
            entries.map(|name| name.to_string_lossy().into_owned()).collect()
        };
        let path = scratch.path().join("out");
        fs::create_dir(&path).expect("a folder");
        // A rename that fails: somebody has removed what is to be renamed.
        let folder = WholeFolder::create(&path).expect("a folder");
        fs::remove_dir(folder.path()).expect("an empty folder");
        assert!(folder.finish().is_err());
        assert_eq!(names(scratch.path()), ["out"]);
        assert_eq!(names(&path), [""; 0]);
        let folder = WholeFolder::create(&path).expect("a folder");
        fs::write(folder.path().join("a.txt"), "a").expect("a file");
        folder.finish().expect("a rename");
        assert_eq!(names(&path), ["a.txt"]);
        // What is in a folder stays.
        let folder = WholeFolder::create(&path).expect("a folder");
        assert!(folder.finish().is_err());
        assert_eq!(names(scratch.path()), ["out"]);
        assert_eq!(names(&path), ["a.txt"]);
    }
}
