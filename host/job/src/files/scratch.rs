//! Folders for what work needs on its way, where the system keeps such: nobody finds anything there later.

use super::unfinished::{Unfinished, remove_left};
use std::fs;
use std::io;
use std::path::Path;
use tempfile::{Builder, TempDir};

/// What the names begin with.
const PREFIX: &str = "viewfuse-scratch-";

/// The file by which a folder is known for one of this program, and its content.
const MARK: (&str, &str) = ("scratch.txt", "A scratch folder of viewfuse: it goes with the run that made it.\n");

/// A scratch folder. It goes when this is dropped, and where the process ends at once ([`super::remove_all`]); what a
/// kill leaves is removed by the next process that makes one.
#[derive(Debug)]
pub struct Scratch {
    folder: TempDir,
    _unfinished: Unfinished,
}

impl Scratch {
    /// Makes one.
    ///
    /// # Errors
    /// What the system says.
    pub fn new() -> io::Result<Scratch> {
        let make = |builder: &mut Builder<'_, '_>| builder.tempdir();
        let (folder, unfinished) = Unfinished::make(PREFIX, make, |made: &TempDir| made.path().to_path_buf())?;
        fs::write(folder.path().join(MARK.0), MARK.1)?;
        remove_left(folder.path().parent().unwrap_or(Path::new("/")), PREFIX, is_scratch);
        Ok(Scratch { folder, _unfinished: unfinished })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Whether a folder is marked, or empty: a kill may have come before the mark.
fn is_scratch(folder: &Path) -> bool {
    let is_marked = || fs::read(folder.join(MARK.0)).is_ok_and(|text| text == MARK.1.as_bytes());
    let is_empty = || fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_none());
    folder.is_dir() && (is_marked() || is_empty())
}
