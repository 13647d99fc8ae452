//! PSNR and SSIM of the object alone, as few-shot papers report for DTU: prediction and truth are both composited over
//! white with the mask of the *truth*, and compared over the whole picture.
//!
//! The prediction's own opacity is not used: its pixels inside the mask count, its pixels outside do not; what the
//! photograph's lens did not see is outside. Both pictures have 8 bits, under every convention of the other metrics.

use image::RgbImage;
use viewfuse_core::metrics::{psnr, ssim};
use viewfuse_scene::photographs::GroundTruth;

/// Name of the masked peak signal to noise ratio in decibels.
pub const PSNR_MASKED: &str = "psnr-masked";
/// Name of the masked structural similarity.
pub const SSIM_MASKED: &str = "ssim-masked";

/// A truth with its mask.
#[derive(Clone, Debug, PartialEq)]
pub struct MaskedTruth {
    over_white: RgbImage,
    /// How much of each pixel is the object, row-major.
    shares: Vec<f32>,
}

impl MaskedTruth {
    /// From the same photograph composited over white and over black, of equal size; `None` where these are equal,
    /// because it then has no mask, and where the mask shows nothing.
    pub fn of(over_white: GroundTruth, over_black: &GroundTruth) -> Option<MaskedTruth> {
        let GroundTruth { picture: mut over_white, seen } = over_white;
        let over_black = &over_black.picture;
        if over_white == *over_black || over_white.dimensions() != over_black.dimensions() {
            return None;
        }
        let share = |(white, black): (&image::Rgb<u8>, &image::Rgb<u8>)| {
            let behind: i32 = (0..3).map(|channel| i32::from(white[channel]) - i32::from(black[channel])).sum();
            (1.0 - behind as f32 / (3.0 * 255.0)).clamp(0.0, 1.0)
        };
        let mut shares: Vec<f32> = over_white.pixels().zip(over_black.pixels()).map(share).collect();
        if let Some(seen) = seen {
            let places = shares.iter_mut().zip(over_white.pixels_mut()).zip(seen.as_raw());
            for ((share, pixel), _) in places.filter(|(_, seen)| **seen == 0) {
                (*share, pixel.0) = (0.0, [u8::MAX; 3]);
            }
        }
        // Of nothing every picture would be exact.
        shares.iter().any(|share| *share > 0.0).then_some(MaskedTruth { over_white, shares })
    }

    /// A picture composited over white with this truth's mask. It must have the truth's size.
    pub fn over_white(&self, picture: &RgbImage) -> RgbImage {
        let mut laid = picture.clone();
        for (pixel, share) in laid.pixels_mut().zip(&self.shares) {
            let over = |level: u8| (f32::from(level) * share + 255.0 * (1.0 - share) + 0.5) as u8;
            pixel.0 = pixel.0.map(over);
        }
        laid
    }

    /// [`PSNR_MASKED`], and [`SSIM_MASKED`] if the picture is at least 7x7; nothing if the sizes differ.
    pub fn score(&self, prediction: &RgbImage) -> Vec<(String, f64)> {
        let (width, height) = self.over_white.dimensions();
        if prediction.dimensions() != (width, height) {
            return Vec::new();
        }
        let laid = self.over_white(prediction);
        let mut values = vec![(PSNR_MASKED.to_owned(), psnr(&laid, &self.over_white))];
        let similarity = ssim(&laid, &self.over_white, width as usize, height as usize, 3);
        values.extend(similarity.map(|value| (SSIM_MASKED.to_owned(), value)));
        values
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, Luma, Rgb};

    fn whole(picture: RgbImage) -> GroundTruth {
        GroundTruth { picture, seen: None }
    }

    /// The left half is an object of level 100, the right half background.
    fn halves() -> MaskedTruth {
        let over = |behind: u8| RgbImage::from_fn(16, 8, |x, _| Rgb(if x < 8 { [100; 3] } else { [behind; 3] }));
        MaskedTruth::of(whole(over(255)), &whole(over(0))).expect("a mask")
    }

    #[test]
    fn a_mask_that_shows_nothing_is_none() {
        let over = |behind: u8| whole(RgbImage::from_pixel(16, 8, Rgb([behind; 3])));
        assert_eq!(MaskedTruth::of(over(255), &over(0)), None);
    }

    #[test]
    fn only_the_object_counts() {
        let truth = halves();
        let prediction = RgbImage::from_fn(16, 8, |x, _| Rgb(if x < 8 { [110; 3] } else { [7; 3] }));
        let values = truth.score(&prediction);
        // An error of 10 levels on half of the pixels.
        let expected = 10.0 * (255.0_f64.powi(2) / 50.0).log10();
        assert_eq!(values[0].0, PSNR_MASKED);
        assert!((values[0].1 - expected).abs() < 1.0e-9, "{values:?}");
        assert!(values[1].0 == SSIM_MASKED && values[1].1 < 1.0, "{values:?}");
        let exact = RgbImage::from_pixel(16, 8, Rgb([100; 3]));
        assert_eq!(truth.score(&exact)[0].1, f64::INFINITY);
        assert!(truth.score(&RgbImage::new(3, 3)).is_empty());
    }

    #[test]
    fn fractions_and_photographs_without_a_mask() {
        // A quarter object of level 200: 50 over black, 241 over white.
        let [white, black] = [241, 50].map(|level| whole(RgbImage::from_pixel(2, 2, Rgb([level; 3]))));
        let truth = MaskedTruth::of(white.clone(), &black).expect("a mask");
        let level = truth.over_white(&RgbImage::from_pixel(2, 2, Rgb([200; 3]))).get_pixel(0, 0)[0];
        assert!(level.abs_diff(241) <= 1, "{level}");
        assert_eq!(MaskedTruth::of(white.clone(), &white), None);
    }

    #[test]
    fn what_was_not_seen_is_no_object() {
        let over = |behind: u8| {
            let picture = RgbImage::from_fn(16, 8, |x, _| Rgb(if x < 8 { [100; 3] } else { [behind; 3] }));
            GroundTruth { picture, seen: Some(GrayImage::from_fn(16, 8, |_, y| Luma([if y < 2 { 0 } else { 255 }]))) }
        };
        let truth = MaskedTruth::of(over(255), &over(0)).expect("a mask");
        // Wrong only where the lens saw nothing and beside the object.
        let prediction = RgbImage::from_fn(16, 8, |x, y| Rgb(if x < 8 && y >= 2 { [100; 3] } else { [7; 3] }));
        assert_eq!(truth.score(&prediction)[0].1, f64::INFINITY);
    }
}
