//! From a folder of photographs to a verdict.

use crate::attempt::{Attempt, attempts};
use crate::focal::Cameras;
use crate::intake::{Intake, IntakeError, crop_warning};
use crate::matches::Matches;
use crate::solution::{Solver, SolverError};
use crate::verdict::{MIN_PHOTOGRAPHS, Refusal, Verdict, verdict};
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
    /// Whether focal lengths were known, and do not count because the photographs showed others.
    pub is_contradicted: bool,
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
    // What has no poses says nothing of focal lengths.
    let solved = made.iter().filter(|attempt| attempt.tried.registered >= MIN_PHOTOGRAPHS).filter_map(|attempt| {
        let solution = attempt.solution.as_ref()?;
        Some((solution.apart.as_ref(), &attempt.tried.focal[..]))
    });
    let is_contradicted = cameras.groups.iter().any(|group| group.focal.is_some())
        && cameras.are_contradicted(&cameras.guesses(photos, 1.0), &solved.collect::<Vec<_>>());
    if is_contradicted {
        progress.warn(
            "the focal lengths that were given, or that the photographs state (EXIF), are not what they show, as with \
             a digital zoom or after a crop: they do not count",
        );
        cameras = Cameras::of_unknown(photos);
        let part = Part::begin(progress, "focal lengths", 4..6, 10);
        made = attempts(solvers, (photos, photos), &cameras, options.seed, &part)?;
        after = 6;
    }
    let apart = made.iter().filter_map(|attempt| attempt.solution.as_ref()?.apart.as_ref());
    if let Some(by_zoom) = cameras.by_zoom(apart) {
        let part = Part::begin(progress, "several focal lengths", after..8, 10);
        made = attempts(solvers, (photos, photos), &by_zoom, options.seed, &part)?;
        (cameras, after) = (by_zoom, 8);
    }
    let rest = || solvers.iter().for_each(|solver| solver.rest());
    rest();
    let part = Part::begin(progress, "", after..after + 1, 10);
    let mut found = verdict(folder, photos, &cameras, &mut made, &part)?;
    let accepted = found.as_ref().map_or(Vec::new(), |found| found.photos.clone());
    // With unknown focal lengths more attempts were not seen to be as safe.
    if cameras.are_known() && Matches::of(photos, &made).tie_more_than(&accepted) {
        let part = Part::begin(progress, "finer features", 5..8, 10);
        if let Some(finer) = intake.finer(&part)? {
            let before = made.iter().map(|attempt| attempt.tried.refused.clone()).collect();
            made.extend(attempts(solvers, (photos, &finer), &cameras, options.seed, &part)?);
            rest();
            let part = Part::begin(progress, "", 8..9, 10);
            let second = verdict(folder, photos, &cameras, &mut made, &part)?;
            found = taken(found, second, &mut made, before);
        }
    }
    let matches = Matches::of(photos, &made);
    Ok(Found { intake, cameras, is_contradicted, attempts: made, matches, verdict: found })
}

/// Of two verdicts, the second one beside more attempts, that which accepts more photographs; the first one if both
/// accept as many. `before` is why the first one refused its attempts: if it is taken, they say that again. The others
/// keep what the second one says.
fn taken(
    first: Result<Verdict, Refusal>,
    second: Result<Verdict, Refusal>,
    attempts: &mut [Attempt],
    before: Vec<Option<String>>,
) -> Result<Verdict, Refusal> {
    let count = |verdict: &Result<Verdict, Refusal>| verdict.as_ref().map_or(0, |accepted| accepted.photos.len());
    if first.is_err() || count(&second) > count(&first) {
        return second;
    }
    for (attempt, refused) in attempts.iter_mut().zip(before) {
        attempt.tried.refused = refused;
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attempt::Tried;
    use crate::solution::{Features, Solution};
    use viewfuse_scene::{Scene, SceneFrame};

    fn attempt(refused: &str) -> Attempt {
        let tried = Tried {
            solver: "a".to_owned(),
            features: Features::Sift,
            side: 100,
            seed: 0,
            focal_guess: None,
            registered: 3,
            focal: Vec::new(),
            reprojection_error: 0.0,
            loss_apart: None,
            points: 0,
            support: None,
            seconds: 0.0,
            refused: Some(refused.to_owned()),
        };
        Attempt { tried, solution: None }
    }

    /// A verdict that accepts so many photographs; 0 for none.
    fn accepting(count: usize) -> Result<Verdict, Refusal> {
        let scene = Scene {
            path: "bare".into(),
            layout: "posed",
            views: Vec::new(),
            points: Vec::new(),
            warnings: Vec::new(),
            conventions: Vec::new(),
            masks: Default::default(),
            mask_choice: Default::default(),
            unused: Vec::new(),
            frame: SceneFrame::FILE,
        };
        let (solution, photos) = (Solution::default(), (0..count).collect());
        let verdict = Verdict { attempt: 0, scene, solution, photos, verified: Vec::new(), taken_out: Vec::new() };
        if count > 0 { Ok(verdict) } else { Err(Refusal { reasons: Vec::new() }) }
    }

    #[test]
    fn attempts_say_what_the_verdict_says_that_is_taken() {
        for (first, second, expected) in [(4, 4, "first"), (4, 3, "first"), (4, 0, "first"), (3, 4, "second")] {
            let mut attempts = ["second"; 3].map(attempt);
            let before = vec![None, Some("first".to_owned())];
            let found = taken(accepting(first), accepting(second), &mut attempts, before);
            assert_eq!(found.expect("a verdict").photos.len(), 4, "{first}, {second}");
            let reasons = attempts.map(|attempt| attempt.tried.refused);
            let of_old = if expected == "first" { None } else { Some("second") };
            assert_eq!(reasons.each_ref().map(Option::as_deref), [of_old, Some(expected), Some("second")]);
        }
        let mut attempts = ["second"; 3].map(attempt);
        assert!(taken(accepting(0), accepting(0), &mut attempts, vec![Some("first".to_owned()); 2]).is_err());
        assert!(attempts.iter().all(|attempt| attempt.tried.refused.as_deref() == Some("second")));
    }
}
