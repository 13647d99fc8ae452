//! Checks of an output folder before work begins: what a run would destroy there, and targets whose files have one
//! name.

pub use crate::earlier::recorded_background;

use crate::earlier::{earlier_files, earlier_run, recorded_targets, was_interrupted};
use crate::journal::files_of;
use crate::record::{FrameRecord, RECORD, SUFFIXES};
use crate::video::VideoFormat;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_scene::SceneFrame;
use viewfuse_scene::few_shot::Target;

/// Relative difference of the numbers of one pose.
const SAME_POSE: f64 = 1.0e-9;

/// Why pictures cannot be written to a folder.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The file in the way is that of something else.
    #[error("{0}: is not the record of a render and would be replaced; give another folder")]
    OtherRecord(PathBuf),
    /// A file that no run wrote is in the way.
    #[error("{0}: no earlier run wrote this file, which would be replaced; give another folder, or move it")]
    NotWritten(PathBuf),
    /// An earlier run wrote other pictures, or a video, there.
    #[error(
        "{}: has {count} file{} of an earlier run, {example} for one, which this run does not write, and cannot be \
         added to: {reason}", folder.display(), if *count == 1 { "" } else { "s" }
    )]
    OtherRun {
        /// The folder.
        folder: PathBuf,
        /// How many files of the earlier run would stay.
        count: usize,
        /// One of them.
        example: String,
        /// Why the new pictures cannot stand beside them.
        reason: &'static str,
    },
    /// Two targets have files of one name, which comes last.
    #[error("the targets '{0}' and '{1}' would both be written to {2}; render them to different folders")]
    SameFile(String, String, String),
}

impl Hinted for OutputError {
    fn hint(&self) -> Option<Hint> {
        match self {
            OutputError::OtherRun { .. } => Some(Hint::OtherRun),
            _ => None,
        }
    }
}

/// What a render is about to write to a folder.
#[derive(Clone, Copy, Debug)]
pub struct Planned<'a> {
    /// Its targets.
    pub targets: &'a [Target],
    /// Names of its sources.
    pub sources: &'a [String],
    /// The videos that it makes of its pictures.
    pub videos: &'a [VideoFormat],
    /// Its settings ([`crate::record::RunRecord::settings`]), if it may add to an earlier run.
    pub settings: Option<&'a str>,
    /// Where poses are recorded.
    pub frame: &'a SceneFrame,
    /// Whether pictures of an earlier run may go.
    pub replaces: bool,
}

/// Checks that the pictures of these targets, and these videos of them, can be written to a folder: no two files have
/// one name, there is no record of anything but an earlier render, none replaces a file that no run wrote, and, unless
/// `replaces` is set, no picture of an earlier render would stay beside the new ones but those of a run with the same
/// settings: the frames of its record that stay are returned. (With `replaces`, others are removed when the first new
/// one is written.)
///
/// # Errors
/// [`OutputError`].
pub fn check_folder(folder: &Path, planned: &Planned<'_>) -> Result<Vec<FrameRecord>, OutputError> {
    let Planned { targets, videos, replaces, .. } = *planned;
    let mut owners: HashMap<String, &str> = HashMap::new();
    for Target { name, .. } in targets {
        for suffix in SUFFIXES {
            let file = format!("{name}{suffix}.png");
            if let Some(first) = owners.insert(file.clone(), name) {
                return Err(OutputError::SameFile(first.to_owned(), name.clone(), file));
            }
        }
    }
    let path = folder.join(RECORD);
    if path.exists() && recorded_targets(folder).is_none() {
        return Err(OutputError::OtherRecord(path));
    }
    let videos: Vec<String> = videos.iter().map(|format| format!("video.{format}")).collect();
    let written: BTreeSet<String> = targets.iter().flat_map(|target| files_of(&target.name)).chain(videos).collect();
    let earlier = earlier_files(folder);
    // What a run was writing when it was killed is in no list yet.
    if !was_interrupted(folder) {
        let is_in_the_way = |file: &String| !earlier.contains(file) && folder.join(file).symlink_metadata().is_ok();
        if let Some(file) = written.iter().find(|file| is_in_the_way(file)) {
            return Err(OutputError::NotWritten(folder.join(file)));
        }
    }
    let others: Vec<String> = earlier.difference(&written).cloned().collect();
    match others.first() {
        Some(example) if !replaces => frames_that_stay(folder, planned, &others).map_err(|reason| {
            let (folder, count, example) = (folder.to_path_buf(), others.len(), example.clone());
            OutputError::OtherRun { folder, count, example, reason }
        }),
        _ => Ok(Vec::new()),
    }
}

/// The frames of the record in a folder that these targets are added to, or why they cannot be. `others` are the files
/// of earlier runs that the new pictures do not replace.
fn frames_that_stay(folder: &Path, planned: &Planned<'_>, others: &[String]) -> Result<Vec<FrameRecord>, &'static str> {
    let Planned { targets, sources, videos, settings, frame, .. } = *planned;
    let earlier = earlier_run(folder).ok_or("there is no record of them")?;
    let (Some(settings), Some(before)) = (settings, earlier.settings) else {
        return Err("one of the records has no settings");
    };
    if earlier.sources != sources {
        return Err("their sources were others (a target that is held out is no source)");
    }
    if before != settings {
        return Err("their settings were others");
    }
    let has_video = others.iter().any(|file| file.starts_with("video."));
    if has_video || !videos.is_empty() {
        return Err("a video is of all pictures of one run");
    }
    let is_same = |a: &[[f64; 4]; 4], b: &[[f64; 4]; 4]| {
        // As text a number may differ in its last bit.
        a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() <= SAME_POSE * (1.0 + a.abs()))
    };
    let replaced = |frame_before: &FrameRecord| targets.iter().find(|target| target.name == frame_before.target);
    let moved = |frame_before: &FrameRecord| {
        replaced(frame_before).is_some_and(|target| {
            !is_same(&frame.file_from_camera(&target.camera.pose), &frame_before.world_from_camera)
        })
    };
    if earlier.frames.iter().any(moved) {
        return Err("cameras of the same names were elsewhere");
    }
    let stay: Vec<FrameRecord> =
        earlier.frames.into_iter().filter(|frame_before| replaced(frame_before).is_none()).collect();
    let files: BTreeSet<String> = stay.iter().flat_map(|frame_before| files_of(&frame_before.target)).collect();
    match others.iter().all(|file| files.contains(file)) {
        true => Ok(stay),
        false => Err("another run was interrupted there"),
    }
}
