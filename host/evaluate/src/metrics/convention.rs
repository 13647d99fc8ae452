//! How published tables compute their scores.
//!
//! | | PSNR, SSIM | LPIPS | DISTS, FID |
//! |---|---|---|---|
//! | `plain` | of the pictures, rounded to 8 bits | AlexNet | of the pictures |
//! | `pixelnerf` | the same | VGG16 | not scored |
//! | `viewattention` | of prediction and photograph, each stretched to its own least and largest level | AlexNet, of the stretched prediction and the photograph as it is | likewise |
//!
//! SSIM is everywhere that of scikit-image with a uniform window of 7x7. Read off `eval/calc_metrics.py` of
//! sxyu/pixel-nerf, and `eval.py`, `eval_fid_lpips_dists.py` and `utils.py` of alexberian/ViewAttention, whose GeNVS is
//! the only one with published code for scores; the GeNVS paper's own is not published, so there is no convention of
//! that name.
//!
//! Two things are not copied: both codes truncate levels where `plain` rounds (a prediction of 0.9 steps is 0 there),
//! which cannot be recovered from an 8-bit picture; and stretching uses integers here, where `f32` is sometimes one
//! level lower.

use image::RgbImage;
use std::borrow::Cow;

/// How scores are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convention {
    /// Of the pictures as they are.
    #[default]
    Plain,
    /// As the published evaluation of pixelNeRF.
    PixelNerf,
    /// As the published evaluation of "Pay Attention to Where You Looked".
    ViewAttention,
}

viewfuse_job::named! {
    pub Convention: "a convention of scores" {
        Plain => "plain",
        PixelNerf => "pixelnerf",
        ViewAttention => "viewattention",
    }
}

impl Convention {
    /// A picture as PSNR and SSIM compare it.
    pub fn shown(self, picture: &RgbImage) -> Cow<'_, RgbImage> {
        match self {
            Convention::Plain | Convention::PixelNerf => Cow::Borrowed(picture),
            Convention::ViewAttention => Cow::Owned(stretched(picture)),
        }
    }
}

/// The least level of all channels becomes 0, the largest 255; values between are truncated to whole levels. A picture
/// of one level is black.
fn stretched(picture: &RgbImage) -> RgbImage {
    let levels = || picture.as_raw().iter().map(|level| u32::from(*level));
    let (least, largest) = (levels().min().unwrap_or(0), levels().max().unwrap_or(0));
    let span = (largest - least).max(1);
    let mut picture = picture.clone();
    picture.iter_mut().for_each(|level| *level = ((u32::from(*level) - least) * 255 / span) as u8);
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretching() {
        let picture = |levels: Vec<u8>| RgbImage::from_raw(1, 2, levels).expect("two pixels");
        let shown = |levels| Convention::ViewAttention.shown(&picture(levels)).into_owned().into_raw();
        // Across channels, and cut off: 30 / 140 * 255 is 54.6.
        assert_eq!(shown(vec![10, 40, 80, 150, 10, 10]), [0, 54, 127, 255, 0, 0]);
        assert_eq!(shown(vec![0, 1, 254, 255, 17, 3]), [0, 1, 254, 255, 17, 3]);
        assert_eq!(shown(vec![9; 6]), [0; 6]);
        assert_eq!(Convention::Plain.shown(&picture(vec![9; 6])).as_raw(), &[9; 6]);
    }
}
