//! Photographs and pictures of any size: what the networks need beyond them is added, and cut off again.

use super::{assert_sound, exact, made, picture, target};
use viewfuse::field::genvs::GenvsOptions;
use viewfuse::scene::photographs::{SourceImage, SourceImages};
use viewfuse_core::camera::{Camera, Pinhole};
use viewfuse_tests::lorry::photographs;

/// Another number of columns and rows; nothing moves.
fn with_size(camera: &Camera, width: u32, height: u32) -> Camera {
    let pinhole = Pinhole::new(camera.pinhole.focal(), camera.pinhole.principal(), width, height);
    Camera { pinhole: pinhole.expect("sound intrinsics"), ..*camera }
}

/// With white, or with whatever else, on the right and below.
fn padded(image: &SourceImage, width: u32, height: u32) -> SourceImage {
    let own_width = image.camera.pinhole.width() as usize;
    let mut texels = vec![[1.0; 4]; (width * height) as usize];
    for (row, given) in texels.chunks_exact_mut(width as usize).zip(image.texels.chunks_exact(own_width)) {
        row[..own_width].copy_from_slice(given);
    }
    SourceImage { camera: with_size(&image.camera, width, height), texels }
}

/// The length of rays depends on the height of the picture unless it is given.
fn options() -> GenvsOptions {
    let mut options = exact();
    options.rays.length = Some(0.5);
    options
}

#[test]
fn photographs_of_any_size_are_padded_with_white() {
    for side in [30, 17, 1] {
        let given = photographs(2, side);
        let next = side.next_multiple_of(16);
        let images = given.images.iter().map(|image| padded(image, next, next)).collect();
        let by_hand = SourceImages { images, ..given.clone() };
        let field = made(options());
        assert_eq!(picture(&field, &given, &target(16)), picture(&field, &by_hand, &target(16)), "side {side}");
    }
}

#[test]
fn pictures_of_any_size_are_parts_of_larger_ones() {
    let (sources, field) = (photographs(2, 32), made(options()));
    let large = picture(&field, &sources, &target(32));
    for (width, height) in [(31, 29), (30, 32), (32, 30)] {
        let part = picture(&field, &sources, &with_size(&target(32), width, height));
        assert_sound(&part);
        let rows = large.colours.chunks_exact(32).take(height as usize);
        let expected: Vec<[f32; 4]> = rows.flat_map(|row| row[..width as usize].to_vec()).collect();
        assert_eq!(part.colours, expected, "{width}x{height}");
    }
}
