//! Photographs as cameras and programs save them: WebP and TIFF, and JPEGs that say they must be turned.

use super::made::{assert_refused, open};
use image::metadata::Orientation;
use image::{DynamicImage, GrayImage, ImageFormat, Luma, Rgb, RgbImage};
use serde_json::json;
use std::io::Cursor;
use viewfuse::job::progress::Silent;
use viewfuse::scene::write::{Layout, write};
use viewfuse::scene::{MaskChoice, Scene};
use viewfuse_tests::scenes::{self, Folder, with_tag};

/// A picture whose left half is red: turned, another half is.
fn half_red(width: u32, height: u32) -> DynamicImage {
    let colour = |x, _| if 2 * x < width { Rgb([200, 10, 10]) } else { Rgb([10, 10, 200]) };
    DynamicImage::ImageRgb8(RgbImage::from_fn(width, height, colour))
}

/// A JPEG whose tag says how it must be turned to be upright.
fn tagged(width: u32, height: u32, orientation: u8) -> Vec<u8> {
    with_tag(&half_red(width, height), orientation)
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
fn a_file_that_is_not_read_is_named_by_its_kind() {
    for (bytes, kind) in [
        (&b""[..], "the file is empty"),
        (b"\0\0\0\x18ftypheic", "a picture of the format HEIC"),
        (b"\0\0\0\x18ftypmif1", "a picture of the format HEIC"),
        (b"\0\0\0\x1cftypavif", "a picture of the format AVIF"),
        (b"\0\0\0\x18ftypmp42", "a video"),
        (b"\0\0\0\x14ftypqt  ", "a video"),
        (b"BM\x36\0", "a picture of the format BMP"),
        (b"GIF89a", "a picture of the format GIF"),
        (b"a letter", "not a readable image"),
    ] {
        assert_refused(&folder(None, bytes), "images/1.jpg: ", &[kind]);
    }
}

/// Decoders make up what is missing, which looks like a photograph.
#[test]
fn a_jpeg_of_damaged_data_is_refused() {
    let whole = tagged(320, 240, 1);
    let (start, end) = (whole.len() / 2, whole.len() - 2);
    let cut = [&whole[..start], &whole[end..]].concat();
    let lacking = [&whole[..start], &whole[start + 200..]].concat();
    let mut wild = whole.clone();
    wild[start..start + 4].copy_from_slice(&[0xff, 0xd8, 0xff, 0xc0]);
    for (what, bytes) in [("cut and ended", cut), ("a marker within", wild)] {
        let read = open(&folder(None, &bytes)).photograph(0);
        let error = read.map(|_| what).expect_err("a part of a picture").to_string();
        assert!(error.contains("images/1.jpg: the file is damaged ("), "{what}: {error}");
    }
    // Where the data are a picture still, nobody can tell.
    _ = open(&folder(None, &lacking)).photograph(0);
    open(&folder(None, &whole)).photograph(0).expect("a photograph");
    // All pixels are those of the usual decoder, also of the least data that a row can have, and in grey.
    for width in [256, 257, 300] {
        for grey in [false, true] {
            let picture = image::RgbImage::from_pixel(width, 40, image::Rgb([90, 120, 150]));
            let picture = image::DynamicImage::from(picture);
            let picture = if grey { picture.to_luma8().into() } else { picture };
            let mut bytes = Vec::new();
            picture.write_to(&mut std::io::Cursor::new(&mut bytes), image::ImageFormat::Jpeg).expect("a JPEG");
            let usual = image::load_from_memory(&bytes).expect("a picture").to_rgba8();
            assert!(open(&folder(None, &bytes)).photograph(0).expect("a photograph").pixels == usual);
        }
    }
}

#[test]
fn a_jpeg_that_ends_before_its_picture_is_refused() {
    let whole = tagged(32, 24, 1);
    open(&folder(None, &whole)).photograph(0).expect("a photograph");
    // Decoders would fill the rest with grey.
    let cut = folder(None, &whole[..whole.len() - 40]);
    let error = open(&cut).photograph(0).expect_err("a part of a picture").to_string();
    assert!(error.ends_with("images/1.jpg: the file ends before the picture does"), "{error}");
    // The end of a thumbnail is not the end, and the end may lie across two buffers of a reader.
    let with_segment = |content: &[u8]| -> Vec<u8> {
        let length = (content.len() as u16 + 2).to_be_bytes();
        [&whole[..2], &[0xff, 0xe5], &length, content, &whole[2..]].concat()
    };
    let thumbnail = with_segment(&[0xff, 0xd9]);
    open(&folder(None, &thumbnail)).photograph(0).expect("a photograph");
    let cut = folder(None, &thumbnail[..thumbnail.len() - 40]);
    open(&cut).photograph(0).expect_err("a part of a picture");
    for total in 8190..8196 {
        let padded = with_segment(&vec![0; total - whole.len() - 4]);
        assert_eq!(padded.len(), total);
        open(&folder(None, &padded)).photograph(0).expect("a photograph");
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

/// A mask whose left half counts.
fn left_half(width: u32, height: u32) -> DynamicImage {
    GrayImage::from_fn(width, height, |x, _| Luma([if 2 * x < width { 255 } else { 0 }])).into()
}

/// A mask as photograph editors write it for the stored or the upright picture.
fn png(picture: &DynamicImage) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png).expect("a PNG");
    bytes.into_inner()
}

/// The scene, whose masks say where an object is.
fn of_object(folder: &Folder) -> Scene {
    Scene::open_masked(folder, MaskChoice::Object).expect("a scene")
}

/// The half of the photograph that is red is the one that its mask says counts.
#[track_caller]
fn assert_masked(folder: &Folder, size: [u32; 2]) {
    let photograph = of_object(folder).photograph(0).expect("a photograph");
    assert_eq!(photograph.pixels.dimensions(), size.into());
    let fits = |pixel: &image::Rgba<u8>| (pixel[0] > 100) == (pixel[3] > 128);
    let wrong = photograph.pixels.pixels().filter(|pixel| !fits(pixel)).count();
    // Compression blurs the line between the halves.
    assert!(wrong <= size[0].max(size[1]) as usize, "{wrong} pixels");
    assert!(photograph.pixels.pixels().any(|pixel| pixel[3] == 0) && photograph.pixels.pixels().any(|p| p[3] == 255));
}

#[test]
fn a_mask_is_turned_like_its_photograph() {
    for orientation in [5, 6, 7, 8] {
        let upright = {
            let mut mask = left_half(32, 24);
            mask.apply_orientation(Orientation::from_exif(orientation).expect("an orientation"));
            mask
        };
        assert_eq!((upright.width(), upright.height()), (24, 32));
        // Cameras of the upright and of the stored picture; masks of each, of another size, and with a tag of their
        // own.
        for size in [[24, 32], [32, 24]] {
            for mask in [
                png(&left_half(32, 24)),
                png(&upright),
                png(&left_half(64, 48)),
                with_tag(&left_half(32, 24), orientation),
            ] {
                let folder = folder(Some(size), &tagged(32, 24, orientation));
                folder.write("masks/1.png", mask);
                assert_masked(&folder, size);
                let scene = of_object(&folder);
                let out = Folder::new();
                for layout in [Layout::Transforms, Layout::Colmap, Layout::Neus] {
                    let path = out.join(layout.to_string());
                    write(&scene, layout, &path, &Silent).expect("written");
                    let read = Scene::open(&path).expect("a scene");
                    assert_eq!(scene.photograph(0).expect("one"), read.photograph(0).expect("the other"));
                }
            }
        }
    }
}

#[test]
fn the_shape_and_the_tag_of_a_mask_tell_which_picture_it_is_of() {
    // Almost square: the shape tells still.
    let folder = folder(Some([99, 100]), &tagged(100, 99, 6));
    let mut upright = left_half(100, 99);
    upright.apply_orientation(Orientation::Rotate90);
    for mask in [png(&left_half(100, 99)), png(&upright), with_tag(&left_half(100, 99), 6)] {
        folder.write("masks/1.png", mask);
        assert_masked(&folder, [99, 100]);
    }
    // A shape that fits neither is refused by its name, with or without a tag.
    for mask in [png(&left_half(50, 50)), png(&left_half(60, 30)), with_tag(&left_half(60, 30), 6)] {
        folder.write("masks/1.png", mask);
        let message = open(&folder).photograph(0).expect_err("another shape").to_string();
        assert!(message.contains("masks/1.png: the image is ") && message.contains("for 99 x 100"), "{message}");
    }
    // Of a square photograph with a tag nothing tells: it is refused, whatever mask it has.
    let square = self::folder(Some([32, 32]), &tagged(32, 32, 6));
    square.write("masks/1.png", with_tag(&left_half(32, 32), 6));
    assert_refused(&square, "images/1.jpg: the file says that its pixels must be turned", &["Rotate90"]);
    // A mask's own tag counts also for a photograph without one.
    let folder = self::folder(Some([24, 32]), &png(&half_red(32, 24).rotate90()));
    folder.write("masks/1.png", with_tag(&left_half(32, 24), 6));
    assert_masked(&folder, [24, 32]);
}
