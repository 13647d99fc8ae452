//! PSNR and SSIM of what a photograph shows.
//!
//! A photograph that was taken through a lens does not show the whole picture of its pinhole
//! ([`GroundTruth::seen`](viewfuse_scene::photographs::GroundTruth::seen)). What it does not show has no truth and is
//! left out: of the mean squared error the pixels, of SSIM every window that holds one of them.

use image::imageops::crop_imm;
use image::{GrayImage, Rgb, RgbImage};
use std::borrow::Cow;
use viewfuse_core::metrics::{SSIM_WINDOW, psnr, ssim};

/// [`psnr`] over the seen pixels, in decibels; infinite where these are equal or none is seen. All pictures must have
/// one size.
pub fn psnr_of_seen(prediction: &RgbImage, truth: &RgbImage, seen: Option<&GrayImage>) -> f64 {
    let Some(seen) = seen else { return psnr(prediction, truth) };
    let levels = |picture: &RgbImage| -> Vec<u8> {
        let pixels = picture.pixels().zip(seen.as_raw()).filter(|(_, seen)| **seen > 0);
        pixels.flat_map(|(pixel, _)| pixel.0).collect()
    };
    psnr(&levels(prediction), &levels(truth))
}

/// [`ssim`] over the windows whose pixels are all seen; `None` if there is no such window. All pictures must have one
/// size.
pub fn ssim_of_seen(prediction: &RgbImage, truth: &RgbImage, seen: Option<&GrayImage>) -> Option<f64> {
    let (width, height) = truth.dimensions();
    let Some(seen) = seen else { return ssim(prediction, truth, width as usize, height as usize, 3) };
    let window = SSIM_WINDOW as u32;
    let (mut sum, mut window_count) = (0.0, 0);
    for top in 0..(height + 1).saturating_sub(window) {
        let whole = |column: u32| (top..top + window).all(|row| seen.get_pixel(column, row)[0] > 0);
        // Runs of columns that are seen over the height of a window.
        let mut first = 0;
        for column in 0..=width {
            if column < width && whole(column) {
                continue;
            }
            let length = column - first;
            if length >= window {
                let strip = |picture: &RgbImage| crop_imm(picture, first, top, length, window).to_image();
                let (own, true_strip) = (strip(prediction), strip(truth));
                let count = length - window + 1;
                sum += f64::from(count) * ssim(&own, &true_strip, length as usize, SSIM_WINDOW, 3)?;
                window_count += count;
            }
            first = column + 1;
        }
    }
    (window_count > 0).then(|| sum / f64::from(window_count))
}

/// The prediction with the truth's pixels where these were not seen: for metrics that need whole pictures.
pub fn with_truth_unseen<'a>(
    prediction: &'a RgbImage,
    truth: &RgbImage,
    seen: Option<&GrayImage>,
) -> Cow<'a, RgbImage> {
    let Some(seen) = seen else { return Cow::Borrowed(prediction) };
    let pixel = |x: u32, y: u32| -> Rgb<u8> {
        *if seen.get_pixel(x, y)[0] > 0 { prediction.get_pixel(x, y) } else { truth.get_pixel(x, y) }
    };
    Cow::Owned(RgbImage::from_fn(truth.width(), truth.height(), pixel))
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    fn pictures() -> [RgbImage; 2] {
        let noise = |x: u32, y: u32, salt: u32| (x * 37 + y * 91 + (x * y + salt) * 13) as u8;
        let picture = |salt: u32| RgbImage::from_fn(23, 17, |x, y| Rgb([0, 1, 2].map(|c| noise(x, y, salt + c))));
        [picture(3), picture(4)]
    }

    #[test]
    fn where_all_is_seen_nothing_changes() {
        let [prediction, truth] = pictures();
        let all = GrayImage::from_pixel(23, 17, Luma([255]));
        assert_eq!(psnr_of_seen(&prediction, &truth, Some(&all)), psnr_of_seen(&prediction, &truth, None));
        let [with, without] = [Some(&all), None].map(|seen| ssim_of_seen(&prediction, &truth, seen).expect("large"));
        assert!((with - without).abs() < 1e-12, "{with} {without}");
    }

    #[test]
    fn what_is_not_seen_does_not_count() {
        let [prediction, truth] = pictures();
        // Two halves, a column between them and a corner are unseen.
        let seen = GrayImage::from_fn(23, 17, |x, y| Luma([if x == 11 || x + y < 3 { 0 } else { 1 }]));
        let scores = |prediction: &RgbImage| {
            (psnr_of_seen(prediction, &truth, Some(&seen)), ssim_of_seen(prediction, &truth, Some(&seen)))
        };
        let mut other = prediction.clone();
        other
            .enumerate_pixels_mut()
            .filter(|(x, y, _)| seen.get_pixel(*x, *y)[0] == 0)
            .for_each(|(_, _, p)| p.0 = [0; 3]);
        assert_eq!(scores(&other), scores(&prediction));
        assert_ne!(scores(&other).0, psnr_of_seen(&other, &truth, None));
        // By the definition: the mean over every window that is seen as a whole.
        let mut all = Vec::new();
        for (left, top) in (0..17).flat_map(|x| (0..11).map(move |y| (x, y))) {
            let is_seen = (left..left + 7).all(|x| (top..top + 7).all(|y| seen.get_pixel(x, y)[0] > 0));
            let window = |picture: &RgbImage| crop_imm(picture, left, top, 7, 7).to_image();
            all.extend(is_seen.then(|| ssim(&window(&prediction), &window(&truth), 7, 7, 3).expect("a window")));
        }
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        assert!((scores(&prediction).1.expect("windows") - mean).abs() < 1e-12);
        assert_eq!(psnr_of_seen(&with_truth_unseen(&truth, &other, Some(&seen)), &truth, Some(&seen)), f64::INFINITY);
        assert_eq!(*with_truth_unseen(&prediction, &other, Some(&seen)), other);
        // Too narrow for any window.
        let stripes = GrayImage::from_fn(23, 17, |x, _| Luma([(x % 7) as u8]));
        assert_eq!(ssim_of_seen(&prediction, &truth, Some(&stripes)), None);
    }
}
