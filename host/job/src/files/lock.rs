//! One process at a time for a folder.

use super::WriteError;
use std::fs::{File, TryLockError};
use std::path::Path;

/// A folder that no other process locks until this is dropped, or the process ends.
#[derive(Debug)]
pub struct FolderLock(Option<File>);

impl FolderLock {
    /// Locks a folder. File systems without locks, and systems that do not open folders, still work: then nothing is
    /// locked.
    ///
    /// # Errors
    /// [`WriteError::Busy`] while another process has locked it.
    pub fn take(folder: &Path) -> Result<FolderLock, WriteError> {
        let Ok(file) = File::open(folder) else { return Ok(FolderLock(None)) };
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(WriteError::Busy { path: folder.to_path_buf() }),
            Err(TryLockError::Error(_)) => Ok(FolderLock(None)),
            Ok(()) => Ok(FolderLock(Some(file))),
        }
    }

    /// Whether there is a lock.
    pub fn is_held(&self) -> bool {
        self.0.is_some()
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::FolderLock;

    #[test]
    fn one_at_a_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = FolderLock::take(folder.path()).expect("free");
        assert!(first.is_held() && FolderLock::take(folder.path()).is_err());
        drop(first);
        assert!(FolderLock::take(folder.path()).expect("free again").is_held());
        assert!(!FolderLock::take(&folder.path().join("missing")).expect("nothing to lock").is_held());
    }
}
