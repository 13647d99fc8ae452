//! From a folder of photographs to a verdict.

use crate::attempt::{Attempt, attempts};
use crate::focal::Cameras;
use crate::intake::{Intake, IntakeError, crop_warning};
use crate::matches::Matches;
use crate::solution::{Solver, SolverError};
use crate::verdict::{Refusal, Verdict, verdict};
use std::path::Path;
use viewfuse_field::render::RenderError;
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::progress::{Part, Progress};

/// What a person may choose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Focal length in pixels of the first photograph; `None` takes what the photographs state, or finds it.
    pub focal: Option<f64>,
    /// Seed of every random draw.
    pub seed: u64,
    /// Every so many photographs are taken.
    pub every: usize,
}

impl Default for Options {
    fn default() -> Options {
        Options { focal: None, seed: 0, every: 1 }
    }
}

/// What was found.
#[derive(Debug)]
pub struct Found {
    /// The photographs.
    pub intake: Intake,
    /// Their cameras before the work.
    pub cameras: Cameras,
    /// The attempts.
    pub attempts: Vec<Attempt>,
    /// Which photographs match which.
    pub matches: Matches,
    /// The verdict.
    pub verdict: Result<Verdict, Refusal>,
}

/// Why poses could not be looked for.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The photographs.
    #[error(transparent)]
    Intake(#[from] IntakeError),
    /// A solver.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// So many photographs of a folder can be used, too few; and those that cannot, with reasons.
    #[error("{0}: {1} of the photographs can be used, three are needed{2}")]
    Few(String, usize, String),
    /// A photograph changed while the work went on, a pose is none, or a photograph that was held out could not be
    /// rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
}

impl Hinted for PoseError {
    fn hint(&self) -> Option<Hint> {
        match self {
            PoseError::Intake(error) => error.hint(),
            PoseError::Solver(error) => error.hint(),
            _ => None,
        }
    }
}

/// Looks for the poses of a folder's photographs with these solvers.
///
/// # Errors
/// [`PoseError`]; that nothing can be trusted is no error but a verdict.
pub fn find(
    folder: &Path,
    solvers: &[&dyn Solver],
    options: &Options,
    progress: &dyn Progress,
) -> Result<Found, PoseError> {
    let part = Part::begin(progress, "reading the photographs", 0..1, 10);
    let intake = Intake::read(folder, options.every, &part)?;
    if intake.photos.len() < 3 {
        let unusable = intake.unusable.iter().map(|photo| format!("; {}: {}", photo.name, photo.reason)).collect();
        return Err(PoseError::Few(folder.display().to_string(), intake.photos.len(), unusable));
    }
    if let Some(warning) = crop_warning(&intake.photos) {
        progress.warn(&warning);
    }
    let mut cameras = Cameras::of(&intake.photos, options.focal);
    let photos = &intake.photos;
    let part = Part::begin(progress, "", 1..4, 10);
    let mut made = attempts(solvers, (photos, photos), &cameras, options.seed, &part)?;
    let mut after = 4;
    let apart = made.iter().filter_map(|attempt| attempt.solution.as_ref()?.apart.as_ref());
    if let Some(by_zoom) = cameras.by_zoom(apart) {
        let part = Part::begin(progress, "several focal lengths", 4..8, 10);
        made = attempts(solvers, (photos, photos), &by_zoom, options.seed, &part)?;
        (cameras, after) = (by_zoom, 8);
    }
    let part = Part::begin(progress, "", after..after + 1, 10);
    let mut found = verdict(folder, photos, &cameras, &mut made, &part)?;
    let accepted = |found: &Result<Verdict, Refusal>| found.as_ref().map_or(Vec::new(), |found| found.photos.clone());
    // With unknown focal lengths more attempts were not seen to be as safe.
    if cameras.are_known() && Matches::of(photos, &made).tie_more_than(&accepted(&found)) {
        let part = Part::begin(progress, "finer features", 5..8, 10);
        if let Some(finer) = intake.finer(&part)? {
            made.extend(attempts(solvers, (photos, &finer), &cameras, options.seed, &part)?);
            let part = Part::begin(progress, "", 8..9, 10);
            let second = verdict(folder, photos, &cameras, &mut made, &part)?;
            if found.is_err() || accepted(&second).len() > accepted(&found).len() {
                found = second;
            }
            if let Ok(found) = &found {
                made[found.attempt].tried.refused = None;
            }
        }
    }
    let matches = Matches::of(photos, &made);
    Ok(Found { intake, cameras, attempts: made, matches, verdict: found })
}
