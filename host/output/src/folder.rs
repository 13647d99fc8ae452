//! Checks of an output folder before work begins: what a run would destroy there, and targets whose files have one
//! name.

use crate::earlier::{earlier_files, files_of, recorded_targets, was_interrupted};
use crate::record::{RECORD, SUFFIXES};
use crate::video::VideoFormat;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_scene::few_shot::Target;

/// Why pictures cannot be written to a folder.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder belongs to something else.
    #[error("{}: is not the record of a render and would be replaced; give another folder", path.display())]
    OtherRecord {
        /// The file in the way.
        path: PathBuf,
    },
    /// A file that no run wrote is in the way.
    #[error("{}: no earlier run wrote this file, which would be replaced; give another folder, or move it", path.display())]
    NotWritten {
        /// The file.
        path: PathBuf,
    },
    /// An earlier run wrote other pictures there.
    #[error(
        "{}: has {count} files of an earlier run, {example} for one, which are not of these targets", folder.display()
    )]
    OtherRun {
        /// The folder.
        folder: PathBuf,
        /// How many files of the earlier run would stay.
        count: usize,
        /// One of them.
        example: String,
    },
    /// Two targets have files of one name.
    #[error("the targets '{first}' and '{second}' would both be written to {file}; render them to different folders")]
    SameFile {
        /// A target.
        first: String,
        /// Another one.
        second: String,
        /// The file's name.
        file: String,
    },
}

impl Hinted for OutputError {
    fn hint(&self) -> Option<Hint> {
        match self {
            OutputError::OtherRun { .. } => Some(Hint::OtherRun),
            _ => None,
        }
    }
}

/// The background that the run of a folder used, red green blue in `[0, 1]`; `Some(None)` if it had none, `None` if the
/// folder has no record.
pub fn recorded_background(folder: &Path) -> Option<Option<[f32; 3]>> {
    crate::earlier::recorded_background(folder)
}

/// Checks that the pictures of these targets, and these videos of them, can be written to a folder: no two files have
/// one name, there is no record of anything but an earlier render, none replaces a file that no run wrote, and, unless
/// `replaces` is set, no picture of an earlier render would stay beside the new ones. (With it, such pictures are
/// removed when the first new one is written.)
///
/// # Errors
/// [`OutputError`].
pub fn check_folder(
    folder: &Path,
    targets: &[Target],
    videos: &[VideoFormat],
    replaces: bool,
) -> Result<(), OutputError> {
    let mut owners: HashMap<String, &str> = HashMap::new();
    for Target { name, .. } in targets {
        for suffix in SUFFIXES {
            let file = format!("{name}{suffix}.png");
            if let Some(first) = owners.insert(file.clone(), name) {
                return Err(OutputError::SameFile { first: first.to_owned(), second: name.clone(), file });
            }
        }
    }
    let path = folder.join(RECORD);
    if path.exists() && recorded_targets(folder).is_none() {
        return Err(OutputError::OtherRecord { path });
    }
    let own: BTreeSet<String> = targets.iter().flat_map(|target| files_of(&target.name)).collect();
    let earlier = earlier_files(folder);
    // What a run was writing when it was killed is in no list yet.
    if !was_interrupted(folder) {
        let videos = videos.iter().map(|format| format!("video.{format}"));
        let is_in_the_way = |file: &String| !earlier.contains(file) && folder.join(file).symlink_metadata().is_ok();
        if let Some(file) = own.iter().cloned().chain(videos).find(is_in_the_way) {
            return Err(OutputError::NotWritten { path: folder.join(file) });
        }
    }
    // A video is of the whole run, and goes with its record.
    let mut others: Vec<String> = earlier.difference(&own).cloned().collect();
    others.retain(|name| !name.starts_with("video."));
    match others.first() {
        Some(example) if !replaces => {
            let (folder, count, example) = (folder.to_path_buf(), others.len(), example.clone());
            Err(OutputError::OtherRun { folder, count, example })
        }
        _ => Ok(()),
    }
}
