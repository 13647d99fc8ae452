//! What can be wrong with a photograph.

use super::Photo;
use image::GrayImage;
use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};
use std::path::Path;

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

/// Whether a JPEG file ends before its picture does: decoders fill the rest with grey. Other formats' decoders say so.
pub(super) fn cut_short(path: &Path) -> io::Result<bool> {
    let mut reader = BufReader::new(File::open(path)?);
    let mut start = [0; 2];
    match reader.read_exact(&mut start) {
        Ok(()) if start == [0xff, 0xd8] => Ok(!has_end(reader)?),
        Ok(()) => Ok(false),
        Err(error) => if_ended(error, false),
    }
}

/// Whether the marker of the end stands behind that of the first scan, in what follows the first two bytes. Pictures
/// within segments (thumbnails) do not count.
fn has_end(mut reader: impl BufRead + Seek) -> io::Result<bool> {
    loop {
        let mut marker = [0; 4];
        if let Err(error) = reader.read_exact(&mut marker) {
            return if_ended(error, false);
        }
        match marker {
            [0xff, 0xda, ..] => return has_pair(reader, [0xff, 0xd9]),
            // A fill byte before the marker.
            [0xff, 0xff, ..] => reader.seek_relative(-3)?,
            [0xff, _, high, low] => reader.seek_relative(i64::from(u16::from_be_bytes([high, low])) - 2)?,
            _ => return Ok(false),
        }
    }
}

fn has_pair(mut reader: impl BufRead, pair: [u8; 2]) -> io::Result<bool> {
    let mut last = None;
    loop {
        let part = reader.fill_buf()?;
        let (Some(first), length) = (part.first(), part.len()) else { return Ok(false) };
        if last == Some(pair[0]) && *first == pair[1] || part.windows(2).any(|found| found == pair) {
            return Ok(true);
        }
        last = part.last().copied();
        reader.consume(length);
    }
}

/// The answer where a file ends.
fn if_ended(error: io::Error, answer: bool) -> io::Result<bool> {
    if error.kind() == ErrorKind::UnexpectedEof { Ok(answer) } else { Err(error) }
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

/// Whether two photographs are one picture.
pub(super) fn is_same(a: &Photo, b: &Photo) -> bool {
    if a.copy.dimensions() != b.copy.dimensions() {
        return false;
    }
    let (a, b) = (a.copy.as_raw(), b.copy.as_raw());
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    (sum / a.len().max(1) as f64).sqrt() < MAX_SAME_LEVELS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_thumbnail_is_not_the_end() {
        let whole =
            [&[0xff, 0xd8, 0xff, 0xe1, 0, 6, 0xff, 0xd9, 1, 1][..], &[0xff, 0xda, 0, 2, 7, 7, 0xff, 0xd9]].concat();
        // Through buffers that end between any two bytes.
        for buffer in 1..=whole.len() {
            let has_end = |bytes: &[u8]| {
                let mut reader = BufReader::with_capacity(buffer, io::Cursor::new(bytes.to_vec()));
                reader.read_exact(&mut [0; 2]).expect("two bytes");
                has_end(reader).expect("no error")
            };
            assert!(has_end(&whole));
            assert!(!has_end(&whole[..whole.len() - 1]), "cut in the picture");
            assert!(!has_end(&whole[..12]), "cut in the header");
        }
    }

    #[test]
    fn a_blurred_picture_is_less_sharp() {
        let sharp = GrayImage::from_fn(64, 64, |x, y| image::Luma([if (x / 16 + y / 16) % 2 == 0 { 40 } else { 200 }]));
        let blurred = image::imageops::blur(&sharp, 2.0);
        assert!(sharpness(&blurred) < 0.1 * sharpness(&sharp), "{} {}", sharpness(&blurred), sharpness(&sharp));
        assert_eq!(sharpness(&GrayImage::new(8, 8)), 0.0);
    }
}
