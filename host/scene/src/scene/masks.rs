//! Masks: images beside the photographs that say what of them counts.
//!
//! A mask is 0 where the photograph does not count and greatest where it does: white objects before black in NeuS's data,
//! black what is to be ignored in COLMAP's and nerfstudio's. Values between are fractions of a pixel. It has the photograph's size,
//! or another of the same shape.

use std::path::Path;

use image::imageops::{FilterType, resize};

use super::Photograph;
use super::check::same_shape;
use super::error::SceneError;
use super::images;

/// Multiplies the photograph's alpha channel by the mask.
///
/// # Errors
/// [`SceneError`] if the mask cannot be decoded, or does not have the photograph's shape.
pub(super) fn apply(path: &Path, photograph: &mut Photograph) -> Result<(), SceneError> {
    let (decoded, _) = images::pixels(path)?;
    let (declared_width, declared_height) = photograph.pixels.dimensions();
    let (width, height) = (decoded.width(), decoded.height());
    if !same_shape([width, height], [declared_width, declared_height]) {
        let declared_in = "the photograph that it is for".to_string();
        let path = path.to_path_buf();
        return Err(SceneError::SizeMismatch { path, width, height, declared_in, declared_width, declared_height });
    }
    // Cut-outs used as masks say it in their alpha channel, over colours of no meaning.
    let has_alpha = decoded.color().has_alpha();
    let rgba = decoded.to_rgba8();
    let speaks = has_alpha && rgba.pixels().any(|pixel| pixel[3] < u8::MAX);
    let mut mask = if speaks {
        image::GrayImage::from_fn(width, height, |x, y| image::Luma([rgba.get_pixel(x, y)[3]]))
    } else {
        decoded.into_luma8()
    };
    if (width, height) != (declared_width, declared_height) {
        mask = resize(&mask, declared_width, declared_height, FilterType::Triangle);
    }
    for (pixel, share) in photograph.pixels.pixels_mut().zip(mask.pixels()) {
        let product = u32::from(pixel[3]) * u32::from(share[0]);
        pixel[3] = ((product + 127) / 255) as u8;
    }
    photograph.has_alpha = true;
    Ok(())
}
