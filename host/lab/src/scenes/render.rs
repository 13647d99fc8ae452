//! A camera's picture of an object.
//!
//! Every pixel is the mean of n x n rays (4 x 4 if not told otherwise) on a fixed grid, through the image coordinates
//! `column + (2 i + 1) / (2 n)` and `row + (2 j + 1) / (2 n)` of [`Camera::ray`]'s convention. Alpha is the fraction of
//! them that hit; the colour is the mean over those alone, in display values, so it is straight (not premultiplied) and
//! has no fringe of any background.

use crate::scenes::object::Object;
use crate::scenes::shade::shade;
use crate::scenes::trace::trace;
use image::RgbaImage;
use rayon::prelude::*;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_scene::photographs::{SourceImage, SourceImages};

/// Rays per pixel along each axis, if not told otherwise.
pub const RAYS_PER_SIDE: u32 = 4;

/// Straight 8-bit RGBA of the camera's size. Where nothing is hit, the pixel is white and transparent: readers that
/// drop alpha then see the white background that scenes of this layout have.
///
/// Rows are computed in parallel and each depends on nothing but its own rays: the result does not depend on the
/// number of threads.
pub fn render(object: &Object, camera: &Camera) -> RgbaImage {
    render_with(object, camera, RAYS_PER_SIDE)
}

/// As [`render`], with another number of rays per pixel along each axis; with none, nothing is hit.
pub fn render_with(object: &Object, camera: &Camera, rays_per_side: u32) -> RgbaImage {
    let (width, height) = (camera.pinhole.width(), camera.pinhole.height());
    let mut pixels = RgbaImage::new(width, height);
    let row_length = 4 * width as usize;
    pixels.par_chunks_exact_mut(row_length).enumerate().for_each(|(row, values)| {
        for (column, value) in values.chunks_exact_mut(4).enumerate() {
            value.copy_from_slice(&pixel(object, camera, rays_per_side, [column as u32, row as u32]));
        }
    });
    pixels
}

/// The object from cameras as a field is given its sources: photographs with silhouettes, on white.
pub fn sources(object: &Object, cameras: &[Camera]) -> SourceImages {
    let texel = |pixel: &image::Rgba<u8>| {
        let [red, green, blue, alpha] = pixel.0.map(|value| f32::from(value) / 255.0);
        [red * alpha, green * alpha, blue * alpha, alpha]
    };
    let image =
        |camera: &Camera| SourceImage { camera: *camera, texels: render(object, camera).pixels().map(texel).collect() };
    SourceImages {
        images: cameras.iter().map(image).collect(),
        background: [1.0; 3],
        has_silhouettes: true,
        points: Vec::new(),
        near_far: None,
        focus: None,
        warnings: Vec::new(),
    }
}

fn pixel(object: &Object, camera: &Camera, rays_per_side: u32, [column, row]: [u32; 2]) -> [u8; 4] {
    let place = |pixel: u32, index: u32| pixel as f32 + (index as f32 + 0.5) / rays_per_side as f32;
    let mut sum = Vec3::ZERO;
    let mut hit_count = 0;
    for j in 0..rays_per_side {
        for i in 0..rays_per_side {
            let ray = camera.ray(place(column, i), place(row, j));
            if let Some(hit) = trace(object, &ray) {
                sum += shade(object, &ray, &hit);
                hit_count += 1;
            }
        }
    }
    if hit_count == 0 {
        return [255, 255, 255, 0];
    }
    let mean = sum / hit_count as f32;
    let ray_count = rays_per_side * rays_per_side;
    let alpha = (hit_count * 255 + ray_count / 2) / ray_count;
    [to_byte(mean.x), to_byte(mean.y), to_byte(mean.z), alpha as u8]
}

/// Nearest of the 256 levels; the conversion saturates.
pub(super) fn to_byte(display: f32) -> u8 {
    (display * 255.0 + 0.5) as u8
}
