//! Image files: their headers when a scene is opened, their pixels when a view is needed.
//!
//! An orientation tag (EXIF) is not applied: the poses are those of the pixels as they are stored.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use image::{ImageReader, Limits};

use super::error::SceneError;
use super::files::unreadable;
use super::{LARGEST_SIDE, Photograph};

/// Most bytes of a decoded pixel: four channels of 16 bits.
const LARGEST_PIXEL: u64 = 8;

/// What a decoder may need beside the pixels: its rows, tables, colour profiles.
const DECODER_ALLOWANCE: u64 = 64 << 20;

/// Width and height from the header; nothing of the size that it states is allocated.
///
/// # Errors
/// [`SceneError::TooLarge`] if a side has more than [`LARGEST_SIDE`] pixels; otherwise as for any unreadable image.
pub(super) fn size(path: &Path) -> Result<[u32; 2], SceneError> {
    let dimensions = open(path)?.into_dimensions();
    let (width, height) = dimensions.map_err(|cause| SceneError::Image { path: path.to_path_buf(), cause })?;
    if width > LARGEST_SIDE || height > LARGEST_SIDE {
        return Err(SceneError::TooLarge { path: path.to_path_buf(), width, height });
    }
    Ok([width, height])
}

/// The pixels as straight 8-bit RGBA; 16-bit channels are rounded to the nearest.
///
/// The header is checked first, and the decoder may allocate no more than an image of that size can need.
pub(super) fn decode(path: &Path) -> Result<Photograph, SceneError> {
    let [width, height] = size(path)?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(width);
    limits.max_image_height = Some(height);
    limits.max_alloc = Some(u64::from(width) * u64::from(height) * LARGEST_PIXEL + DECODER_ALLOWANCE);
    let mut reader = open(path)?;
    reader.limits(limits);
    let decoded = reader.decode().map_err(|cause| SceneError::Image { path: path.to_path_buf(), cause })?;
    let has_channel = decoded.color().has_alpha();
    let pixels = decoded.into_rgba8();
    // SRN's photographs carry an alpha channel that is 255 everywhere: it says nothing.
    let has_alpha = has_channel && pixels.pixels().any(|pixel| pixel[3] < u8::MAX);
    Ok(Photograph { pixels, has_alpha })
}

/// A reader whose format is that of the content, whatever the file's extension says.
fn open(path: &Path) -> Result<ImageReader<BufReader<File>>, SceneError> {
    let reader = ImageReader::open(path).and_then(ImageReader::with_guessed_format);
    reader.map_err(|cause| unreadable(path, cause))
}
