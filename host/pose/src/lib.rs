//! Camera poses of bare photographs: structure from motion by libraries that others keep, and a verdict on what they
//! found.
//!
//! Solvers of structure from motion can be wrong by tens of degrees without a sign of it in their own figures: the
//! number of points, the reprojection error, what they accept. Two things tell. Attempts with other features, seeds and
//! focal lengths disagree where poses are wrong. And photographs, held out one at a time and rendered from the others,
//! are met only at their true poses.
//!
//! The modules are listed in the order of the data; a module uses only modules listed above it:
//!
//! ```text
//! exif           what a photograph states of its camera: Exif
//! intake         the photographs of a folder, and those that cannot be used: Intake
//! solution       a job for a solver and its answer: PoseJob, Solution, Solver
//! focal          cameras before the work, with where their focal lengths come from: Cameras
//! process        programs that end with their owner
//! openmvg        OpenMVG's crates, as a process: OpenMvg
//! colmap_folder  the folder in which COLMAP works, and the model that it leaves
//! colmap         the person's own COLMAP, as a process: Colmap
//! pycolmap       the person's own pycolmap, as a process: PyColmap
//! kept           answers of a solver, kept until the scene is written: Kept
//! posed          a solution as a scene
//! agreement      rotations of two solutions between the same photographs
//! support        parallax and the shape of the points: Support
//! held_out       photographs rendered from the others: HeldOutScores
//! ties           points that photographs share, and how far apart they are: Ties
//! attempt        the attempts that are made: Attempt
//! trust          how far a pose is to be trusted: Trust
//! matches        which photographs match which, and where they fall apart: Matches
//! verdict        the attempt that is accepted, with the photographs that are: Verdict
//! advice         where more photographs help: Neighbours
//! find           from a folder to a verdict: find
//! write          the scene with its record, whole or not at all
//! ```
#![forbid(unsafe_code)]

mod advice;
mod agreement;
mod attempt;
mod colmap;
mod colmap_folder;
mod exif;
mod find;
mod focal;
mod held_out;
mod intake;
mod kept;
mod matches;
mod openmvg;
mod posed;
mod process;
mod pycolmap;
mod solution;
mod support;
mod ties;
mod trust;
mod verdict;
mod write;

pub use advice::Neighbours;
pub use attempt::{Attempt, Tried};
pub use colmap::Colmap;
pub use exif::Exif;
pub use find::{Found, Options, PoseError, find};
pub use focal::{CameraGroup, Cameras, FocalSource};
pub use held_out::HeldOutScores;
pub use intake::{Intake, IntakeError, MAX_PHOTOGRAPHS, Photo, Unusable, is_photograph};
pub use kept::Kept;
pub use matches::Matches;
pub use openmvg::OpenMvg;
pub use pycolmap::PyColmap;
pub use solution::{
    CameraGuess, Features, JobPhotograph, PoseJob, Solution, SolvedApart, SolvedCamera, SolvedPair, SolvedPhotograph,
    SolvedPoint, Solver, SolverError,
};
pub use support::Support;
pub use ties::Ties;
pub use trust::{Trust, Verified};
pub use verdict::{Refusal, Verdict};
pub use write::{CameraRecord, Record, has_record, is_current, write};

/// The examples of the README, compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
