//! Whether given Gaussians show what the sources show: they may be in another world, or in sight of no camera.

use crate::{FieldError, Rendered};
use viewfuse_core::camera::CameraBlock;
use viewfuse_scene::photographs::{SourceImage, SourceImages};

/// Longest side of the compared pictures.
const SIDE: u32 = 64;
/// Correlation below which Gaussians do not show the photographs, whatever the exposure. Those of five scenes after a
/// quarter of an optimisation are above it; the room's, in the world of nerfstudio's training, have 0.10.
const MIN_CORRELATION: f64 = 0.4;
/// Mean opacity below which nothing is in sight.
const MIN_OPACITY: f32 = 0.002;
/// Variance below which a photograph shows nothing to compare with.
const MIN_VARIANCE: f64 = 1.0e-4;

/// The sentence for Gaussians that do not show what two of the sources show; `picture` is theirs for a camera.
pub(super) fn warning(
    sources: &SourceImages,
    mut picture: impl FnMut(&CameraBlock) -> Result<Rendered, FieldError>,
) -> Result<Option<String>, FieldError> {
    let count = sources.images.len();
    let (mut correlations, mut is_in_sight, mut compared) = (Vec::new(), false, 0);
    for view in [0, count / 2].iter().take(count.min(2)) {
        // A camera that cannot be reduced is of a picture without sides.
        let Ok(image) = sources.images[*view].reduced(SIDE) else { continue };
        let shown = picture(&image.camera.block(0))?;
        compared += 1;
        is_in_sight |= shown.confidences.iter().sum::<f32>() > MIN_OPACITY * shown.confidences.len() as f32;
        correlations.extend(correlation(sources, &image, &shown));
    }
    if compared > 0 && !is_in_sight {
        return Ok(Some("the photographs' cameras see none of the Gaussians: the pictures are empty".to_owned()));
    }
    let mean = correlations.iter().sum::<f64>() / correlations.len().max(1) as f64;
    Ok((!correlations.is_empty() && mean < MIN_CORRELATION).then(|| {
        format!(
            "the Gaussians do not show what the photographs show (correlation {mean:.2}, {MIN_CORRELATION} and more \
             for those of the scene): they are of another scene, or in another world"
        )
    }))
}

/// The correlation of a source with a picture of its camera, each channel about its mean; `None` for a photograph of
/// one colour.
fn correlation(sources: &SourceImages, image: &SourceImage, shown: &Rendered) -> Option<f64> {
    let [mut product, mut first_square, mut second_square, mut count] = [0.0; 4];
    for channel in 0..3 {
        let pairs: Vec<(f64, f64)> = image
            .texels
            .iter()
            .zip(&shown.colours)
            // Where there are no silhouettes, alpha marks what lies outside of the photograph.
            .filter(|(texel, _)| sources.has_silhouettes || texel[3] > 0.5)
            .map(|(texel, colour)| {
                let over = texel[channel] + (1.0 - texel[3]) * sources.background[channel];
                (f64::from(over), f64::from(colour[channel]))
            })
            .collect();
        let length = pairs.len().max(1) as f64;
        let mean = [pairs.iter().map(|pair| pair.0).sum::<f64>(), pairs.iter().map(|pair| pair.1).sum()];
        for (first, second) in &pairs {
            let (first, second) = (first - mean[0] / length, second - mean[1] / length);
            product += first * second;
            first_square += first * first;
            second_square += second * second;
        }
        count += pairs.len() as f64;
    }
    let is_plain = first_square <= MIN_VARIANCE * count;
    (!is_plain).then(|| product / (first_square * second_square).sqrt().max(f64::MIN_POSITIVE))
}
