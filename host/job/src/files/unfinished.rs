//! Temporary files and folders of outputs that are not finished.
//!
//! Each is locked by its process. A process that ends at once removes its own ([`remove_all`]). What a kill leaves is
//! removed by the next process that writes to the same folder, which finds it without a lock. On file systems without
//! locks it stays.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use tempfile::Builder;

/// What the names of temporary files begin with: nothing that a person's own files may be called.
pub(super) const PREFIX: &str = ".viewfuse-unfinished-";
/// Random characters behind it.
const RANDOM: usize = 6;
/// How many times a temporary file is made again that another process took for one that a kill left.
const ATTEMPTS: usize = 8;

/// Temporary files and folders of this process.
static OF_THIS_PROCESS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
/// Folders in which this process has already looked for what a kill left.
static CLEANED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files and folders of this process, which must end next: from here on every output waits
/// forever instead of being finished or begun.
pub fn remove_all() {
    let paths = lock(&OF_THIS_PROCESS);
    for path in paths.iter() {
        // A folder is no file. What cannot be removed stays, as after a kill.
        if fs::remove_file(path).is_err() {
            let _ = fs::remove_dir_all(path);
        }
    }
    std::mem::forget(paths);
}

/// A temporary file or folder of this process, until it is finished.
#[derive(Debug)]
pub(super) struct Unfinished {
    path: PathBuf,
    /// Keeps the lock.
    _locked: Option<File>,
}

impl Unfinished {
    /// Makes a temporary file or folder with a name that begins with `prefix` by `make`, locks it and lists it.
    /// Callers look before it for what a kill left ([`clean`]).
    pub(super) fn make<T>(
        prefix: &str,
        make: impl Fn(&mut Builder<'_, '_>) -> io::Result<T>,
        place: impl Fn(&T) -> PathBuf,
    ) -> io::Result<(T, Unfinished)> {
        let mut builder = Builder::new();
        builder.prefix(prefix).rand_bytes(RANDOM);
        let mut attempt = 0;
        loop {
            // Nothing is begun while the process ends.
            let mut paths = lock(&OF_THIS_PROCESS);
            let made = make(&mut builder)?;
            let path = place(&made);
            // A folder cannot be opened on every system: it is then not recognised after a kill.
            let locked = File::open(&path).ok().map(|file| (file.try_lock(), file));
            attempt += 1;
            // Between making and locking, another process may have taken it for one that a kill left, or be about to.
            let is_taken = matches!(locked, Some((Err(TryLockError::WouldBlock), _))) || !path.exists();
            if !is_taken || attempt == ATTEMPTS {
                paths.insert(path.clone());
                let locked = locked.and_then(|(outcome, file)| outcome.is_ok().then_some(file));
                return Ok((made, Unfinished { path, _locked: locked }));
            }
        }
    }

    /// Renames it to its final name by `rename`; while the process ends, this waits forever.
    pub(super) fn finish<T>(self, rename: impl FnOnce() -> io::Result<T>) -> io::Result<T> {
        let paths = lock(&OF_THIS_PROCESS);
        let renamed = rename();
        drop(paths);
        renamed
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        lock(&OF_THIS_PROCESS).remove(&self.path);
    }
}

/// Removes what killed processes left in a folder; once for each process and folder.
pub(super) fn clean(folder: &Path) {
    let whole = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_path_buf());
    if lock(&CLEANED).insert(whole) {
        remove_unfinished(folder);
    }
}

/// Removes the temporary files and folders that killed processes left in a folder.
pub fn remove_unfinished(folder: &Path) {
    remove_left(folder, PREFIX, |_| true);
}

/// Removes what killed processes left in a folder under names with this prefix, where `is_removable` says so, too.
pub(super) fn remove_left(folder: &Path, prefix: &str, is_removable: impl Fn(&Path) -> bool) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        // No links, and nothing that waits for a writer when it is opened.
        let is_of_kind = entry.file_type().is_ok_and(|kind| kind.is_file() || kind.is_dir());
        let is_named_so = is_temporary(&entry.file_name().to_string_lossy(), prefix);
        if is_of_kind && is_named_so && !lock(&OF_THIS_PROCESS).contains(&path) {
            // Only of what nobody has locked.
            let Ok(file) = File::open(&path) else { continue };
            if file.try_lock().is_ok() && is_removable(&path) && fs::remove_file(&path).is_err() {
                let _ = fs::remove_dir_all(&path);
            }
        }
    }
}

/// Whether a name is one that temporary files get.
fn is_temporary(name: &str, prefix: &str) -> bool {
    name.strip_prefix(prefix)
        .is_some_and(|rest| rest.len() == RANDOM && rest.bytes().all(|byte| byte.is_ascii_alphanumeric()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_temporary_names_are() {
        let is_ours = |name: &str| is_temporary(name, PREFIX);
        assert!(is_ours(&format!("{PREFIX}aB3xYz")));
        for rest in ["", "aB3xY", "aB3xYzz", "a.3xYz"] {
            assert!(!is_ours(&format!("{PREFIX}{rest}")), "{rest}");
        }
        // What a person may call a file.
        assert!(![".viewfuse-backup", ".unfinished-drafts", "viewfuse-unfinished-aB3xYz"].into_iter().any(is_ours));
    }
}
