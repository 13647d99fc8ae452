//! Photographs: PNG, JPEG, WebP, TIFF.

use super::{OneFile, Target, Verdict, verdict};
use image::{DynamicImage, ImageFormat, Rgba, RgbaImage};
use std::io::Cursor;
use viewfuse::scene::read_picture;
use viewfuse_tests::scenes::png_checksum;

pub(crate) struct Images(pub(super) OneFile);

impl Target for Images {
    fn seeds(&self) -> Vec<Vec<u8>> {
        let picture =
            RgbaImage::from_fn(12, 9, |x, y| Rgba([x as u8 * 20, y as u8 * 28, 99, if x > 5 { 255 } else { 90 }]));
        let picture = DynamicImage::ImageRgba8(picture);
        let kinds = [
            picture.clone(),
            picture.to_rgb8().into(),
            picture.to_luma8().into(),
            picture.to_rgba16().into(),
            picture.to_luma_alpha8().into(),
        ];
        let mut seeds = vec![include_bytes!("../../data/fuzz/fell/images/palette.png").to_vec()];
        for picture in kinds {
            for format in [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP, ImageFormat::Tiff] {
                let mut bytes = Cursor::new(Vec::new());
                // Not every format has every kind of pixel.
                if picture.write_to(&mut bytes, format).is_ok() {
                    seeds.push(bytes.into_inner());
                }
            }
        }
        seeds
    }

    fn words(&self) -> &'static [&'static str] {
        &[
            "IHDR", "PLTE", "tRNS", "IDAT", "iCCP", "eXIf", "VP8 ", "VP8L", "VP8X", "ALPH", "ANIM", "Exif\0\0",
            "II*\0", "MM\0*",
        ]
    }

    /// The pieces of a PNG with their checksums.
    fn repaired(&self, mut bytes: Vec<u8>) -> Vec<u8> {
        let mut at = 8;
        while bytes.starts_with(b"\x89PNG") && at + 12 <= bytes.len() {
            let length = u32::from_be_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]) as usize;
            let Some(end) = at.checked_add(8 + length).filter(|end| end + 4 <= bytes.len()) else { break };
            let check = png_checksum(&bytes[at + 4..end]);
            bytes[end..end + 4].copy_from_slice(&check.to_be_bytes());
            at = end + 4;
        }
        bytes
    }

    fn run(&mut self, bytes: &[u8]) -> Result<Verdict, String> {
        let path = self.0.write(bytes);
        verdict(read_picture(path).map(DynamicImage::into_rgba8), path)
    }
}
