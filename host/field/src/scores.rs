//! PSNR, as it is and of corrected colours, and SSIM of what a photograph shows.
//!
//! A photograph that was taken through a lens does not show the whole picture of its pinhole
//! ([`GroundTruth::seen`](viewfuse_scene::photographs::GroundTruth::seen)). What it does not show has no truth and is
//! left out: of the mean squared error the pixels, of SSIM every window that holds one of them.

use image::imageops::crop_imm;
use image::{GrayImage, Rgb, RgbImage};
use std::borrow::Cow;
use viewfuse_core::metrics::{SSIM_WINDOW, psnr, ssim};

/// Whether a photograph shows anything that counts.
pub fn shows_anything(seen: Option<&GrayImage>) -> bool {
    seen.is_none_or(|seen| seen.as_raw().iter().any(|seen| *seen > 0))
}

/// [`psnr`] over the seen pixels, in decibels; infinite where these are equal, NaN where none is seen. All pictures must
/// have one size.
pub fn psnr_of_seen(prediction: &RgbImage, truth: &RgbImage, seen: Option<&GrayImage>) -> f64 {
    let Some(seen) = seen else { return psnr(prediction, truth) };
    if !shows_anything(Some(seen)) {
        return f64::NAN;
    }
    let levels = |picture: &RgbImage| -> Vec<u8> {
        let pixels = picture.pixels().zip(seen.as_raw()).filter(|(_, seen)| **seen > 0);
        pixels.flat_map(|(pixel, _)| pixel.0).collect()
    };
    psnr(&levels(prediction), &levels(truth))
}

/// [`psnr_of_seen`] after each of the prediction's channels was corrected by the gain and offset that fit it best, by
/// least squares over the seen pixels, to the truth's (NaN where none is seen); corrected levels are clamped to 0..=255 and not rounded. What it
/// is above PSNR is the price of the camera's exposure and white balance, which no other view tells. Never below PSNR,
/// rounding aside. A channel of one level, in either picture, gets an offset alone: a gain of 0 would hide
/// all of a picture.
///
/// As the `cc_psnr` of nerfstudio and the `color_correct` of multinerf (RawNeRF, Zip-NeRF), with an affine function of
/// each channel for their quadratic one of all three.
pub fn corrected_psnr_of_seen(prediction: &RgbImage, truth: &RgbImage, seen: Option<&GrayImage>) -> f64 {
    let is_seen = |at: usize| seen.is_none_or(|seen| seen.as_raw()[at] > 0);
    let pairs: Vec<_> = prediction.pixels().zip(truth.pixels()).enumerate().filter(|(at, _)| is_seen(*at)).collect();
    if pairs.is_empty() {
        return f64::NAN;
    }
    let count = pairs.len() as f64;
    let mut error = 0.0;
    for channel in 0..3 {
        let levels = || pairs.iter().map(|(_, (p, t))| [f64::from(p.0[channel]), f64::from(t.0[channel])]);
        // Whole numbers below 2^53: the sums are exact.
        let [p, t, pp, pt, tt] = levels()
            .fold([0.0; 5], |sum, [p, t]| [sum[0] + p, sum[1] + t, sum[2] + p * p, sum[3] + p * t, sum[4] + t * t]);
        let [variation, of_truth] = [count * pp - p * p, count * tt - t * t];
        let gain = if variation > 0.0 && of_truth > 0.0 { (count * pt - p * t) / variation } else { 1.0 };
        let offset = (t - gain * p) / count;
        error += levels().map(|[p, t]| ((gain * p + offset).clamp(0.0, 255.0) - t).powi(2)).sum::<f64>();
    }
    if error > 0.0 { 10.0 * (3.0 * count * 255.0 * 255.0 / error).log10() } else { f64::INFINITY }
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
                let (strip_shown, true_strip) = (strip(prediction), strip(truth));
                let count = length - window + 1;
                sum += f64::from(count) * ssim(&strip_shown, &true_strip, length as usize, SSIM_WINDOW, 3)?;
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
    fn exposure_costs_what_the_correction_gains() {
        let [_, truth] = pictures();
        // Darker, and redder; the noise on it is no exposure.
        let noisy = |x: u32, y: u32| (x * 7 + y * 5) % 3;
        let exposed = |x: u32, y: u32, gain: [f64; 3], offset: f64| {
            let level = |c: usize| gain[c] * f64::from(truth.get_pixel(x, y)[c]) + offset;
            Rgb([0, 1, 2].map(|c| (level(c).round() as u32 + noisy(x, y)) as u8))
        };
        let plain = RgbImage::from_fn(23, 17, |x, y| exposed(x, y, [0.9; 3], 10.0));
        let dark = RgbImage::from_fn(23, 17, |x, y| exposed(x, y, [0.7, 0.5, 0.45], 3.0));
        let [of_plain, of_dark] = [&plain, &dark].map(|picture| corrected_psnr_of_seen(picture, &truth, None));
        assert!(psnr_of_seen(&dark, &truth, None) < 15.0 && of_dark > 40.0, "{of_dark}");
        assert!(of_plain > of_dark && of_plain > psnr_of_seen(&plain, &truth, None) + 10.0, "{of_plain}");
        // The gain and the offset of least squares, by their normal equations.
        let (mut best, step) = (f64::INFINITY, 1.0e-3);
        for at in 0..200 {
            let gain = 1.0 / 0.7 - 0.1 + step * f64::from(at);
            let rest: Vec<f64> =
                dark.pixels().zip(truth.pixels()).map(|(p, t)| f64::from(t[0]) - gain * f64::from(p[0])).collect();
            let mean = rest.iter().sum::<f64>() / rest.len() as f64;
            best = best.min(rest.iter().map(|rest| (rest - mean).powi(2)).sum::<f64>() / rest.len() as f64);
        }
        let red = |picture: &RgbImage| RgbImage::from_fn(23, 17, |x, y| Rgb([picture.get_pixel(x, y)[0]; 3]));
        let corrected = corrected_psnr_of_seen(&red(&dark), &red(&truth), None);
        assert!((corrected - 10.0 * (255.0 * 255.0 / best).log10()).abs() < 0.01, "{corrected} {best}");
        // Equal pictures, one level, and pixels that are not seen.
        assert_eq!(corrected_psnr_of_seen(&truth, &truth, None), f64::INFINITY);
        let flat = RgbImage::from_pixel(23, 17, Rgb([7, 80, 200]));
        assert_eq!(corrected_psnr_of_seen(&flat, &RgbImage::from_pixel(23, 17, Rgb([9, 9, 9])), None), f64::INFINITY);
        assert!(corrected_psnr_of_seen(&dark, &flat, None) < 30.0, "a picture of a wall is no wall");
        let seen = GrayImage::from_fn(23, 17, |x, _| Luma([u8::from(x > 5)]));
        let mut other = dark.clone();
        other.enumerate_pixels_mut().filter(|(x, _, _)| *x <= 5).for_each(|(_, _, pixel)| pixel.0 = [255, 0, 255]);
        let of_seen = [&dark, &other].map(|picture| corrected_psnr_of_seen(picture, &truth, Some(&seen)));
        assert!(of_seen[0] == of_seen[1] && of_seen[0] > 40.0, "{of_seen:?}");
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
