//! A camera's photograph of a scenery, and its exact depth.
//!
//! Every pixel is the mean light of n x n rays through the image coordinates `column + (2 i + 1) / (2 n)` and
//! `row + (2 j + 1) / (2 n)`, made a display value afterwards. The random numbers of a ray are a grid over the unit
//! square, moved by an amount of the pixel's own: the same seed gives the same picture bit for bit, on any number of
//! threads.

use crate::scenes::illumination::{Chances, illuminate};
use crate::scenes::noise::fractions;
use crate::scenes::render::to_byte;
use crate::scenes::scenery::Scenery;
use crate::scenes::texture::display_from_light;
use crate::scenes::trace::{first, trace};
use image::RgbImage;
use rayon::prelude::*;
use viewfuse_core::Vec3;
use viewfuse_core::camera::Camera;
use viewfuse_core::math::min;

/// Rays per pixel along each axis that make a good picture.
pub const RAYS_PER_SIDE: u32 = 4;

/// Light above this is pressed together, so that highlights keep their drawing.
const SHOULDER: f32 = 0.7;

/// One of a pixel's rays.
struct PixelChances {
    seed: u32,
    column: u32,
    row: u32,
    ray: u32,
    rays_per_side: u32,
}

impl Chances for PixelChances {
    fn pair(&self, purpose: usize) -> [f32; 2] {
        // Each purpose goes through the grid in another order: factors that no number of rays up to 6 x 6 divides.
        const STEPS: [u32; 4] = [7, 11, 13, 17];
        let count = self.rays_per_side * self.rays_per_side;
        let place = (self.ray * STEPS[purpose % STEPS.len()] + 3 * purpose as u32) % count;
        let cell = [place % self.rays_per_side, place / self.rays_per_side];
        let [u, v, ..] = fractions(self.seed, [self.column as i32, self.row as i32, purpose as i32]);
        let within = |index: u32, shift: f32| {
            let sum = index as f32 / self.rays_per_side as f32 + shift;
            min(if sum >= 1.0 { sum - 1.0 } else { sum }, 0.999_999)
        };
        [within(cell[0], u), within(cell[1], v)]
    }
}

/// The photograph, of the camera's size. With no rays per side it is black.
pub fn photograph(scenery: &Scenery, camera: &Camera, rays_per_side: u32, seed: u32) -> RgbImage {
    let (width, height) = (camera.pinhole.width(), camera.pinhole.height());
    let mut pixels = RgbImage::new(width, height);
    pixels.par_chunks_exact_mut(3 * width as usize).enumerate().for_each(|(row, values)| {
        for (column, value) in values.chunks_exact_mut(3).enumerate() {
            let place = [column as u32, row as u32];
            let light = pixel(scenery, camera, rays_per_side, place, seed);
            let display = display_from_light(Vec3::new(pressed(light.x), pressed(light.y), pressed(light.z)));
            value.copy_from_slice(&display.to_array().map(to_byte));
        }
    });
    pixels
}

/// Depth of each pixel's centre along the camera's forward axis, row by row, in world units; infinite where nothing is.
pub fn depth(scenery: &Scenery, camera: &Camera) -> Vec<f32> {
    let (width, height) = (camera.pinhole.width() as usize, camera.pinhole.height() as usize);
    let mut depths = vec![f32::INFINITY; width * height];
    depths.par_chunks_exact_mut(width.max(1)).enumerate().for_each(|(row, values)| {
        for (column, value) in values.iter_mut().enumerate() {
            let ray = camera.ray(column as f32 + 0.5, row as f32 + 0.5);
            if let Some((distance, _)) = first(scenery.object(), &ray, f32::MAX) {
                *value = distance * ray.direction_world.dot(camera.pose.forward_world());
            }
        }
    });
    depths
}

/// Mean light of a pixel's rays.
fn pixel(scenery: &Scenery, camera: &Camera, rays_per_side: u32, [column, row]: [u32; 2], seed: u32) -> Vec3 {
    let place = |pixel: u32, index: u32| pixel as f32 + (index as f32 + 0.5) / rays_per_side as f32;
    let mut sum = Vec3::ZERO;
    for j in 0..rays_per_side {
        for i in 0..rays_per_side {
            let ray = camera.ray(place(column, i), place(row, j));
            let chances = PixelChances { seed, column, row, ray: j * rays_per_side + i, rays_per_side };
            if let Some(hit) = trace(scenery.object(), &ray) {
                sum += illuminate(scenery, &ray, &hit, &chances);
            }
        }
    }
    if rays_per_side == 0 { sum } else { sum / (rays_per_side * rays_per_side) as f32 }
}

/// Light in `[0, 1)`: itself up to [`SHOULDER`], with the same slope beyond, never reaching 1.
fn pressed(light: f32) -> f32 {
    if light <= SHOULDER {
        return light;
    }
    let beyond = (light - SHOULDER) / (1.0 - SHOULDER);
    SHOULDER + (1.0 - SHOULDER) * beyond / (1.0 + beyond)
}
