//! A frame as the page gets it: a line of JSON, the picture, and a layer.
//!
//! ```text
//! 4 bytes            length of the JSON, little-endian
//! JSON               size, weights, times, and the lengths of what follows
//! picture            JPEG of a coarse picture, PNG of a full one
//! layer              one byte a pixel, row-major; if one was requested and the field has it
//! ```

use crate::record::PictureRecord;
use crate::request::Layer;
use image::{DynamicImage, ImageError, RgbImage};
use jpeg_encoder::{ColorType, EncodingError};
use serde::Serialize;
use viewfuse_field::render::Frame;
use viewfuse_scene::coverage::Coverage;
use viewfuse_scene::encode_png;

/// Quality of coarse pictures and thumbnails, of 100.
const JPEG_QUALITY: u8 = 88;

/// Percentiles of the depths that are the ends of their colours: single pixels are far off.
const PERCENTILES: [f64; 2] = [0.005, 0.995];

/// A level of a depth layer for "no surface"; surfaces have the levels above it.
const NO_SURFACE: u8 = 0;

#[derive(Serialize)]
struct Header<'a> {
    size: [u32; 2],
    full: bool,
    /// Rendering and encoding of this picture, seconds.
    seconds: f64,
    weights: &'a [f32],
    /// Share of the picture that a photograph shows from within 30 degrees.
    seen: f32,
    /// Sources that were left out, for their weights are the least.
    left_out: u32,
    picture: Part,
    /// The layers that the field has.
    layers: Vec<Layer>,
    layer: Option<LayerPart>,
    /// Of a full picture.
    record: Option<PictureRecord>,
}

#[derive(Serialize)]
struct Part {
    media_type: &'static str,
    bytes: usize,
}

#[derive(Serialize)]
struct LayerPart {
    kind: Layer,
    bytes: usize,
    /// What the least and the greatest level mean: units of the scene's files for depths, `[0, 1]` for confidences.
    range: [f32; 2],
    /// Level 0 is "nothing there".
    has_gaps: bool,
}

/// Why a picture has no answer.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AnswerError {
    /// A full picture.
    #[error(transparent)]
    Png(#[from] ImageError),
    /// A coarse picture.
    #[error(transparent)]
    Jpeg(#[from] EncodingError),
}

/// The bytes of an answer: of a full picture if there is a record of it. A length of the world is `unit` of the scene's
/// files.
pub(crate) fn bytes(
    frame: &Frame,
    coverage: &Coverage,
    layer: Layer,
    unit: f64,
    record: Option<PictureRecord>,
) -> Result<Vec<u8>, AnswerError> {
    let is_full = record.is_some();
    let (media_type, picture) = match is_full {
        true => ("image/png", encode_png(&DynamicImage::ImageRgb8(frame.picture.clone()))?),
        false => ("image/jpeg", jpeg(&frame.picture)?),
    };
    let levels = match layer {
        Layer::None => None,
        Layer::Depth => depth_levels(&frame.depths),
        Layer::Confidence => confidence_levels(&frame.confidences),
    };
    let has = [(Layer::Depth, !frame.depths.is_empty()), (Layer::Confidence, !frame.confidences.is_empty())];
    let header = Header {
        size: frame.picture.dimensions().into(),
        full: is_full,
        seconds: frame.time.as_secs_f64(),
        weights: &frame.weights.values()[..frame.weights.count() as usize],
        seen: coverage.seen_in(
            &frame.target.camera,
            frame.picture.dimensions().into(),
            &frame.depths,
            frame.counts_gaps,
        ),
        left_out: frame.omission.omitted_count,
        picture: Part { media_type, bytes: picture.len() },
        layers: has.into_iter().filter(|(_, is_there)| *is_there).map(|(layer, _)| layer).collect(),
        layer: levels.as_ref().map(|(levels, range)| LayerPart {
            kind: layer,
            bytes: levels.len(),
            range: if layer == Layer::Depth { range.map(|depth| (f64::from(depth) * unit) as f32) } else { *range },
            has_gaps: layer == Layer::Depth,
        }),
        record,
    };
    let json = serde_json::to_vec(&header).unwrap_or_default();
    let mut bytes = Vec::with_capacity(4 + json.len() + picture.len());
    bytes.extend(u32::try_from(json.len()).unwrap_or(0).to_le_bytes());
    bytes.extend(json);
    bytes.extend(picture);
    bytes.extend(levels.map(|(levels, _)| levels).unwrap_or_default());
    Ok(bytes)
}

/// A picture as JPEG, for thumbnails and coarse pictures.
pub(crate) fn jpeg(picture: &RgbImage) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    // Pictures are far smaller than what 16 bits say.
    let [width, height] = [picture.width(), picture.height()].map(|side| u16::try_from(side).unwrap_or(u16::MAX));
    jpeg_encoder::Encoder::new(&mut bytes, JPEG_QUALITY).encode(picture, width, height, ColorType::Rgb)?;
    Ok(bytes)
}

/// Depths between their percentiles as levels 1 to 255, and those percentiles; `None` for fields without depths, and
/// where there is no surface at all.
fn depth_levels(depths: &[f32]) -> Option<(Vec<u8>, [f32; 2])> {
    let mut sorted: Vec<f32> = depths.iter().copied().filter(|depth| *depth > 0.0).collect();
    if sorted.is_empty() {
        return None;
    }
    sorted.sort_unstable_by(f32::total_cmp);
    let range = PERCENTILES.map(|share| sorted[((sorted.len() - 1) as f64 * share).round() as usize]);
    let width = (range[1] - range[0]).max(f32::MIN_POSITIVE);
    let level = |depth: &f32| match *depth > 0.0 {
        true => 1 + (254.0 * ((depth - range[0]) / width).clamp(0.0, 1.0) + 0.5) as u8,
        false => NO_SURFACE,
    };
    Some((depths.iter().map(level).collect(), range))
}

/// Confidences as levels 0 to 255; `None` for fields that do not tell.
fn confidence_levels(confidences: &[f32]) -> Option<(Vec<u8>, [f32; 2])> {
    let level = |confidence: &f32| (255.0 * confidence.clamp(0.0, 1.0) + 0.5) as u8;
    (!confidences.is_empty()).then(|| (confidences.iter().map(level).collect(), [0.0, 1.0]))
}

#[cfg(test)]
mod tests {
    use super::{confidence_levels, depth_levels};

    #[test]
    fn levels_of_depths() {
        let (levels, range) = depth_levels(&[0.0, 2.0, 4.0, 3.0]).expect("depths");
        assert_eq!((levels, range), (vec![0, 1, 255, 128], [2.0, 4.0]));
        assert_eq!(depth_levels(&[5.0; 3]).expect("depths"), (vec![1; 3], [5.0; 2]));
        assert!(depth_levels(&[]).is_none() && depth_levels(&[0.0]).is_none());
        // One pixel that is far off does not change the colours of the others.
        let mut depths: Vec<f32> = (0..1000).map(|index| 1.0 + index as f32 / 1000.0).collect();
        depths[7] = 1.0e6;
        assert!(depth_levels(&depths).expect("depths").1[1] < 2.0);
    }

    #[test]
    fn levels_of_confidences() {
        assert_eq!(confidence_levels(&[0.0, 0.5, 1.0, 2.0]).expect("levels").0, [0, 128, 255, 255]);
        assert!(confidence_levels(&[]).is_none());
    }
}
