//! What can be wrong with a photograph.

use super::{Photo, scaled};
use image::{GrayImage, imageops};
use viewfuse_field::held_out::{COPY_SIDE, difference, is_copy};

/// Pictures whose small copies differ by less than this, root mean square in levels of 255, are the same picture.
const MAX_SAME_LEVELS: f64 = 1.0;

/// A format that is not read, and a command that converts `FILE`.
pub(super) fn unread(extension: &str) -> Option<(&'static str, &'static str)> {
    Some(match extension {
        "heic" | "heif" => ("HEIC", "heif-convert FILE FILE.jpg"),
        "avif" => ("AVIF", "avifdec FILE FILE.jpg"),
        "dng" | "cr2" | "cr3" | "nef" | "arw" | "orf" | "rw2" | "raf" | "pef" | "srw" | "raw" => {
            ("a camera's raw format", "darktable-cli FILE FILE.jpg")
        }
        _ => return None,
    })
}

/// Mean squared second difference of neighbouring pixels, as a share of the grey levels' variance.
pub(super) fn sharpness(grey: &GrayImage) -> f64 {
    let (width, height) = (grey.width() as usize, grey.height() as usize);
    let levels = grey.as_raw();
    let count = levels.len().max(1) as f64;
    let mean = levels.iter().map(|level| f64::from(*level)).sum::<f64>() / count;
    let variance = levels.iter().map(|level| (f64::from(*level) - mean).powi(2)).sum::<f64>() / count;
    let mut sum = 0.0;
    for row in 1..height.saturating_sub(1) {
        for column in 1..width.saturating_sub(1) {
            let at = |row: usize, column: usize| i32::from(levels[row * width + column]);
            let around = at(row - 1, column) + at(row + 1, column) + at(row, column - 1) + at(row, column + 1);
            sum += f64::from(4 * at(row, column) - around).powi(2);
        }
    }
    if variance > 0.0 { sum / count / variance } else { 0.0 }
}

/// Whether two photographs are one picture, if only as a smaller or a more compressed copy.
pub(super) fn is_same(a: &Photo, b: &Photo) -> bool {
    let [small_a, small_b] = [a, b].map(|photo| {
        let [width, height] = scaled(photo.copy.dimensions().into(), COPY_SIDE, 1.0);
        imageops::thumbnail(&photo.copy, width, height)
    });
    is_copy(&small_a, &small_b) || difference(&a.copy, &b.copy).is_some_and(|levels| levels < MAX_SAME_LEVELS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blurred_picture_is_less_sharp() {
        let sharp = GrayImage::from_fn(64, 64, |x, y| image::Luma([if (x / 16 + y / 16) % 2 == 0 { 40 } else { 200 }]));
        let blurred = image::imageops::blur(&sharp, 2.0);
        assert!(sharpness(&blurred) < 0.1 * sharpness(&sharp), "{} {}", sharpness(&blurred), sharpness(&sharp));
        assert_eq!(sharpness(&GrayImage::new(8, 8)), 0.0);
    }
}
