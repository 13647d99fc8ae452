//! A camera's photograph of a scenery, and its exact depth.
//!
//! The photograph is the pinhole's, or one through a lens: then a pixel's rays leave in the directions that the lens bends to it.
//!
//! Every pixel is the mean light of n x n rays through the image coordinates `column + (2 i + 1) / (2 n)` and
//! `row + (2 j + 1) / (2 n)`, made a display value afterwards. The random numbers of a ray are a grid over the unit square,
//! moved by an amount of the pixel's own: the same seed gives the same picture bit for bit, on any number of threads.

use crate::illumination::{Chances, illuminate};
use crate::noise::fractions;
use crate::scenery::Scenery;
use crate::texture::{display_from_light, light_from_display};
use crate::trace::{first, trace};
use image::RgbImage;
use rayon::prelude::*;
use viewfuse_core::Vec3;
use viewfuse_core::camera::{Camera, Ray};
use viewfuse_core::lens::Lens;
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

/// The photograph, of the camera's size. `exposure` is a factor on the light: 1 for most cameras.
///
/// With no rays per side the picture is black.
pub fn photograph(scenery: &Scenery, camera: &Camera, rays_per_side: u32, exposure: f32, seed: u32) -> RgbImage {
    photograph_through(scenery, camera, None, rays_per_side, exposure, seed)
}

/// The same through a lens. Where the lens folds over, it shows something that is not there: see
/// [`Lens::reach`](viewfuse_core::lens::Lens::reach).
pub fn photograph_through(
    scenery: &Scenery,
    camera: &Camera,
    lens: Option<&Lens>,
    rays_per_side: u32,
    exposure: f32,
    seed: u32,
) -> RgbImage {
    let ray = |x: f32, y: f32| {
        let [x, y] = lens.map_or([x, y], |lens| straightened(camera, lens, [x, y]));
        camera.ray(x, y)
    };
    let (width, height) = (camera.pinhole.width(), camera.pinhole.height());
    let mut pixels = RgbImage::new(width, height);
    pixels.par_chunks_exact_mut(3 * width as usize).enumerate().for_each(|(row, values)| {
        for (column, value) in values.chunks_exact_mut(3).enumerate() {
            let place = [column as u32, row as u32];
            let light = pixel(scenery, &ray, rays_per_side, place, seed) * exposure;
            let display = display_from_light(Vec3::new(pressed(light.x), pressed(light.y), pressed(light.z)));
            value.copy_from_slice(&display.to_array().map(to_byte));
        }
    });
    pixels
}

/// Depth of each pixel's centre along the camera's forward axis, row by row, in world units; infinite where only the sky is.
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

/// The image coordinate of the pinhole's picture that a lens shows at an image coordinate of the photograph.
fn straightened(camera: &Camera, lens: &Lens, [x, y]: [f32; 2]) -> [f32; 2] {
    let ([focal_x, focal_y], [principal_x, principal_y]) = (camera.pinhole.focal(), camera.pinhole.principal());
    let bent = [(x - principal_x) / focal_x, (y - principal_y) / focal_y].map(f64::from);
    let [x, y] = lens.undistort(bent).point.map(|coordinate| coordinate as f32);
    [x * focal_x + principal_x, y * focal_y + principal_y]
}

/// Mean light of a pixel's rays; `ray_at` is the ray of an image coordinate.
fn pixel(
    scenery: &Scenery,
    ray_at: &impl Fn(f32, f32) -> Ray,
    rays_per_side: u32,
    [column, row]: [u32; 2],
    seed: u32,
) -> Vec3 {
    let place = |pixel: u32, index: u32| pixel as f32 + (index as f32 + 0.5) / rays_per_side as f32;
    let mut sum = Vec3::ZERO;
    for j in 0..rays_per_side {
        for i in 0..rays_per_side {
            let ray = ray_at(place(column, i), place(row, j));
            let chances = PixelChances { seed, column, row, ray: j * rays_per_side + i, rays_per_side };
            sum += match trace(scenery.object(), &ray) {
                Some(hit) => illuminate(scenery, &ray, &hit, &chances),
                None => light_from_display(scenery.background(ray.direction_world)),
            };
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

/// Nearest of the 256 levels; the conversion saturates.
fn to_byte(display: f32) -> u8 {
    (display * 255.0 + 0.5) as u8
}
