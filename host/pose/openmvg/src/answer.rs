//! What is written: lines of progress, then the solution or why there is none.

use crate::apart::Apart;
use serde::Serialize;

/// A line of standard output.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Line {
    /// So many more pieces of a stage are done.
    Progress {
        /// The stage.
        stage: &'static str,
        /// Pieces of it.
        of: usize,
        /// Pieces that are done.
        done: usize,
    },
    /// The end: what was found.
    Solution(Solution),
    /// The end: nothing was found.
    Failed {
        /// What the library said.
        reason: String,
    },
}

/// What was found. Image coordinates are of the photographs: the top left pixel's centre is at (0.5, 0.5).
#[derive(Serialize)]
pub(crate) struct Solution {
    /// The library and its version.
    pub(crate) solver: &'static str,
    /// The cameras, in the order of the job.
    pub(crate) cameras: Vec<Camera>,
    /// The photographs, in the order of the job.
    pub(crate) photographs: Vec<Photograph>,
    /// Surface points.
    pub(crate) points: Vec<Point>,
    /// Pairs of photographs with matches that one geometry explains.
    pub(crate) pairs: Vec<Pair>,
    /// What the photographs say with a focal length each, where one of the job's is a guess.
    pub(crate) apart: Option<Apart>,
}

/// A camera as it was refined.
#[derive(Serialize)]
pub(crate) struct Camera {
    /// Focal length in pixels.
    pub(crate) focal: f64,
    /// Principal point in pixels.
    pub(crate) principal: [f64; 2],
    /// Radial distortion `k1`, OpenCV's.
    pub(crate) k1: f64,
}

/// A photograph with or without a pose.
#[derive(Serialize)]
pub(crate) struct Photograph {
    /// World to camera, rows of `[R|t]`, OpenCV's axes; null if it has no pose.
    pub(crate) camera_from_world: Option<[[f64; 4]; 3]>,
    /// Why it has none.
    pub(crate) reason: Option<String>,
}

/// A surface point.
#[derive(Serialize)]
pub(crate) struct Point {
    /// World coordinates.
    pub(crate) position: [f64; 3],
    /// Mean reprojection error in pixels.
    pub(crate) error: f64,
    /// The photographs that saw it, each with the place in it.
    pub(crate) seen: Vec<(usize, [f64; 2])>,
}

/// A pair of photographs.
#[derive(Serialize)]
pub(crate) struct Pair {
    /// Their indices.
    pub(crate) photographs: [usize; 2],
    /// Number of matches that agree with the geometry.
    pub(crate) inliers: usize,
    /// Whether the geometry is that of a moved camera, and not a homography or a rotation alone.
    pub(crate) is_general: bool,
}
