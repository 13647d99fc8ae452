//! One process at a time for a folder.

use super::WriteError;
use std::fs::{File, TryLockError};
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A folder that no other process locks until this is dropped, or the process ends.
#[derive(Debug)]
pub struct FolderLock {
    _file: Option<File>,
}

impl FolderLock {
    /// Locks a folder. File systems without locks, and systems that do not open folders, still work: then nothing is
    /// locked.
    ///
    /// # Errors
    /// [`WriteError::Busy`] while another process has locked it.
    pub fn take(folder: &Path) -> Result<FolderLock, WriteError> {
        let Ok(file) = File::open(folder) else { return Ok(FolderLock { _file: None }) };
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => Err(WriteError::Busy(folder.to_path_buf())),
            Err(TryLockError::Error(_)) => Ok(FolderLock { _file: None }),
            Ok(()) => Ok(FolderLock { _file: Some(file) }),
        }
    }

    /// As [`FolderLock::take`], but waits for other processes, at most so long.
    ///
    /// # Errors
    /// [`WriteError::Busy`] if another process still has the lock then.
    pub fn wait(folder: &Path, longest: Duration) -> Result<FolderLock, WriteError> {
        let start = Instant::now();
        loop {
            match FolderLock::take(folder) {
                Err(WriteError::Busy { .. }) if start.elapsed() < longest => sleep(Duration::from_millis(5)),
                outcome => return outcome,
            }
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::{Duration, FolderLock};

    #[test]
    fn one_at_a_time() {
        let folder = tempfile::tempdir().expect("a folder");
        let first = FolderLock::take(folder.path()).expect("free");
        assert!(first._file.is_some() && FolderLock::take(folder.path()).is_err());
        assert!(FolderLock::wait(folder.path(), Duration::from_millis(20)).is_err(), "another one has it for longer");
        let waiting = std::thread::scope(|scope| {
            let waiting = scope.spawn(|| FolderLock::wait(folder.path(), Duration::from_secs(60)));
            drop(first);
            waiting.join().expect("no panic")
        });
        assert!(waiting.expect("it became free")._file.is_some());
        assert!(FolderLock::take(&folder.path().join("missing")).expect("nothing to lock")._file.is_none());
    }
}
