//! Photographs that state their focal length as cameras do.

use image::DynamicImage;
use image::codecs::jpeg::JpegEncoder;

/// Diagonal of 36 mm by 24 mm, in millimetres.
const FULL_FRAME_DIAGONAL: f64 = 43.266_615_305_567_87;

/// The quality of the JPEG files.
const QUALITY: u8 = 97;

/// A JPEG file whose EXIF has the 35 mm equivalent of a focal length in pixels, in whole millimetres.
pub(super) fn jpeg(picture: &DynamicImage, focal: f64) -> anyhow::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let picture = picture.to_rgb8();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(&picture)?;
    let diagonal = f64::from(picture.width()).hypot(f64::from(picture.height()));
    let film = (focal / diagonal * FULL_FRAME_DIAGONAL).round() as u16;
    let tiff = [
        // Big endian; the first directory has one entry, the place of EXIF's.
        b"MM\0*\0\0\0\x08\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x1a\0\0\0\0".as_slice(),
        // EXIF's has one: FocalLengthIn35mmFilm, a short number.
        b"\0\x01\xa4\x05\0\x03\0\0\0\x01".as_slice(),
        film.to_be_bytes().as_slice(),
        &[0; 6],
    ]
    .concat();
    let length = (2 + 6 + tiff.len()) as u16;
    Ok([&bytes[..2], &[0xff, 0xe1], &length.to_be_bytes(), b"Exif\0\0", &tiff, &bytes[2..]].concat())
}
