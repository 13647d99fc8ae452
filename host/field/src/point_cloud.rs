//! The sources' depth maps as one cloud of points, with normals and colours.
//!
//! A pixel's point is kept if enough other views agree: it lies on their surface too, and their point comes back to the
//! pixel. What agrees becomes one point, the mean by the scheme's weights; its pixels make no further points. A point
//! is dropped if more views see through it (their surface is clearly behind it, or it is outside of their silhouette)
//! than agree.

use crate::DepthMap;
use crate::render::{RenderError, Stage};
use viewfuse_core::Vec3;
use viewfuse_core::lookup::bilinear;
use viewfuse_device::parallel::map;
use viewfuse_job::progress::{Interrupted, Progress};
use viewfuse_scene::photographs::{SourceImage, SourceImages};
use viewfuse_weighting::Weighting;
use viewfuse_weighting::sources::SourceWeights;

/// Greatest relative difference of depths that agree.
const DEPTH_TOLERANCE: f32 = 0.01;
/// Greatest distance in pixels of a map at which another view's point comes back.
const PIXEL_TOLERANCE: f32 = 1.0;
/// Greatest relative difference of the depths of neighbours on one surface.
const SURFACE_TOLERANCE: f32 = 0.05;
/// Confidence from which on a depth counts, where the field tells.
const MIN_CONFIDENCE: f32 = 0.5;
/// Opacity of a photograph from which on a pixel belongs to the object.
const MIN_OPACITY: f32 = 0.5;
/// Pixels that are enough work for a thread.
const MIN_PIXELS: usize = 128;

/// A point on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudPoint {
    /// World coordinates.
    pub position: Vec3,
    /// Unit, towards the side that was seen; world coordinates.
    pub normal: Vec3,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// How many views agree.
    pub view_count: u32,
}

/// Options of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CloudOptions {
    /// Fewest views that agree on a point, its own included; 1 keeps every pixel with a depth.
    pub least_views: u32,
}

impl Default for CloudOptions {
    /// Two views.
    fn default() -> CloudOptions {
        CloudOptions { least_views: 2 }
    }
}

/// The cloud of a stage, all of whose sources are encoded under this weighting; empty for fields without depth maps of
/// sources.
///
/// # Errors
/// [`RenderError`].
pub fn point_cloud(
    stage: &mut Stage<'_>,
    weighting: &Weighting,
    options: CloudOptions,
    progress: &dyn Progress,
) -> Result<Vec<CloudPoint>, RenderError> {
    progress.stage("depths of the views", 0..3, 4);
    stage.weigh(weighting, progress)?;
    stage.encode_all(progress)?;
    progress.stage("fusing the depths", 3..4, 4);
    let maps = stage.source_depths()?;
    let relevance = stage.relevance(weighting);
    cloud_of(&maps, &stage.images, &relevance, options, progress)
        .map_err(|interrupted| RenderError::Field(interrupted.into()))
}

/// The cloud of these depth maps, one a source; `relevance[view]` are the weights of the others for source `view`.
pub(crate) fn cloud_of(
    maps: &[DepthMap],
    images: &SourceImages,
    relevance: &[SourceWeights],
    options: CloudOptions,
    progress: &dyn Progress,
) -> Result<Vec<CloudPoint>, Interrupted> {
    let has_silhouettes = images.has_silhouettes;
    Fusion { maps, images: &images.images, has_silhouettes, relevance, options }.points(progress)
}

/// The maps of all views, with what else is fused.
struct Fusion<'a> {
    maps: &'a [DepthMap],
    /// The photographs, of the same cameras at any size.
    images: &'a [SourceImage],
    /// Whether their opacity is a silhouette. Otherwise it says what the lens saw.
    has_silhouettes: bool,
    relevance: &'a [SourceWeights],
    options: CloudOptions,
}

/// A view's part of a point.
struct Part {
    view: usize,
    pixel: usize,
    position: Vec3,
    weight: f32,
}

impl Fusion<'_> {
    fn points(&self, progress: &dyn Progress) -> Result<Vec<CloudPoint>, Interrupted> {
        let mut is_used: Vec<Vec<bool>> = self.maps.iter().map(|map| vec![false; map.depths.len()]).collect();
        let mut points = Vec::new();
        progress.expect(self.maps.len());
        for view in 0..self.maps.len() {
            progress.check()?;
            let unused: Vec<usize> = (0..is_used[view].len()).filter(|pixel| !is_used[view][*pixel]).collect();
            // No point has two pixels of this view: none of these uses another.
            let found = map(unused.len(), MIN_PIXELS, |index| {
                let parts = self.parts(view, unused[index])?;
                let fused = self.fused(&parts);
                Some((parts, fused))
            });
            for (parts, fused) in found.into_iter().flatten() {
                parts.iter().for_each(|part| is_used[part.view][part.pixel] = true);
                points.extend(fused);
            }
            progress.step();
        }
        Ok(points)
    }

    /// The point of a pixel with the points of the views that agree, its own first; `None` if too few agree.
    fn parts(&self, view: usize, pixel: usize) -> Option<Vec<Part>> {
        let position = self.point(view, pixel)?;
        let camera = self.maps[view].camera;
        let width = camera.width as usize;
        let (x, y) = ((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
        let mut parts = vec![Part { view, pixel, position, weight: self.confidence(view, pixel) }];
        let mut against = 0;
        for (other, map) in self.maps.iter().enumerate().filter(|(other, _)| *other != view) {
            let seen = map.camera.project(position);
            if !seen.in_image {
                continue;
            }
            let there = map.camera.texel_at(seen.x, seen.y);
            let depth = map.depths[there];
            if depth <= 0.0 {
                // Outside of a silhouette there is nothing; inside, a missing depth says nothing.
                against += u32::from(self.has_silhouettes && !self.is_object(other, seen.x, seen.y));
                continue;
            }
            let behind = depth - seen.depth;
            if behind > SURFACE_TOLERANCE * seen.depth {
                against += 1;
            }
            let Some(point) = self.point(other, there) else { continue };
            let back = camera.project(point);
            let is_back = (back.x - x).abs() <= PIXEL_TOLERANCE && (back.y - y).abs() <= PIXEL_TOLERANCE;
            if behind.abs() <= DEPTH_TOLERANCE * seen.depth && back.in_front && is_back {
                let weight = self.relevance[view].get(other as u32) * self.confidence(other, there);
                parts.push(Part { view: other, pixel: there, position: point, weight });
            }
        }
        let agreeing = parts.len() as u32;
        (agreeing >= self.options.least_views && against < agreeing).then_some(parts)
    }

    /// One point of all parts.
    fn fused(&self, parts: &[Part]) -> Option<CloudPoint> {
        let sum: f32 = parts.iter().map(|part| part.weight).sum();
        let first = parts.first()?;
        let (mut position, mut normal, mut colour) = (Vec3::ZERO, Vec3::ZERO, [0.0; 3]);
        for part in parts {
            let share = if sum > 0.0 { part.weight / sum } else { 1.0 / parts.len() as f32 };
            // Relative to one of them, where rounding is least.
            position += (part.position - first.position) * share;
            normal += self.normal(part.view, part.pixel) * share;
            let texel = self.colour(part.view, part.pixel);
            (0..3).for_each(|channel| colour[channel] += share * texel[channel]);
        }
        let towards = self.maps[first.view].camera.centre_world() - first.position;
        Some(CloudPoint {
            position: first.position + position,
            normal: normal.try_normalize().or_else(|| towards.try_normalize())?,
            colour: colour.map(|value| (value.clamp(0.0, 1.0) * 255.0).round() as u8),
            view_count: parts.len() as u32,
        })
    }

    /// The point of a pixel; `None` without a depth that counts.
    fn point(&self, view: usize, pixel: usize) -> Option<Vec3> {
        let DepthMap { camera, depths, .. } = &self.maps[view];
        let depth = depths[pixel];
        if !(depth > 0.0 && self.confidence(view, pixel) >= MIN_CONFIDENCE) {
            return None;
        }
        let width = camera.width as usize;
        let towards = camera.towards((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
        let is_object = self.is_object(view, (pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
        is_object.then(|| camera.centre_world() + towards * depth)
    }

    fn confidence(&self, view: usize, pixel: usize) -> f32 {
        self.maps[view].confidences.get(pixel).copied().unwrap_or(1.0)
    }

    /// The unit normal of a view's surface at a pixel, towards the camera; that direction itself where no neighbour is
    /// on the surface.
    fn normal(&self, view: usize, pixel: usize) -> Vec3 {
        let DepthMap { camera, depths, .. } = &self.maps[view];
        let (width, depth) = (camera.width as usize, depths[pixel]);
        let (column, row) = ((pixel % width) as i32, (pixel / width) as i32);
        let at = |right: i32, down: i32| {
            let (x, y) = (column + right, row + down);
            let inside = x >= 0 && y >= 0 && x < camera.width as i32 && y < camera.height as i32;
            let there = depths[if inside { (y * camera.width as i32 + x) as usize } else { pixel }];
            let is_surface = inside && there > 0.0 && (there - depth).abs() <= SURFACE_TOLERANCE * depth;
            is_surface.then(|| camera.towards(x as f32 + 0.5, y as f32 + 0.5) * there)
        };
        let ray = camera.towards(column as f32 + 0.5, row as f32 + 0.5) * depth;
        let slope = |ahead: Option<Vec3>, behind: Option<Vec3>| match (ahead, behind) {
            (None, None) => None,
            (ahead, behind) => Some(ahead.unwrap_or(ray) - behind.unwrap_or(ray)),
        };
        let across = slope(at(1, 0), at(-1, 0)).zip(slope(at(0, 1), at(0, -1)));
        let normal = across.and_then(|(right, down)| down.cross(right).try_normalize());
        match normal {
            Some(normal) if normal.dot(ray) > 0.0 => -normal,
            Some(normal) => normal,
            None => (-ray).normalize(),
        }
    }

    /// A photograph's premultiplied colour and opacity at an image coordinate of the view's map.
    fn texel(&self, view: usize, x: f32, y: f32) -> [f32; 4] {
        let (map, image) = (&self.maps[view].camera, &self.images[view]);
        let (width, height) = (image.camera.pinhole.width(), image.camera.pinhole.height());
        let (x, y) = (x * width as f32 / map.width as f32, y * height as f32 / map.height as f32);
        bilinear(&image.texels[..], width, height, x, y)
    }

    fn is_object(&self, view: usize, x: f32, y: f32) -> bool {
        self.texel(view, x, y)[3] >= MIN_OPACITY
    }

    /// Red, green and blue of a pixel, without the background.
    fn colour(&self, view: usize, pixel: usize) -> [f32; 3] {
        let width = self.maps[view].camera.width as usize;
        let [r, g, b, alpha] = self.texel(view, (pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5);
        [r, g, b].map(|value| value / alpha.max(MIN_OPACITY))
    }
}
