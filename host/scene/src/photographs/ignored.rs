//! Pixels of a photograph that do not count: by an ignore mask, or by an alpha channel that is one.

use crate::Photograph;
use image::{GrayImage, Luma};

/// Alpha from which on a pixel counts.
const HALF: u8 = 128;
/// Share of the border that is opaque from which on an alpha channel shows no object.
const MAX_OBJECT_BORDER: f32 = 0.5;

/// How much of a photograph's border is opaque.
pub(super) fn border_share(photograph: &Photograph) -> f32 {
    let (width, height) = photograph.pixels.dimensions();
    let at_border = |x: u32, y: u32| x == 0 || y == 0 || x + 1 == width || y + 1 == height;
    let border = photograph.pixels.enumerate_pixels().filter(|(x, y, _)| at_border(*x, *y));
    let (opaque, count) =
        border.fold((0, 0), |(opaque, count), (_, _, pixel)| (opaque + u32::from(pixel[3] >= HALF), count + 1));
    opaque as f32 / count.max(1) as f32
}

/// Whether alpha channels with these shares of their borders say which pixels do not count: an object is seldom cut off
/// by most of the border.
pub(super) fn is_of_ignored(mut shares: Vec<f32>) -> bool {
    shares.sort_by(f32::total_cmp);
    shares.get(shares.len() / 2).is_some_and(|share| *share > MAX_OBJECT_BORDER)
}

/// The whole photograph, of which what is transparent does not count.
pub(super) fn by_alpha(photograph: Photograph) -> Photograph {
    let counts = |x: u32, y: u32| {
        let is_seen = photograph.seen.as_ref().is_none_or(|seen| seen.get_pixel(x, y)[0] > 0);
        is_seen && photograph.pixels.get_pixel(x, y)[3] >= HALF
    };
    let (width, height) = photograph.pixels.dimensions();
    let seen = GrayImage::from_fn(width, height, |x, y| Luma([if counts(x, y) { u8::MAX } else { 0 }]));
    Photograph { seen: seen.as_raw().contains(&0).then_some(seen), ..photograph.without_alpha() }
}

/// The photograph with the nearest pixel of the row that counts in the place of those that do not; where none of the row
/// does, with the nearest row. So they are background before a background, and part of an object inside of it.
pub(super) fn filled(mut photograph: Photograph) -> Photograph {
    let Some(seen) = &photograph.seen else { return photograph };
    let (width, height) = photograph.pixels.dimensions();
    let mut rows = Vec::new();
    for y in 0..height {
        let known: Vec<u32> = (0..width).filter(|x| seen.get_pixel(*x, y)[0] > 0).collect();
        let (Some(&first), Some(&last)) = (known.first(), known.last()) else { continue };
        rows.push(y);
        for x in (0..width).filter(|_| known.len() < width as usize) {
            let after = known.partition_point(|other| *other < x);
            let (left, right) = (*known[..after].last().unwrap_or(&first), *known.get(after).unwrap_or(&last));
            let nearest = if left.abs_diff(x) <= right.abs_diff(x) { left } else { right };
            if seen.get_pixel(x, y)[0] == 0 {
                photograph.pixels.put_pixel(x, y, *photograph.pixels.get_pixel(nearest, y));
            }
        }
    }
    for y in (0..height).filter(|y| rows.binary_search(y).is_err()) {
        let Some(nearest) = rows.iter().min_by_key(|other| other.abs_diff(y)) else { break };
        for x in 0..width {
            photograph.pixels.put_pixel(x, y, *photograph.pixels.get_pixel(x, *nearest));
        }
    }
    photograph
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{Rgba, RgbaImage};

    /// A photograph of these rows: `.` does not count, a digit is the level of a pixel, `-` one that is transparent.
    fn photograph(rows: [&str; 3]) -> Photograph {
        let at = |x: u32, y: u32| rows[y as usize].as_bytes()[x as usize];
        let level = |x, y| if at(x, y).is_ascii_digit() { at(x, y) - b'0' } else { 99 };
        let pixels = RgbaImage::from_fn(4, 3, |x, y| Rgba([level(x, y), 0, 0, if at(x, y) == b'-' { 0 } else { 255 }]));
        let seen = GrayImage::from_fn(4, 3, |x, y| Luma([if at(x, y) == b'.' { 0 } else { 255 }]));
        Photograph { pixels, has_alpha: true, seen: Some(seen) }
    }

    fn levels(photograph: &Photograph) -> Vec<u8> {
        photograph.pixels.pixels().map(|pixel| pixel[0]).collect()
    }

    #[test]
    fn nearest_pixels_that_count_take_the_place_of_others() {
        let filled = filled(photograph(["1..4", "....", ".23."]));
        assert_eq!(levels(&filled), [1, 1, 4, 4, 1, 1, 4, 4, 2, 2, 3, 3]);
        let nothing = photograph(["....", "....", "...."]);
        assert_eq!(super::filled(nothing.clone()), nothing);
    }

    #[test]
    fn what_is_transparent_does_not_count() {
        let whole = by_alpha(photograph(["1-34", "5678", ".111"]));
        let seen: Vec<bool> = whole.seen.expect("hidden pixels").pixels().map(|seen| seen[0] > 0).collect();
        assert_eq!(seen.iter().filter(|seen| !**seen).count(), 2);
        assert!(!seen[1] && !seen[8] && !whole.has_alpha);
        assert!(whole.pixels.pixels().all(|pixel| pixel[3] == 255));
    }

    #[test]
    fn an_opaque_border_is_of_no_object() {
        assert_eq!(border_share(&photograph(["--11", "-1--", "----"])), 0.2);
        assert!(
            is_of_ignored(vec![0.0, 0.9, 1.0]) && !is_of_ignored(vec![0.0, 0.1, 1.0]) && !is_of_ignored(Vec::new())
        );
    }
}
