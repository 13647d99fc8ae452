//! A job for a solver of structure from motion, and its answer.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::fmt::{self, Display, Formatter};
use std::path::{Path, PathBuf};
use viewfuse_job::hint::{Hint, Hinted};
use viewfuse_job::progress::{Interrupted, Progress};

/// Most bytes of an answer: what is longer is not one.
pub(crate) const MAX_ANSWER: u64 = 128 << 20;

/// Most times that a point may be seen, for each photograph of a job: COLMAP matches some twice.
const MAX_SEEN: usize = 8;

/// A kind of features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Features {
    /// Extrema of an analytic Laplacian (ALP), described as SIFT's.
    Alp,
    /// SIFT.
    Sift,
    /// SIFT with affine shapes, its descriptors averaged over domain sizes (DSP-SIFT).
    #[serde(rename = "dsp-sift")]
    DspSift,
}

impl Display for Features {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Features::Alp => "ALP",
            Features::Sift => "SIFT",
            Features::DspSift => "DSP-SIFT",
        })
    }
}

/// What a solver is asked.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PoseJob {
    /// Seed of every random draw.
    pub seed: u64,
    /// The kind of features; a solver that has one kind ignores it.
    pub features: Features,
    /// Longest side in pixels at which features are looked for.
    pub max_side: u32,
    /// The cameras: photographs of one camera share its focal length and its lens.
    pub cameras: Vec<CameraGuess>,
    /// The photographs.
    pub photographs: Vec<JobPhotograph>,
}

/// A camera before the work.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CameraGuess {
    /// Focal length in pixels of the job's photographs.
    pub focal: f64,
    /// Whether that is no more than a guess.
    pub is_guess: bool,
}

/// A photograph of a job: grey, upright, at working size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JobPhotograph {
    /// Its file.
    pub path: PathBuf,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Its camera, as an index.
    pub camera: usize,
}

/// What a solver found. Image coordinates are of the job's photographs: the top left pixel's centre is at (0.5, 0.5).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Solution {
    /// The solver and its version.
    pub solver: String,
    /// The cameras, in the order of the job.
    pub cameras: Vec<SolvedCamera>,
    /// The photographs, in the order of the job.
    pub photographs: Vec<SolvedPhotograph>,
    /// Surface points.
    pub points: Vec<SolvedPoint>,
    /// Pairs of photographs with matches that one geometry explains.
    #[serde(default)]
    pub pairs: Vec<SolvedPair>,
    /// What the photographs say with a focal length each; `None` of a solver that does not ask.
    #[serde(default)]
    pub apart: Option<SolvedApart>,
}

/// A solution adjusted once more, with a focal length for each photograph.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvedApart {
    /// The loss, as a share of that with one for each camera: well below 1 where a camera's photographs are of several
    /// focal lengths.
    pub loss: f64,
    /// Focal lengths in pixels of the job's photographs, in their order; `None` without a pose.
    pub focal: Vec<Option<f64>>,
}

/// A camera as it was refined.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvedCamera {
    /// Focal length in pixels.
    pub focal: f64,
    /// Principal point in pixels.
    pub principal: [f64; 2],
    /// Radial distortion `k1`, OpenCV's.
    pub k1: f64,
}

/// A photograph with or without a pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvedPhotograph {
    /// World to camera, rows of `[R|t]`, axes x right, y down, z forward; `None` without a pose.
    pub camera_from_world: Option<[[f64; 4]; 3]>,
    /// Why it has none, in the solver's words.
    pub reason: Option<String>,
}

impl SolvedPhotograph {
    /// The rotation from world to camera.
    pub fn rotation(&self) -> Option<DMat3> {
        let rows = self.camera_from_world?.map(|row| DVec3::new(row[0], row[1], row[2]));
        Some(DMat3::from_cols(rows[0], rows[1], rows[2]).transpose())
    }

    /// The camera's centre in world coordinates.
    pub fn centre(&self) -> Option<DVec3> {
        let rows = self.camera_from_world?;
        Some(-(self.rotation()?.transpose() * DVec3::new(rows[0][3], rows[1][3], rows[2][3])))
    }
}

/// A surface point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvedPoint {
    /// World coordinates.
    pub position: [f64; 3],
    /// Mean reprojection error in pixels.
    pub error: f64,
    /// The photographs that saw it, each with the place in it.
    pub seen: Vec<(usize, [f64; 2])>,
}

/// A pair of photographs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvedPair {
    /// Their indices.
    pub photographs: [usize; 2],
    /// Number of matches that agree with the geometry.
    pub inliers: usize,
    /// Whether the geometry is that of a moved camera, and not a homography or a rotation alone.
    pub is_general: bool,
}

impl Solution {
    /// The photographs with a pose, ascending.
    pub fn registered(&self) -> Vec<usize> {
        let all = self.photographs.iter().enumerate();
        all.filter(|(_, photograph)| photograph.camera_from_world.is_some()).map(|(index, _)| index).collect()
    }

    /// Mean reprojection error over the points in pixels; 0 without points.
    pub fn reprojection_error(&self) -> f64 {
        self.points.iter().map(|point| point.error).sum::<f64>() / self.points.len().max(1) as f64
    }

    /// Whether every number is finite, every index is that of a photograph or camera of the job, focal lengths are
    /// positive, and nothing is more than a job can have: a process answered.
    pub(crate) fn fits(&self, job: &PoseJob) -> bool {
        let count = job.photographs.len();
        let poses = self.photographs.iter().filter_map(|photograph| photograph.camera_from_world);
        let finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
        let is_rotation = |photograph: &SolvedPhotograph| {
            photograph.rotation().is_none_or(|rotation| (rotation.determinant() - 1.0).abs() < 1.0e-3)
        };
        self.photographs.len() == count
            && self.cameras.len() == job.cameras.len()
            && poses.flatten().all(|row| finite(&row))
            && self.photographs.iter().all(is_rotation)
            && self.cameras.iter().all(|camera| {
                camera.focal > 0.0 && finite(&[camera.focal, camera.k1, camera.principal[0], camera.principal[1]])
            })
            && self.points.iter().all(|point| {
                finite(&point.position)
                    && point.error.is_finite()
                    && point.seen.len() <= MAX_SEEN * count
                    && point.seen.iter().all(|(photograph, place)| *photograph < count && finite(place))
            })
            && self.apart.as_ref().is_none_or(|apart| {
                let mut known = apart.focal.iter().flatten();
                apart.loss.is_finite()
                    && apart.focal.len() == count
                    && known.all(|focal| *focal > 0.0 && focal.is_finite())
            })
            && self.pairs.len() <= count * count
            && self.pairs.iter().all(|pair| pair.photographs.iter().all(|photograph| *photograph < count))
    }
}

/// Why a solver has no answer.
#[derive(Debug, thiserror::Error)]
pub enum SolverError {
    /// The program is not there, or lacks what it works with: the solver's name last.
    #[error("{0}: {1}")]
    Missing(PathBuf, String, &'static str),
    /// The program broke, and what happened.
    #[error("{0}: {1}")]
    Broken(PathBuf, String),
    /// It found nothing; the words are the solver's.
    #[error("{0}")]
    Nothing(String),
    /// The person stopped the work.
    #[error("interrupted")]
    Interrupted(#[from] Interrupted),
}

impl Hinted for SolverError {
    fn hint(&self) -> Option<Hint> {
        match self {
            SolverError::Missing(.., solver) => Some(Hint::Solver(solver)),
            _ => None,
        }
    }
}

impl SolverError {
    /// That a solver's program could not be started.
    pub(crate) fn not_started(solver: &'static str, program: &Path, cause: &std::io::Error) -> SolverError {
        let problem = format!("the program is not there or cannot be started: {cause}");
        SolverError::Missing(program.to_path_buf(), problem, solver)
    }
}

/// A solver of structure from motion.
pub trait Solver: Sync {
    /// Its name, for records and messages.
    fn name(&self) -> &'static str;

    /// The kinds of features that it has.
    fn features(&self) -> &'static [Features];

    /// What tells the program that is asked from others, whose answers could differ: a version or a digest. `None` if
    /// that cannot be had: then answers are not kept for a run that goes on.
    fn identity(&self, _progress: &dyn Progress) -> Option<String> {
        None
    }

    /// Works on a job. The same job has the same answer, byte for byte, on one machine, as far as the program that it
    /// runs allows.
    ///
    /// # Errors
    /// [`SolverError`].
    fn solve(&self, job: &PoseJob, progress: &dyn Progress) -> Result<Solution, SolverError>;

    /// There is no job for a while: what is there for the next one is given back.
    fn rest(&self) {}
}
