//! The attempts: with other features, other draws, and where focal lengths are unknown other guesses of them.

use crate::focal::Cameras;
use crate::intake::Photo;
use crate::solution::{Features, JobPhotograph, PoseJob, Solution, Solver, SolverError};
use crate::support::Support;
use serde::Serialize;
use std::time::Instant;
use viewfuse_job::progress::{Part, Progress};

/// Guesses of an unknown focal length, in longest sides: a phone, a compact camera, a small telephoto lens.
const GUESSES: [f64; 3] = [0.75, 1.1, 1.6];

/// An attempt at the poses.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// What was tried.
    pub tried: Tried,
    /// What was found.
    pub solution: Option<Solution>,
}

/// An attempt, as the record tells it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// The solver, with its version where it answered.
    pub solver: String,
    /// The kind of features.
    pub features: Features,
    /// Longest side in pixels at which they were looked for.
    pub side: u32,
    /// The seed.
    pub seed: u64,
    /// The guess of unknown focal lengths, in longest sides.
    pub focal_guess: Option<f64>,
    /// Photographs with a pose.
    pub registered: usize,
    /// Focal length of each camera in pixels of its photographs.
    pub focal: Vec<f64>,
    /// Mean reprojection error in pixels at working size.
    pub reprojection_error: f64,
    /// The share of the loss that is left with a focal length for each photograph: below 0.8 they are of several.
    pub loss_apart: Option<f64>,
    /// Number of points.
    pub points: usize,
    /// What the points tell.
    pub support: Option<Support>,
    /// Seconds that it took; of an answer that was kept, to read it.
    pub seconds: f64,
    /// Why it is not a candidate; `None` if it is.
    pub refused: Option<String>,
}

/// A plan of an attempt.
struct Plan {
    features: Features,
    seed: u64,
    guess: Option<f64>,
}

/// What is tried with a solver.
fn plans(solver: &dyn Solver, are_known: bool, seed: u64) -> Vec<Plan> {
    let guesses: Vec<Option<f64>> = if are_known { vec![None] } else { GUESSES.map(Some).to_vec() };
    let with_guess = |guess| {
        let plan = move |features: &Features| Plan { features: *features, seed, guess };
        solver.features().iter().map(plan)
    };
    guesses.into_iter().flat_map(with_guess).collect()
}

/// Makes the attempts with every solver. `at_size` are the photographs at the size at which features are looked for;
/// what is found is in pixels of the working size of `photos`, which are the same.
///
/// # Errors
/// [`SolverError`] if a solver is missing or broken, or the work is stopped; that it finds nothing is no error.
pub(crate) fn attempts(
    solvers: &[&dyn Solver],
    (photos, at_size): (&[Photo], &[Photo]),
    cameras: &Cameras,
    seed: u64,
    progress: &dyn Progress,
) -> Result<Vec<Attempt>, SolverError> {
    let all: Vec<(&dyn Solver, Plan)> = solvers
        .iter()
        .flat_map(|solver| plans(*solver, cameras.are_known(), seed).into_iter().map(|plan| (*solver, plan)))
        .collect();
    let mut made = Vec::with_capacity(all.len());
    for (index, (solver, plan)) in all.iter().enumerate() {
        let name = format!("attempt {} of {}", index + 1, all.len());
        let part = Part::begin(progress, name, index..index + 1, all.len());
        let start = Instant::now();
        let job = job(at_size, cameras, plan);
        let (solution, refused) = match solver.solve(&job, &part) {
            Ok(mut solution) => {
                resize(&mut solution, cameras, at_size, photos);
                (Some(solution), None)
            }
            Err(SolverError::Nothing(reason)) => (None, Some(reason)),
            Err(error) => return Err(error),
        };
        let found = solution.as_ref();
        let tried = Tried {
            solver: found.map_or_else(|| solver.name().to_owned(), |solution| solution.solver.clone()),
            features: plan.features,
            side: job.max_side,
            seed: plan.seed,
            focal_guess: plan.guess,
            registered: found.map_or(0, |solution| solution.registered().len()),
            focal: found.map_or(Vec::new(), |solution| focal(solution, cameras, photos)),
            reprojection_error: found.map_or(0.0, Solution::reprojection_error),
            loss_apart: found.and_then(|solution| Some(solution.apart.as_ref()?.loss)),
            points: found.map_or(0, |solution| solution.points.len()),
            support: found.map(|solution| Support::of(solution, &part)).transpose()?,
            seconds: start.elapsed().as_secs_f64(),
            refused,
        };
        made.push(Attempt { tried, solution });
    }
    Ok(made)
}

/// Moves a solution from pixels of photographs at one working size to those at another.
fn resize(solution: &mut Solution, cameras: &Cameras, from: &[Photo], to: &[Photo]) {
    let scale = |photo: usize| {
        let (from, to) = (from[photo].working_size, to[photo].working_size);
        [0, 1].map(|axis| f64::from(to[axis]) / f64::from(from[axis]))
    };
    for (camera, group) in solution.cameras.iter_mut().zip(&cameras.groups) {
        let [x, y] = group.photos.first().map_or([1.0; 2], |photo| scale(*photo));
        camera.focal *= x;
        camera.principal = [x * camera.principal[0], y * camera.principal[1]];
    }
    for point in &mut solution.points {
        point.error *= point.seen.first().map_or(1.0, |(photo, _)| scale(*photo)[0]);
        for (photo, place) in &mut point.seen {
            let [x, y] = scale(*photo);
            *place = [x * place[0], y * place[1]];
        }
    }
}

fn job(photos: &[Photo], cameras: &Cameras, plan: &Plan) -> PoseJob {
    let photograph = |(photo, camera): (&Photo, &usize)| JobPhotograph {
        path: photo.working.clone(),
        size: photo.working_size,
        camera: *camera,
    };
    PoseJob {
        seed: plan.seed,
        features: plan.features,
        max_side: photos.iter().flat_map(|photo| photo.working_size).max().unwrap_or(1),
        cameras: cameras.guesses(photos, plan.guess.unwrap_or(1.0)),
        photographs: photos.iter().zip(&cameras.of_photo).map(photograph).collect(),
    }
}

/// The cameras' focal lengths in pixels of their photographs.
fn focal(solution: &Solution, cameras: &Cameras, photos: &[Photo]) -> Vec<f64> {
    let length = |(camera, group): (&crate::solution::SolvedCamera, &crate::focal::CameraGroup)| {
        let working = group.photos.first().map_or(group.size, |photo| photos[*photo].working_size);
        camera.focal * f64::from(group.size[0]) / f64::from(working[0])
    };
    solution.cameras.iter().zip(&cameras.groups).map(length).collect()
}
