//! The result of a render: a picture with its weights and scores.

use super::Seen;
use crate::budget::Kept;
use crate::scores::{corrected_psnr_of_seen, psnr_of_seen, shows_anything, ssim_of_seen};
use image::{GrayImage, RgbImage};
use std::time::Duration;
use viewfuse_core::weights::Omission;
use viewfuse_scene::few_shot::Target;
use viewfuse_scene::photographs::GroundTruth;
use viewfuse_weighting::sources::{MAX_SOURCES, SourceWeights};

/// One target view's picture with its weights, scores and times.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The target.
    pub target: Target,
    /// The sources' weights before views were left out.
    pub weights: SourceWeights,
    /// The views that were left out, and the weights that were used.
    pub omission: Omission<MAX_SOURCES>,
    /// Red, green, blue in `[0, 1]` and opacity, not rounded. Row-major. Empty where the options ask for rounded frames
    /// and the field rounds them.
    pub colours: Vec<[f32; 4]>,
    /// The picture.
    pub picture: RgbImage,
    /// Depth along the principal axis in world units, 0 where there is no surface, row-major; empty for fields without
    /// depths.
    pub depths: Vec<f32>,
    /// How far each pixel can be relied on, in `[0, 1]`; empty for fields that do not tell.
    pub confidences: Vec<f32>,
    /// What share of its surfaces few photographs show; `None` for fields without depths, and for coarse pictures.
    pub seen: Option<Seen>,
    /// The mean share of each part of the mixture ([`Mixture`](crate::Mixture)), the rest that of the picture under the
    /// chosen settings; empty without a mixture.
    pub shares: Vec<f32>,
    /// The ground truth at the same size and the scores, if there is a photograph.
    pub truth: Option<Truth>,
    /// What the picture shows where nothing is: red, green, blue in `[0, 1]`.
    pub background: [f32; 3],
    /// Time for this frame alone.
    pub time: Duration,
    /// The part of it for encoding sources that no earlier frame used.
    pub encode: Duration,
    /// How the frame keeps the run's bound, if there is one.
    pub kept: Option<Kept>,
    /// Whether a pixel without depth may show nothing of the scene ([`About::draws_all`](crate::About::draws_all)), and
    /// not the known background of an object.
    pub counts_gaps: bool,
}

/// A photograph at the target, and the scores of the prediction.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The photograph at the frame's size over the run's background.
    pub picture: RgbImage,
    /// Where the photograph shows the whole pixel ([`GroundTruth::seen`]); only these pixels are scored.
    pub seen: Option<GrayImage>,
    /// Peak signal to noise ratio in decibels, of 8-bit values.
    pub psnr: f64,
    /// The same of corrected colours ([`corrected_psnr_of_seen`]): without the price of the camera's exposure.
    pub corrected_psnr: f64,
    /// Structural similarity (uniform 7x7 window), if the picture is large enough.
    pub ssim: Option<f64>,
}

impl Truth {
    /// Compares a prediction with the truth; `None` where the photograph shows nothing that counts.
    pub fn compare(prediction: &RgbImage, truth: GroundTruth) -> Option<Truth> {
        let GroundTruth { picture, seen } = truth;
        if !shows_anything(seen.as_ref()) {
            return None;
        }
        let psnr = psnr_of_seen(prediction, &picture, seen.as_ref());
        let ssim = ssim_of_seen(prediction, &picture, seen.as_ref());
        let corrected_psnr = corrected_psnr_of_seen(prediction, &picture, seen.as_ref());
        Some(Truth { picture, seen, psnr, corrected_psnr, ssim })
    }
}
