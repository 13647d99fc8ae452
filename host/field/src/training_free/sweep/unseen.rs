//! Parts of a picture that its photograph does not show: after undistortion, some of its border.

use std::borrow::Cow;
use viewfuse_scene::photographs::SourceImage;

/// Alpha of a pixel that is filled: it counts only where no source shows anything.
const FILLED_ALPHA: f32 = 1.0e-3;

/// The image with the colour of the nearest shown pixel of the row, or of the row above or below, where its alpha is 0.
/// One that shows nothing stays as it is.
pub(super) fn filled(image: &SourceImage) -> Cow<'_, SourceImage> {
    let shown = |texel: &[f32; 4]| texel[3] > 0.0;
    if image.texels.iter().all(shown) || !image.texels.iter().any(shown) {
        return Cow::Borrowed(image);
    }
    let width = image.camera.pinhole.width() as usize;
    let mut filled = image.clone();
    for row in filled.texels.chunks_exact_mut(width) {
        if row.iter().all(shown) {
            continue;
        }
        let known: Vec<usize> = (0..width).filter(|column| shown(&row[*column])).collect();
        let (Some(&first), Some(&last)) = (known.first(), known.last()) else { continue };
        for column in (0..width).filter(|column| known.binary_search(column).is_err()).collect::<Vec<_>>() {
            let after = known.partition_point(|other| *other < column);
            let (left, right) = (known[..after].last().unwrap_or(&first), known.get(after).unwrap_or(&last));
            row[column] = faint(row[if left.abs_diff(column) <= right.abs_diff(column) { *left } else { *right }]);
        }
    }
    let height = filled.texels.len() / width;
    let is_shown = |row: &usize| image.texels[row * width..(row + 1) * width].iter().any(shown);
    let rows: Vec<usize> = (0..height).filter(is_shown).collect();
    for row in (0..height).filter(|row| rows.binary_search(row).is_err()) {
        if let Some(nearest) = rows.iter().min_by_key(|other| other.abs_diff(row)) {
            for column in 0..width {
                filled.texels[row * width + column] = faint(filled.texels[nearest * width + column]);
            }
        }
    }
    Cow::Owned(filled)
}

/// The same colour, premultiplied, with [`FILLED_ALPHA`].
fn faint([red, green, blue, alpha]: [f32; 4]) -> [f32; 4] {
    [red, green, blue, alpha].map(|value| value * (FILLED_ALPHA / alpha))
}

#[cfg(test)]
mod tests {
    use super::*;
    use viewfuse_core::Vec3;
    use viewfuse_core::camera::{Camera, Pinhole};
    use viewfuse_core::pose::Pose;

    fn image(texels: Vec<[f32; 4]>) -> SourceImage {
        let pinhole = Pinhole::new([4.0; 2], [2.0, 1.0], 4, 2).expect("a pinhole");
        let pose = Pose::look_at(Vec3::ZERO, Vec3::Z, -Vec3::Y).expect("a pose");
        SourceImage { camera: Camera { pose, pinhole }, texels }
    }

    #[test]
    fn the_nearest_colours_fill_what_is_not_shown() {
        let (none, a, b) = ([0.0; 4], [0.5, 0.25, 1.0, 1.0], [0.1, 0.2, 0.15, 0.5]);
        let shown = image(vec![none, none, none, none, none, a, b, none]);
        let filled = filled(&shown);
        let colour = |at: usize| filled.texels[at].map(|value| value / filled.texels[at][3]);
        for (at, expected) in [(0, a), (1, a), (2, b), (3, b), (4, a), (7, b)] {
            let expected = expected.map(|value| value / expected[3]);
            let near = colour(at).iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1.0e-6);
            assert!(near && filled.texels[at][3] < 2.0 * FILLED_ALPHA, "{at}: {:?}", filled.texels[at]);
        }
        assert_eq!((filled.texels[5], filled.texels[6]), (a, b), "what is shown stays");
        let nothing = image(vec![none; 8]);
        assert_eq!(super::filled(&nothing).texels, nothing.texels);
    }
}
