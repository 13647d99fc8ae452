//! The scene with its record, whole or not at all.

use crate::advice::Neighbours;
use crate::attempt::Tried;
use crate::find::{Found, Options};
use crate::focal::FocalSource;
use crate::intake::{IntakeError, Unusable, files_in};
use crate::trust::Verified;
use crate::verdict::Verdict;
use serde::{Deserialize, Serialize};
use std::path::Path;
use viewfuse_job::progress::Progress;
use viewfuse_scene::write::{Layout, WriteSceneError, Written, write_with};

/// The record's file.
const RECORD: &str = "pose.json";

/// The record of how a scene's poses were found.
#[derive(Debug, Serialize)]
pub struct Record<'a> {
    /// This crate's version.
    pub viewfuse: &'static str,
    /// The folder of the photographs.
    pub photographs: String,
    /// All that were taken, usable or not: names and lengths in bytes.
    pub files: &'a [(String, u64)],
    /// The seed.
    pub seed: u64,
    /// Every so many photographs were taken.
    pub every: usize,
    /// The cameras of the accepted attempt.
    pub cameras: Vec<CameraRecord>,
    /// Mean reprojection error of its points in pixels at working size.
    pub reprojection_error: f64,
    /// Its place among the attempts.
    pub attempt: usize,
    /// Every attempt.
    pub attempts: Vec<&'a Tried>,
    /// The accepted photographs with what they passed.
    pub accepted: &'a [Verified],
    /// Photographs that were excluded, each with the reason.
    #[serde(rename = "left_out")]
    pub excluded: Vec<(String, String)>,
    /// Which photographs match which, and how often.
    pub matches: Vec<(&'a str, &'a str, usize)>,
    /// The accepted ones as neighbours.
    pub neighbours: Neighbours,
}

/// A camera of the record.
#[derive(Debug, Serialize)]
pub struct CameraRecord {
    /// Width and height of its photographs.
    pub size: [u32; 2],
    /// How many photographs it took.
    pub photographs: usize,
    /// Focal length in pixels.
    pub focal: f64,
    /// Where the focal length comes from; it is refined with the poses.
    pub focal_from: FocalSource,
    /// What was given, or the photographs state, in pixels.
    pub stated_focal: Option<f64>,
    /// Radial distortion `k1`.
    pub k1: f64,
}

/// Most distortion at the corners of a photograph by a lens whose focal length is at least its longer side, as a share
/// of their distance from the middle.
const MAX_DISTORTION: f64 = 0.03;

impl CameraRecord {
    /// Whether the lens distorts more than lenses of such a focal length do: what crops that differ make of it.
    pub fn is_doubtful(&self) -> bool {
        let [width, height] = self.size.map(f64::from);
        let corner = width.hypot(height) / 2.0 / self.focal;
        self.focal >= width.max(height) && self.k1.abs() * corner * corner > MAX_DISTORTION
    }
}

impl Found {
    /// The photographs of the folder that a verdict does not accept, by file, each with the reason.
    pub fn excluded(&self, verdict: Option<&Verdict>) -> Vec<(String, String)> {
        let said = |file: &Unusable| (file.name.clone(), file.reason.clone());
        let mut all: Vec<(String, String)> = self.intake.unusable.iter().map(said).collect();
        let passed_over = self.intake.passed_over.iter().map(said);
        let Some(verdict) = verdict else { return all.into_iter().chain(passed_over).collect() };
        for (index, photo) in self.intake.photos.iter().enumerate() {
            if verdict.photos.contains(&index) {
                continue;
            }
            let taken_out =
                verdict.taken_out.iter().find(|(photo, _)| *photo == index).map(|(_, reason)| reason.clone());
            let is_tied = verdict.photos.iter().any(|accepted| self.matches.are_tied(index, *accepted));
            let what = if is_tied { "too little of" } else { "none of" };
            let matched =
                || format!("matches {what} the accepted photographs enough for a pose ({})", self.matches.told(index));
            let reason = taken_out.unwrap_or_else(matched);
            all.push((photo.file.clone(), reason));
        }
        all.sort();
        all.extend(passed_over);
        all
    }

    /// The record of an accepted verdict.
    pub fn record<'a>(&'a self, verdict: &'a Verdict, options: &Options) -> Record<'a> {
        let attempt = &self.attempts[verdict.attempt];
        let k1 = |index: usize| verdict.solution.cameras.get(index).map_or(0.0, |camera| camera.k1);
        let cameras = self.cameras.groups.iter().enumerate().map(|(index, group)| CameraRecord {
            size: group.size,
            photographs: group.photos.iter().filter(|photo| verdict.photos.contains(photo)).count(),
            focal: attempt.tried.focal.get(index).copied().unwrap_or_default(),
            focal_from: group.source,
            stated_focal: group.focal,
            k1: k1(index),
        });
        Record {
            viewfuse: env!("CARGO_PKG_VERSION"),
            photographs: self.intake.folder.display().to_string(),
            files: &self.intake.files,
            seed: options.seed,
            every: options.every,
            cameras: cameras.filter(|camera| camera.photographs > 0).collect(),
            reprojection_error: attempt.tried.reprojection_error,
            attempt: verdict.attempt,
            attempts: self.attempts.iter().map(|attempt| &attempt.tried).collect(),
            accepted: &verdict.verified,
            excluded: self.excluded(Some(verdict)),
            matches: self.matches.named().collect(),
            neighbours: Neighbours::of(&verdict.scene),
        }
    }
}

/// Writes the accepted scene in a layout to a folder that does not exist or is empty, with the record `pose.json` and
/// more files. The same photographs and options give the same bytes, but for the seconds in the record.
///
/// # Errors
/// [`WriteSceneError`]; no files remain then.
pub fn write(
    found: &Found,
    verdict: &Verdict,
    options: &Options,
    (layout, folder): (Layout, &Path),
    beside: &[(&str, Vec<u8>)],
    progress: &dyn Progress,
) -> Result<Written, WriteSceneError> {
    let failed = |cause: serde_json::Error| WriteSceneError::Io(folder.join(RECORD), cause.into());
    let mut record = serde_json::to_vec_pretty(&found.record(verdict, options)).map_err(failed)?;
    record.push(b'\n');
    let mut files = vec![(RECORD, record)];
    files.extend(beside.iter().cloned());
    write_with(&verdict.scene, layout, folder, &files, progress)
}

/// Whether [`write()`] wrote a folder.
pub fn has_record(posed: &Path) -> bool {
    let record = std::fs::read(posed.join(RECORD)).unwrap_or_default();
    serde_json::from_slice::<Earlier>(&record).is_ok()
}

/// What of a record tells whether a scene is still that of a folder.
#[derive(Deserialize)]
struct Earlier {
    files: Vec<(String, u64)>,
}

/// Whether [`write()`] wrote the scene in `posed` for the photographs that a folder has now, by their names and
/// lengths.
///
/// # Errors
/// [`IntakeError`] if the folder's photographs cannot be listed.
pub fn is_current(posed: &Path, photographs: &Path) -> Result<bool, IntakeError> {
    let now = files_in(photographs)?;
    let record = std::fs::read(posed.join(RECORD)).unwrap_or_default();
    Ok(serde_json::from_slice::<Earlier>(&record).is_ok_and(|earlier| earlier.files == now))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_lens_that_distorts_is_doubtful() {
        let camera = |focal: f64, k1: f64| CameraRecord {
            size: [240, 180],
            photographs: 8,
            focal,
            focal_from: FocalSource::Unknown,
            stated_focal: None,
            k1,
        };
        assert!(camera(388.0, -0.342).is_doubtful(), "what crops that differ gave");
        assert!(!camera(388.0, -0.02).is_doubtful());
        assert!(!camera(140.0, -0.25).is_doubtful(), "a wide angle");
    }
}
