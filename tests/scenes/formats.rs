//! Photographs as cameras and programs save them: WebP and TIFF, and JPEGs that say they must be turned.

use super::made::{assert_refused, open};
use image::{DynamicImage, ImageFormat, Rgb, RgbImage};
use serde_json::json;
use std::io::Cursor;
use viewfuse_tests::scenes::{self, Folder};

/// A picture whose left half is red: turned, another half is.
fn half_red(width: u32, height: u32) -> DynamicImage {
    let colour = |x, _| if 2 * x < width { Rgb([200, 10, 10]) } else { Rgb([10, 10, 200]) };
    DynamicImage::ImageRgb8(RgbImage::from_fn(width, height, colour))
}

/// A JPEG whose tag says how it must be turned to be upright.
fn tagged(width: u32, height: u32, orientation: u8) -> Vec<u8> {
    let mut jpeg = Cursor::new(Vec::new());
    half_red(width, height).write_to(&mut jpeg, ImageFormat::Jpeg).expect("a JPEG");
    let mut exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
    exif.extend([orientation, 0, 0, 0, 0, 0, 0, 0]);
    let mut bytes = jpeg.into_inner();
    let mut segment = vec![0xff, 0xe1];
    segment.extend((exif.len() as u16 + 2).to_be_bytes());
    segment.extend(exif);
    bytes.splice(2..2, segment);
    bytes
}

/// `transforms.json` for cameras of this size with a photograph that is stored 32 x 24.
fn folder(size: Option<[u32; 2]>, photograph: &[u8]) -> Folder {
    let mut transforms = json!({
        "fl_x": 20, "frames": [{ "file_path": "images/1.jpg", "transform_matrix": scenes::opengl_matrix() }],
    });
    if let Some([width, height]) = size {
        (transforms["w"], transforms["h"]) = (json!(width), json!(height));
    }
    let folder = Folder::new();
    folder.write("images/1.jpg", photograph).write("transforms.json", transforms.to_string());
    folder
}

/// Whether the middle of this side is red.
fn is_red(folder: &Folder, size: [u32; 2], side: [f64; 2]) -> bool {
    let photograph = open(folder).photograph(0).expect("a photograph");
    assert_eq!(photograph.pixels.dimensions(), size.into());
    let at = [0, 1].map(|axis| (f64::from(size[axis]) * side[axis]) as u32);
    photograph.pixels.get_pixel(at[0], at[1])[0] > 150
}

#[test]
fn a_tag_is_applied_where_the_cameras_are_of_the_upright_picture() {
    // What was on the left is on top after a turn clockwise, at the bottom after one the other way.
    for (orientation, top) in [(6, true), (8, false), (5, true), (7, false)] {
        let folder = folder(Some([24, 32]), &tagged(32, 24, orientation));
        assert_eq!(is_red(&folder, [24, 32], [0.5, 0.2]), top, "{orientation}");
        assert_eq!(is_red(&folder, [24, 32], [0.5, 0.8]), !top, "{orientation}");
        // Also where the photograph is a smaller copy.
        let folder = self::folder(Some([48, 64]), &tagged(32, 24, orientation));
        assert_eq!(is_red(&folder, [24, 32], [0.5, 0.2]), top, "{orientation}");
    }
}

#[test]
fn a_tag_is_left_alone_where_the_cameras_are_of_the_stored_picture() {
    for orientation in [1, 5, 6, 7, 8] {
        let folder = folder(Some([32, 24]), &tagged(32, 24, orientation));
        assert!(is_red(&folder, [32, 24], [0.2, 0.5]) && !is_red(&folder, [32, 24], [0.8, 0.5]));
    }
}

#[test]
fn a_tag_that_could_mean_either_is_refused_by_its_name() {
    for (size, stored, orientation, name) in [
        (None, [32, 24], 6, "Rotate90"),
        (Some([32, 24]), [32, 24], 3, "Rotate180"),
        (Some([32, 24]), [32, 24], 2, "FlipHorizontal"),
        (Some([32, 24]), [32, 24], 4, "FlipVertical"),
        (Some([24, 24]), [24, 24], 8, "Rotate270"),
        (Some([30, 20]), [32, 24], 6, "Rotate90"),
    ] {
        let folder = folder(size, &tagged(stored[0], stored[1], orientation));
        let tag = format!("EXIF orientation {orientation}, {name}");
        assert_refused(&folder, "images/1.jpg: the file says that its pixels must be turned", &[&tag]);
    }
    // Nothing to be turned, nothing to be asked.
    assert!(is_red(&folder(None, &tagged(32, 24, 1)), [32, 24], [0.2, 0.5]));
}

#[test]
fn webp_and_tiff_are_read_whatever_they_are_called() {
    for format in [ImageFormat::WebP, ImageFormat::Tiff, ImageFormat::Png] {
        let mut bytes = Cursor::new(Vec::new());
        half_red(32, 24).write_to(&mut bytes, format).expect("an image");
        let bytes = bytes.into_inner();
        assert!(is_red(&folder(None, &bytes), [32, 24], [0.2, 0.5]), "{format:?}");
        for extension in format.extensions_str() {
            let folder = scenes::srn();
            folder.remove("rgb/2.png");
            let mut small = Cursor::new(Vec::new());
            half_red(16, 12).write_to(&mut small, format).expect("an image");
            folder.write(&format!("rgb/2.{extension}"), small.into_inner());
            assert_eq!(open(&folder).views.len(), 3, "{extension}");
        }
    }
}

#[test]
fn a_header_behind_many_tags_is_found() {
    // A profile of 600 kB before the picture: more than is read at first.
    let mut bytes = tagged(32, 24, 6);
    for _ in 0..10 {
        let mut segment = vec![0xff, 0xe2, 0xea, 0x62];
        segment.resize(60_000 + 2, 0);
        let length = (segment.len() as u16 - 2).to_be_bytes();
        segment[2..4].copy_from_slice(&length);
        bytes.splice(2..2, segment);
    }
    assert!(is_red(&folder(Some([24, 32]), &bytes), [24, 32], [0.5, 0.2]));
}
