//! The Gaussians to begin with: the sources' surfaces, a cube of points each, and large faint ones behind all points
//! for what is far away or of which no surface was found.

use super::recipe::Recipe;
use crate::point_cloud::CloudPoint;
use std::collections::BTreeMap;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::random::uniform;
use viewfuse_device::parallel::map;
use viewfuse_kernels::rows::GaussianBlock;
use viewfuse_scene::photographs::{SourceImage, SourceImages};

/// Fewest points from which a scene's size is known.
const MIN_POINTS: usize = 32;
/// Percentile of the points' depths behind which the background is.
const FARTHEST: f64 = 0.98;
/// Share of the depths that are nearer than the near ones.
const NEAREST: f64 = 0.01;
/// Most halvings of a cube of near points.
const MAX_HALVINGS: u32 = 8;
/// Its least disparity, relative to that of the farthest points.
const LEAST_DISPARITY: f32 = 0.1;

/// The size of a scene, as its sources see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// Median depth of the points, world units.
    pub(super) depth: f32,
    /// Size of a pixel of the finest level at that depth, world units.
    pub(super) footprint: f32,
    /// Depth that [`NEAREST`] of the points are nearer than.
    nearest: f32,
    /// Depth of the farthest points.
    far: f32,
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
        Some(Extent { depth, footprint: depth / focal, nearest: at(NEAREST), far: at(FARTHEST) })
    }

    /// Depth from which on Gaussians are seen: a share of the median depth, or where something is nearer than that, of
    /// what is the nearest.
    pub(super) fn near(&self, share: f32) -> f32 {
        let usual = share * self.depth;
        if self.has_nearer(share) { share * self.nearest } else { usual }
    }

    /// Whether there is something nearer than a share of the median depth.
    fn has_nearer(&self, share: f32) -> bool {
        self.nearest < share * self.depth
    }
}

/// The Gaussians to begin with.
pub(super) fn start(
    points: &[CloudPoint],
    images: &SourceImages,
    extent: &Extent,
    recipe: &Recipe,
) -> Vec<GaussianBlock> {
    let cameras: Vec<CameraBlock> = images.images.iter().map(|image| image.camera.block(0)).collect();
    let mut gaussians = evenly(of_points(points, &cameras, extent, recipe), recipe.max_count);
    // What is behind a silhouette is known.
    let count = if images.has_silhouettes { 0 } else { recipe.background_count };
    let count = count.min((recipe.max_count - gaussians.len()) as u32);
    gaussians.extend((0..count).filter_map(|draw| in_background(draw, images, &cameras, extent, recipe)));
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

/// How often cubes are halved for a point: until they are as large in a picture as at the median depth or smaller,
/// where it is nearer than [`Recipe::near`] of that to the nearest source that sees it.
fn halvings(point: &CloudPoint, cameras: &[CameraBlock], extent: &Extent, recipe: &Recipe) -> u32 {
    if !extent.has_nearer(recipe.near) {
        return 0;
    }
    let seen = cameras.iter().map(|camera| camera.project(point.position)).filter(|seen| seen.in_image);
    let mut depth = seen.map(|seen| seen.depth).fold(f32::INFINITY, f32::min);
    let mut count = 0;
    while depth < recipe.near * extent.depth && count < MAX_HALVINGS {
        (depth, count) = (2.0 * depth, count + 1);
    }
    count
}

/// One Gaussian for each cube of points, in the order of the cubes, the largest first.
fn of_points(points: &[CloudPoint], cameras: &[CameraBlock], extent: &Extent, recipe: &Recipe) -> Vec<GaussianBlock> {
    let side = |halvings: u32| recipe.cell * extent.footprint / (1_u32 << halvings) as f32;
    let halvings = map(points.len(), 1024, |point| halvings(&points[point], cameras, extent, recipe));
    let mut cells: BTreeMap<(u32, [i32; 3]), Cell> = BTreeMap::new();
    for (point, halvings) in points.iter().zip(halvings) {
        let key = (point.position / side(halvings)).floor().to_array().map(|place| place as i32);
        let cell = cells.entry((halvings, key)).or_default();
        cell.position += point.position;
        cell.normal += point.normal;
        cell.colour += Vec3::from_array(point.colour.map(|level| f32::from(level) / 255.0));
        cell.count += 1;
    }
    let cells = cells.iter().filter(|(_, cell)| cell.count >= recipe.least_points);
    let gaussian = |((halvings, _), cell): (&(u32, [i32; 3]), &Cell)| {
        let share = 1.0 / cell.count as f32;
        let mut gaussian = ball(cell.position * share, 0.5 * side(*halvings), recipe.opacities[0], cell.colour * share);
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

/// A Gaussian on a ray of a source, drawn at random, at a disparity below that of all points, in the mean colour of the
/// sources that see it; `None` if none does.
fn in_background(
    draw: u32,
    images: &SourceImages,
    cameras: &[CameraBlock],
    extent: &Extent,
    recipe: &Recipe,
) -> Option<GaussianBlock> {
    let random = |sample: u32| uniform(recipe.seed, draw, sample);
    let camera = cameras.get((random(0) * cameras.len() as f32) as usize)?;
    let disparity = (LEAST_DISPARITY + random(1) * (1.0 - LEAST_DISPARITY)) / extent.far;
    let towards = camera.towards(random(2) * camera.width as f32, random(3) * camera.height as f32);
    let position = camera.centre_world() + towards / disparity;
    let seen = images.images.iter().zip(cameras).filter_map(|(image, camera)| colour_at(image, camera, position));
    let (sum, count) = seen.fold((Vec3::ZERO, 0), |(sum, count), colour| (sum + colour, count + 1));
    // As large in a picture wherever it is.
    let scale = recipe.background_scale * extent.footprint / (extent.depth * disparity);
    (count > 0).then(|| ball(position, scale, recipe.opacities[1], sum / count as f32))
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
    use super::super::particles::{Particle, refined};
    use super::*;
    use viewfuse_core::camera::{Camera, Pinhole};
    use viewfuse_core::pose::Pose;

    /// Two grey photographs of a wall.
    fn wall() -> (SourceImages, Vec<CloudPoint>) {
        let pinhole = Pinhole::new([16.0; 2], [8.0; 2], 16, 16).expect("a pinhole");
        let camera = |x: f32| {
            let centre = Vec3::new(x, 0.0, 0.0);
            Camera { pose: Pose::look_at(centre, centre + Vec3::Z, -Vec3::Y).expect("a pose"), pinhole }
        };
        let image = |x: f32| SourceImage { camera: camera(x), texels: vec![[0.5, 0.5, 0.5, 1.0]; 256] };
        let images = SourceImages {
            images: vec![image(-0.1), image(0.1)],
            background: [0.0; 3],
            has_silhouettes: false,
            points: Vec::new(),
            near_far: None,
            focus: None,
            warnings: Vec::new(),
        };
        let point = |index: usize| {
            let [x, y] = [index % 8, index / 8].map(|place| 0.2 * (place as f32 - 3.5));
            CloudPoint { position: Vec3::new(x, y, 4.0), normal: -Vec3::Z, colour: [128; 3], view_count: 2 }
        };
        (images, (0..64).map(point).collect())
    }

    #[test]
    fn a_background_is_behind_all_points_and_seen() {
        let (mut images, points) = wall();
        let extent = Extent::of(&points, &images, 16.0).expect("points");
        let recipe = Recipe { least_points: 1, cell: 1.0, background_count: 50, ..Recipe::default() };
        let begun = start(&points, &images, &extent, &recipe);
        let (behind, front): (Vec<GaussianBlock>, Vec<GaussianBlock>) =
            begun.into_iter().partition(|gaussian| gaussian.position[2] > 4.0);
        assert!(behind.len() == 50 && !front.is_empty(), "{} and {}", behind.len(), front.len());
        for gaussian in &behind {
            let [_, _, depth] = gaussian.position;
            assert!((4.0..=40.1).contains(&depth), "{gaussian:?}");
            let seen = images.images.iter().map(|image| image.camera.block(0));
            assert!(seen.into_iter().any(|camera| camera.project(Vec3::from_array(gaussian.position)).in_image));
            // 16 pixels at any depth: the focal length.
            assert!((gaussian.log_scales[0].exp() / depth - 1.0).abs() < 1.0e-5, "{gaussian:?}");
            assert_eq!(gaussian.colour, [0.5; 3]);
        }
        let few = Recipe { max_count: front.len() + 7, ..recipe };
        assert_eq!(start(&points, &images, &extent, &few).len(), few.max_count);
        images.has_silhouettes = true;
        assert_eq!(start(&points, &images, &extent, &recipe).len(), front.len());
    }

    /// An object at an eighth of the median depth: it is seen, and its Gaussians are about as small in a picture as
    /// those of the wall behind it, at the beginning of a level, too.
    #[test]
    fn what_is_near_is_seen_as_finely() {
        let (images, mut points) = wall();
        let recipe = Recipe { least_points: 1, background_count: 0, ..Recipe::default() };
        let usual = Extent::of(&points, &images, 16.0).expect("points");
        assert_eq!(usual.near(recipe.near), 2.0);
        let object = |index: usize| {
            let [x, y] = [index % 4, index / 4].map(|place| 0.02 * (place as f32 - 1.5));
            CloudPoint { position: Vec3::new(x, y, 0.5), normal: -Vec3::Z, colour: [10; 3], view_count: 2 }
        };
        let wall_alone = start(&points, &images, &usual, &recipe);
        points.extend((0..16).map(object));
        let extent = Extent::of(&points, &images, 16.0).expect("points");
        assert_eq!((extent.depth, extent.near(recipe.near)), (4.0, 0.25));
        let begun = start(&points, &images, &extent, &recipe);
        let (near, far): (Vec<GaussianBlock>, Vec<GaussianBlock>) =
            begun.iter().partition(|gaussian| gaussian.position[2] < 1.0);
        assert_eq!(far, wall_alone);
        let size = |gaussian: &GaussianBlock| gaussian.log_scales[0].exp() / gaussian.position[2];
        let most = 2.01 * size(&far[0]);
        assert!(!near.is_empty() && near.iter().all(|gaussian| size(gaussian) <= most), "{near:?}");
        // Refined at a level whose pixels are as large as those Gaussians at their depth, by an eighth.
        let cameras: Vec<CameraBlock> = images.images.iter().map(|image| image.camera.block(0)).collect();
        let particles: Vec<Particle> = near.iter().copied().map(Particle::new).collect();
        let footprint = extent.footprint / 8.0;
        let refined = refined(&particles, &cameras, &extent, footprint, &recipe);
        assert!(refined.len() > 2 * particles.len(), "{} of {}", refined.len(), particles.len());
    }

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
