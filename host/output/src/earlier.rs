//! What an earlier run left in an output folder, as its record and its journal say.

use crate::journal::{FrameJournal, files_of};
use crate::record::{FrameRecord, RECORD};
use crate::video::VideoFormat;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Component, Path};
use viewfuse_job::files::read_at_most;
use viewfuse_scene::photographs::BackgroundChoice;

/// Most bytes of a run record. Larger ones are no records of this program.
const MAX_RECORD: u64 = 256 << 20;

/// What is read of a record.
#[derive(Deserialize)]
struct WrittenRecord {
    #[serde(rename = "viewfuse")]
    _program: String,
    frames: Vec<WrittenFrame>,
    background: Option<WrittenBackground>,
    /// None in records of before 2026-11-30.
    videos: Option<Vec<String>>,
}

/// A run that another one of the same settings may add frames to.
#[derive(Deserialize)]
pub(crate) struct EarlierRun {
    /// See [`RunRecord::settings`](crate::record::RunRecord::settings).
    #[serde(default)]
    pub(crate) settings: Option<String>,
    pub(crate) sources: Vec<String>,
    pub(crate) frames: Vec<FrameRecord>,
}

/// The run of the record in a folder; `None` without one, and for one that cannot be read.
pub(crate) fn earlier_run(folder: &Path) -> Option<EarlierRun> {
    serde_json::from_slice(&bytes_of_record(folder)?).ok()
}

#[derive(Deserialize)]
struct WrittenBackground {
    asked: String,
    used: [u8; 3],
}

#[derive(Deserialize)]
struct WrittenFrame {
    target: String,
    /// None in records of before 2026-11-30.
    files: Option<Vec<String>>,
}

/// Names of the targets of the record in a folder; `None` if the file is no record of a render. An empty one is: of a
/// machine that lost its power.
pub(crate) fn recorded_targets(folder: &Path) -> Option<Vec<String>> {
    if bytes_of_record(folder)?.is_empty() {
        return Some(Vec::new());
    }
    Some(recorded(folder)?.frames.into_iter().map(|frame| frame.target).collect())
}

fn recorded(folder: &Path) -> Option<WrittenRecord> {
    serde_json::from_slice(&bytes_of_record(folder)?).ok()
}

/// The files that the record in a folder lists; of an older one, which lists none, all that its run may have written.
fn recorded_files(folder: &Path) -> Vec<String> {
    let Some(record) = recorded(folder) else { return Vec::new() };
    let any_video = || VideoFormat::ALL.iter().map(|format| format!("video.{format}")).collect();
    let of_frame = |frame: WrittenFrame| frame.files.unwrap_or_else(|| files_of(&frame.target));
    let mut files = record.videos.unwrap_or_else(any_video);
    files.extend(record.frames.into_iter().flat_map(of_frame));
    files
}

/// The background that the run of a folder used, red green blue in `[0, 1]`; `Some(None)` if it had none, `None` if the
/// folder has no record.
pub fn recorded_background(folder: &Path) -> Option<Option<[f32; 3]>> {
    let record: WrittenRecord = serde_json::from_slice(&bytes_of_record(folder)?).ok()?;
    let WrittenBackground { asked, used } = record.background?;
    let is_none = asked == BackgroundChoice::None.to_string();
    Some((!is_none).then(|| used.map(|value| f32::from(value) / 255.0)))
}

fn bytes_of_record(folder: &Path) -> Option<Vec<u8>> {
    let path = folder.join(RECORD);
    // A pipe would keep its reader waiting.
    if path.is_file() { read_at_most(&path, MAX_RECORD).ok() } else { None }
}

/// Whether a run in a folder began and did not end: there is a journal, or the empty record of a machine that lost its
/// power.
pub(crate) fn was_interrupted(folder: &Path) -> bool {
    FrameJournal::is_in(folder) || bytes_of_record(folder).is_some_and(|bytes| bytes.is_empty())
}

/// The files that earlier runs wrote to a folder and that are there; the record and the journal themselves are not
/// among them. Nothing outside the folder, and no link.
pub(crate) fn earlier_files(folder: &Path) -> BTreeSet<String> {
    let finished = FrameJournal::files_of_any_run(folder);
    let is_there = |name: &String| {
        let is_inside = Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
        is_inside && folder.join(name).symlink_metadata().is_ok_and(|about| about.is_file())
    };
    recorded_files(folder).into_iter().chain(finished).filter(is_there).collect()
}
