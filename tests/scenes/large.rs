//! Large photographs: reduced as soon as they are decoded, to the same pictures but for rounding.

use super::made::open;
use image::{Rgba, RgbaImage};
use viewfuse::job::progress::Silent;
use viewfuse::scene::photographs::{Album, BackgroundChoice};
use viewfuse_core::random::uniform;
use viewfuse_tests::scenes::{self, Folder};

/// The SRN scene with photographs of this many times its size: a disc on a transparent ground.
fn folder(times: u32) -> Folder {
    let folder = scenes::srn();
    for name in ["2", "10"] {
        let (width, height) = (16 * times, 12 * times);
        let pixel = |x: u32, y: u32| {
            let (across, down) = (2.0 * x as f32 / width as f32 - 1.0, 2.0 * y as f32 / height as f32 - 1.0);
            let alpha = if across.hypot(down) < 0.8 { 255 } else { 0 };
            Rgba([(100.0 + 80.0 * across) as u8, (100.0 + 80.0 * down) as u8, (x % 7) as u8, alpha])
        };
        RgbaImage::from_fn(width, height, pixel).save(folder.file(&format!("rgb/{name}.png"))).expect("a photograph");
    }
    folder
}

#[test]
fn large_photographs_are_reduced_once() {
    // 1600 pixels, of which 64 are needed: 640 are kept.
    let folder = folder(100);
    let scene = open(&folder);
    let sources = |album: &Album| album.sources(&[0, 1], 64, BackgroundChoice::Auto, &Silent).expect("sources");
    let whole = Album::open(&scene, [0, 1], &Silent).expect("photographs");
    let reduced = Album::open_at(&scene, [0, 1], 64, &Silent).expect("photographs");
    let (expected, found) = (sources(&whole), sources(&reduced));
    assert_eq!(found.images[0].camera, expected.images[0].camera);
    assert_ne!(found, expected, "nothing was reduced");
    let texels = |images: &viewfuse::scene::photographs::SourceImages| images.images[1].texels.clone();
    for (found, expected) in texels(&found).into_iter().zip(texels(&expected)) {
        for (a, b) in found.into_iter().zip(expected) {
            assert!((a - b).abs() < 1.5 / 255.0, "{a} and {b}");
        }
    }
    let truth = |album: &Album| album.truth(0, [64, 48], Some([0.5; 3])).expect("a truth").picture;
    for (a, b) in truth(&whole).pixels().zip(truth(&reduced).pixels()) {
        assert!((0..3).all(|channel| a[channel].abs_diff(b[channel]) <= 2), "{a:?} and {b:?}");
    }
    // What is read again when it is needed is reduced the same way.
    assert_eq!(sources(&Album::open_at(&scene, [], 64, &Silent).expect("none")), found);
}

/// A mean over means of fractions of pixels would be a blurred truth, which blurred pictures are nearer to.
#[test]
fn truths_of_large_photographs_are_means_of_their_pixels() {
    let folder = folder(100);
    let noise = |x: u32, y: u32| {
        Rgba([0, 1, 2, 3].map(|channel| (uniform(channel, x, y) * 255.9) as u8 | if channel == 3 { 255 } else { 0 }))
    };
    RgbaImage::from_fn(1600, 1200, noise).save(folder.file("rgb/2.png")).expect("a photograph");
    let scene = open(&folder);
    let truth = |album: &Album, size: [u32; 2]| album.truth(0, size, None).expect("a truth").picture;
    let whole = Album::open(&scene, [0, 1], &Silent).expect("photographs");
    for size in [[64, 48], [96, 72], [192, 144], [250, 188], [300, 225]] {
        let album = Album::open_for(&scene, [0, 1], |_| size, 2 * size[0] / 3, &Silent).expect("photographs");
        for (a, b) in truth(&whole, size).pixels().zip(truth(&album, size).pixels()) {
            assert!((0..3).all(|channel| a[channel].abs_diff(b[channel]) <= 1), "{size:?}: {a:?} and {b:?}");
        }
    }
}

/// What a mask hides is there all the same when a scene is used without its masks.
#[test]
fn what_a_mask_hides_is_kept() {
    let folder = folder(100);
    let whole_pictures = |scene: &viewfuse::scene::Scene, longest_side: u32| {
        let album = Album::open_at(scene, [0, 1], longest_side, &Silent).expect("photographs");
        album.sources(&[0, 1], 64, BackgroundChoice::None, &Silent).expect("sources").images[0].texels.clone()
    };
    let mut scene = open(&folder);
    let opaque = |_, _| Rgba([200, 150, 40, 255]);
    RgbaImage::from_fn(1600, 1200, opaque).save(folder.file("rgb/2.png")).expect("a photograph");
    let mask = |x: u32, _| image::Luma([if x < 700 { 255 } else { 0 }]);
    image::GrayImage::from_fn(1600, 1200, mask).save(folder.file("mask.png")).expect("a mask");
    scene.views[0].mask = Some(folder.file("mask.png"));
    // Kept at their own size, and reduced as soon as they are decoded.
    for longest_side in [1600, 64] {
        for texel in whole_pictures(&scene, longest_side) {
            for (channel, level) in [200.0, 150.0, 40.0, 255.0].into_iter().enumerate() {
                assert!((255.0 * texel[channel] - level).abs() < 1.01, "{texel:?} of {longest_side}");
            }
        }
    }
}

#[test]
fn a_lens_is_undone_after_the_reduction() {
    let folder = Folder::new();
    let pixel = |x: u32, y: u32| image::Rgb([(x / 8) as u8, (y / 6) as u8, 90]);
    image::RgbImage::from_fn(1600, 1200, pixel).save(folder.file("images/1.png")).expect("a photograph");
    let transforms = serde_json::json!({
        "fl_x": 1500, "k1": 0.2, "w": 1600, "h": 1200,
        "frames": [{ "file_path": "images/1.png", "transform_matrix": scenes::opengl_matrix() }],
    });
    folder.write("transforms.json", transforms.to_string());
    let scene = open(&folder);
    let texels = |album: &Album| {
        let images = album.sources(&[0], 100, BackgroundChoice::None, &Silent).expect("sources").images;
        images[0].texels.clone()
    };
    let whole = texels(&Album::open(&scene, [0], &Silent).expect("a photograph"));
    let reduced = texels(&Album::open_at(&scene, [0], 100, &Silent).expect("a photograph"));
    // The corners were not seen: nothing is there. Along the border of what was seen, shares of pixels differ.
    assert_eq!((whole[0], reduced[0]), ([0.0; 4], [0.0; 4]));
    let inside = whole.iter().zip(&reduced).filter(|(a, b)| a[3] == 1.0 && b[3] == 1.0);
    let mut count = 0;
    for (a, b) in inside {
        count += 1;
        assert!((0..4).all(|channel| (a[channel] - b[channel]).abs() < 2.0 / 255.0), "{a:?} and {b:?}");
    }
    assert!(count > 6000, "{count}");
}

#[test]
fn photographs_of_a_usual_size_are_kept_as_they_are() {
    let folder = folder(64);
    let scene = open(&folder);
    let whole = Album::open(&scene, [0, 1], &Silent).expect("photographs");
    let reduced = Album::open_at(&scene, [0, 1], 64, &Silent).expect("photographs");
    let sources = |album: &Album| album.sources(&[0, 1], 64, BackgroundChoice::Auto, &Silent).expect("sources");
    assert_eq!(sources(&whole), sources(&reduced));
}
