//! Pictures as PNG files.

use image::codecs::png::PngEncoder;
use image::{DynamicImage, ImageEncoder, Rgba, RgbaImage};
use std::path::Path;
use viewfuse_job::files::{WriteError, write_whole};
use viewfuse_scene::encode_png;

/// Writes a picture as PNG, completely or not at all.
///
/// # Errors
/// [`WriteError`].
pub fn write_png(path: &Path, picture: &DynamicImage) -> Result<(), WriteError> {
    let bytes = encode_png(picture);
    let bytes = bytes.map_err(|cause| WriteError::Encode { path: path.to_path_buf(), cause: cause.into() })?;
    write_whole(path, &bytes)
}

/// As [`write_png`], with EXIF that names this program, by which it knows the file again.
///
/// # Errors
/// [`WriteError`].
pub fn write_marked_png(path: &Path, picture: &DynamicImage) -> Result<(), WriteError> {
    let mut bytes = Vec::new();
    let mut encoder = PngEncoder::new(&mut bytes);
    // Of an encoder without EXIF the picture is as good, and another time replaced by none.
    let _ = encoder.set_exif_metadata(SOFTWARE.to_vec());
    let written = picture.write_with_encoder(encoder);
    written.map_err(|cause| WriteError::Encode { path: path.to_path_buf(), cause: cause.into() })?;
    write_whole(path, &bytes)
}

/// EXIF with one entry: the software, 9 bytes of text behind it.
const SOFTWARE: &[u8] = b"II*\0\x08\0\0\0\x01\0\x31\x01\x02\0\x09\0\0\0\x1a\0\0\0\0\0\0\0viewfuse\0";

/// A picture with its opacity as straight alpha: what is in front of a background of one colour (in `[0, 1]`), which
/// was mixed into `colours` (red, green, blue in `[0, 1]` and opacity, row-major, of this width and height). Black
/// where the opacity is 0.
pub fn without_background(colours: &[[f32; 4]], [width, height]: [u32; 2], background: [f32; 3]) -> RgbaImage {
    RgbaImage::from_fn(width, height, |x, y| {
        let colour = colours[(y * width + x) as usize];
        let alpha = colour[3].clamp(0.0, 1.0);
        let level = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
        // Opacities that round to 0 have no colour: dividing by them would only enlarge rounding errors.
        if level(alpha) == 0 {
            return Rgba([0; 4]);
        }
        let without = |channel: usize| level((colour[channel] - (1.0 - alpha) * background[channel]) / alpha);
        Rgba([without(0), without(1), without(2), level(alpha)])
    })
}
