//! A folder one of whose files is broken at a time.

use super::folder;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The folder. The first byte of an input says which file the rest replaces.
pub(super) struct Files {
    folder: TempDir,
    files: Vec<(PathBuf, Vec<u8>)>,
    /// The one that differs.
    last: Option<usize>,
    /// Puts the bytes into what the file is made of.
    wrap: fn(&[u8]) -> Vec<u8>,
}

impl Files {
    /// Files by their names in the folder.
    pub(super) fn new(files: &[(&str, Vec<u8>)]) -> Files {
        Files::wrapped(files, <[u8]>::to_vec)
    }

    /// The same for files in which something right is around the bytes.
    pub(super) fn wrapped(files: &[(&str, Vec<u8>)], wrap: fn(&[u8]) -> Vec<u8>) -> Files {
        let folder = folder();
        let file = |(name, bytes): &(&str, Vec<u8>)| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            fs::write(&path, wrap(bytes)).expect("a file");
            (path, bytes.clone())
        };
        let files = files.iter().map(file).collect();
        Files { folder, files, last: None, wrap }
    }

    pub(super) fn path(&self) -> &Path {
        self.folder.path()
    }

    pub(super) fn seeds(&self) -> Vec<Vec<u8>> {
        let seed = |(index, (_, bytes)): (usize, &(PathBuf, Vec<u8>))| [&[index as u8], bytes.as_slice()].concat();
        self.files.iter().enumerate().map(seed).collect()
    }

    pub(super) fn write(&mut self, input: &[u8]) {
        let (first, rest) = input.split_first().unwrap_or((&0, &[]));
        let index = usize::from(*first) % self.files.len();
        if let Some(last) = self.last.filter(|last| *last != index) {
            let (path, whole) = &self.files[last];
            fs::write(path, (self.wrap)(whole)).expect("a file");
        }
        self.last = Some(index);
        fs::write(&self.files[index].0, (self.wrap)(rest)).expect("a file");
    }
}
