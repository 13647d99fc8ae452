//! The job: photographs and what is known of their cameras.

use serde::Deserialize;
use std::path::PathBuf;

/// What is to be done.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PoseJob {
    /// Seed of every random draw.
    pub(crate) seed: u64,
    /// The kind of features.
    pub(crate) features: Features,
    /// Longest side in pixels at which features are looked for; larger photographs are reduced.
    pub(crate) max_side: u32,
    /// The cameras: photographs of one camera share its focal length and its lens.
    pub(crate) cameras: Vec<CameraGuess>,
    /// The photographs, upright, as PNG or JPEG.
    pub(crate) photographs: Vec<JobPhotograph>,
}

/// A kind of features.
#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Features {
    /// Extrema of an analytic Laplacian, described as SIFT's.
    Alp,
    /// SIFT.
    Sift,
}

/// A camera before the work.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CameraGuess {
    /// Focal length in pixels.
    pub(crate) focal: f64,
    /// Whether that is no more than a guess.
    pub(crate) is_guess: bool,
}

/// A photograph.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct JobPhotograph {
    /// Its file.
    pub(crate) path: PathBuf,
    /// Width and height in pixels.
    pub(crate) size: [u32; 2],
    /// Its camera, as an index.
    pub(crate) camera: usize,
}
