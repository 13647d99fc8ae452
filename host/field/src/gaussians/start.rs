//! The Gaussians to begin with: the sources' surfaces, a cube of points each, and faint ones at random for what no
//! surface was found of.

use super::recipe::Recipe;
use crate::point_cloud::CloudPoint;
use std::collections::BTreeMap;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::random::uniform;
use viewfuse_kernels::rows::GaussianBlock;
use viewfuse_scene::photographs::{SourceImage, SourceImages};

/// Fewest points from which a scene's size is known.
const MIN_POINTS: usize = 32;
/// Percentiles of the points' depths between which Gaussians are drawn at random.
const PERCENTILES: [f64; 2] = [0.02, 0.98];
/// Draws for each Gaussian at random, of which one must be seen by two sources.
const MAX_DRAWS: u32 = 16;

/// The size of a scene, as its sources see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// Median depth of the points, world units.
    pub(super) depth: f32,
    /// Size of a pixel of the finest level at that depth, world units.
    pub(super) footprint: f32,
    /// Nearest and farthest depth of nearly all points.
    near_far: [f32; 2],
}

impl Extent {
    /// Of the points, where `focal` is the focal length in pixels of the finest level; `None` if there are too few.
    pub(super) fn of(points: &[CloudPoint], images: &SourceImages, focal: f32) -> Option<Extent> {
        let step = points.len().div_ceil(10_000).max(1);
        let depths = images.images.iter().flat_map(|image| {
            let camera = image.camera.block(0);
            points.iter().step_by(step).map(move |point| camera.project(point.position))
        });
        let mut depths: Vec<f32> = depths.filter(|seen| seen.in_image).map(|seen| seen.depth).collect();
        if depths.len() < MIN_POINTS {
            return None;
        }
        depths.sort_by(f32::total_cmp);
        let at = |share: f64| depths[((depths.len() - 1) as f64 * share).round() as usize];
        let depth = at(0.5);
        Some(Extent { depth, footprint: depth / focal, near_far: PERCENTILES.map(at) })
    }
}

/// The Gaussians to begin with.
pub(super) fn start(
    points: &[CloudPoint],
    images: &SourceImages,
    extent: &Extent,
    recipe: &Recipe,
) -> Vec<GaussianBlock> {
    let mut gaussians = evenly(of_points(points, extent, recipe), recipe.max_count);
    let count = (recipe.random_count as usize).min(recipe.max_count - gaussians.len());
    let mut drawn = (0..MAX_DRAWS * recipe.random_count).filter_map(|draw| at_random(draw, images, extent, recipe));
    gaussians.extend(drawn.by_ref().take(count));
    gaussians
}

/// What a cube of points adds up to.
#[derive(Clone, Copy, Default)]
struct Cell {
    position: Vec3,
    normal: Vec3,
    colour: Vec3,
    count: u32,
}

/// At most so many of them, evenly by their order: they are sorted by place, and a part without any would stay empty.
fn evenly(gaussians: Vec<GaussianBlock>, most: usize) -> Vec<GaussianBlock> {
    if gaussians.len() <= most {
        return gaussians;
    }
    (0..most).map(|index| gaussians[index * gaussians.len() / most]).collect()
}

/// One Gaussian for each cube of points, in the order of the cubes.
fn of_points(points: &[CloudPoint], extent: &Extent, recipe: &Recipe) -> Vec<GaussianBlock> {
    let side = recipe.cell * extent.footprint;
    let mut cells: BTreeMap<[i32; 3], Cell> = BTreeMap::new();
    for point in points {
        let key = (point.position / side).floor().to_array().map(|place| place as i32);
        let cell = cells.entry(key).or_default();
        cell.position += point.position;
        cell.normal += point.normal;
        cell.colour += Vec3::from_array(point.colour.map(|level| f32::from(level) / 255.0));
        cell.count += 1;
    }
    let cells = cells.values().filter(|cell| cell.count >= recipe.least_points);
    let gaussian = |cell: &Cell| {
        let share = 1.0 / cell.count as f32;
        let mut gaussian = ball(cell.position * share, 0.5 * side, recipe.opacities[0], cell.colour * share);
        if let Some(normal) = cell.normal.try_normalize().filter(|_| recipe.flatness < 1.0) {
            gaussian.log_scales[2] += recipe.flatness.ln();
            gaussian.rotation = towards(normal);
        }
        gaussian
    };
    cells.map(gaussian).collect()
}

/// The rotation that turns the third axis to a unit vector.
fn towards(normal: Vec3) -> [f32; 4] {
    let cross = Vec3::Z.cross(normal);
    let w = 1.0 + normal.z;
    if w < 1.0e-6 { [0.0, 1.0, 0.0, 0.0] } else { [w, cross.x, cross.y, cross.z] }
}

/// A Gaussian of one standard deviation.
fn ball(position: Vec3, scale: f32, opacity: f32, colour: Vec3) -> GaussianBlock {
    GaussianBlock {
        position: position.to_array(),
        opacity: (opacity / (1.0 - opacity)).ln(),
        log_scales: [scale.ln(); 3],
        padding: 0.0,
        rotation: [1.0, 0.0, 0.0, 0.0],
        colour: colour.to_array(),
        padding_end: 0.0,
    }
}

/// A faint Gaussian on a ray of a source, at a disparity between those of the points; `None` if fewer than two sources
/// see its place.
fn at_random(draw: u32, images: &SourceImages, extent: &Extent, recipe: &Recipe) -> Option<GaussianBlock> {
    let random = |sample: u32| uniform(recipe.seed, draw, sample);
    let cameras: Vec<CameraBlock> = images.images.iter().map(|image| image.camera.block(0)).collect();
    let camera = cameras.get((random(0) * cameras.len() as f32) as usize)?;
    let [near, far] = extent.near_far;
    let disparity = 1.0 / far + random(1) * (1.0 / near - 1.0 / far);
    let towards = camera.towards(random(2) * camera.width as f32, random(3) * camera.height as f32);
    let position = camera.centre_world() + towards / disparity;
    let seen = images.images.iter().zip(&cameras).filter_map(|(image, camera)| colour_at(image, camera, position));
    let (sum, count) = seen.fold((Vec3::ZERO, 0), |(sum, count), colour| (sum + colour, count + 1));
    let scale = 0.7 * recipe.cell * extent.footprint;
    (count >= 2).then(|| ball(position, scale, recipe.opacities[1], sum / count as f32))
}

/// The colour that a source shows at a point; `None` if it does not see it, or shows none of the object there.
fn colour_at(image: &SourceImage, camera: &CameraBlock, position: Vec3) -> Option<Vec3> {
    let seen = camera.project(position);
    let [red, green, blue, alpha] =
        if seen.in_image { image.texels[camera.texel_at(seen.x, seen.y)] } else { [0.0; 4] };
    (alpha > 0.5).then(|| Vec3::new(red, green, blue) / alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_than_there_are_still_fill_the_whole() {
        let at = |place: f32| ball(Vec3::new(place, 0.0, 0.0), 1.0, 0.5, Vec3::ZERO);
        let places = |most: usize| -> Vec<f32> {
            let row = (0..10).map(|place| at(place as f32)).collect();
            evenly(row, most).iter().map(|gaussian| gaussian.position[0]).collect()
        };
        assert_eq!(places(4), [0.0, 2.0, 5.0, 7.0]);
        assert_eq!(places(10), places(20));
        assert!(places(0).is_empty());
    }
}
