//! The record `pose.json` beside a scene whose poses were found (`viewfuse pose`): which of them are doubtful, and for
//! how many photographs there are none, is said whenever the scene is opened.

use std::path::Path;

use serde::Deserialize;
use serde::de::IgnoredAny;
use viewfuse_job::files::read_at_most;
use viewfuse_job::text::listed;

use super::View;

/// The record's file.
const RECORD: &str = "pose.json";

/// Most bytes of a record.
const MAX_BYTES: u64 = 16 << 20;

/// Most photographs that are named.
const MAX_NAMES: usize = 8;

/// What is read of a record.
#[derive(Deserialize)]
struct FoundPoses {
    files: Vec<IgnoredAny>,
    accepted: Vec<Accepted>,
    left_out: Vec<(String, String)>,
}

#[derive(Deserialize)]
struct Accepted {
    photograph: String,
    #[serde(default)]
    verdict: String,
}

/// Warnings of the record beside a scene; `root` is the scene's folder or a file in it. A file of this name that is no
/// such record is none of ours.
pub(super) fn warnings(root: &Path, views: &[View]) -> Vec<String> {
    let folder = if root.is_dir() { Some(root) } else { root.parent() };
    let path = folder.unwrap_or(root).join(RECORD);
    let Some(record) = read_at_most(&path, MAX_BYTES).ok().and_then(|text| serde_json::from_slice(&text).ok()) else {
        return Vec::new();
    };
    let FoundPoses { files, accepted, left_out: excluded } = record;
    let mut warnings = Vec::new();
    let is_view = |name: &str| views.iter().any(|view| view.name == name);
    let doubtful = accepted.iter().filter(|photo| photo.verdict == "doubtful" && is_view(&photo.photograph));
    let doubtful: Vec<&str> = doubtful.map(|photo| photo.photograph.as_str()).collect();
    if !doubtful.is_empty() {
        let (some, all) = (doubtful.len(), accepted.len());
        warnings.push(format!(
            "{}: {some} of {all} poses are doubtful ({})",
            path.display(),
            listed(&doubtful, MAX_NAMES)
        ));
    }
    if accepted.len() < files.len() {
        let names: Vec<&str> = excluded.iter().map(|(name, _)| name.as_str()).collect();
        let (some, all) = (accepted.len(), files.len());
        let path = path.display();
        warnings.push(format!(
            "{path}: poses were found for {some} of {all} photographs (without {})",
            listed(&names, MAX_NAMES)
        ));
    }
    warnings
}
