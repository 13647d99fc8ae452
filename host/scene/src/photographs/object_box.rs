//! The bounding box of the visual hull.

use super::{SourceImage, SourceImages};
use crate::rig::nearest_point_to_lines;
use rayon::prelude::*;
use std::borrow::Borrow;
use viewfuse_core::Vec3;
use viewfuse_core::camera::CameraBlock;
use viewfuse_kernels::visual_hull::ObjectBlock;
use viewfuse_kernels::visual_hull::hull::hull_alpha;

/// Grid cells along a side of the two passes, coarse and fine.
const GRIDS: [usize; 2] = [32, 48];
/// Least hull alpha of a cell's centre that belongs to the object.
const MIN_ALPHA: f32 = 0.2;
/// Texels of at least this alpha belong to a silhouette.
const SILHOUETTE_ALPHA: f32 = 0.3;
/// The first box is larger than the largest silhouette by this factor.
const ALLOWANCE: f32 = 1.2;

/// The bounding box of the visual hull of the sources' silhouettes, or `None` if it is empty.
pub fn find_object(sources: &SourceImages) -> Option<ObjectBlock> {
    let (cameras, texels) = joined(&sources.images);
    bounding_box(&cameras, &texels)
}

/// All sources' texels, concatenated, and the cameras with the offsets of their texels.
pub fn joined(images: &[impl Borrow<SourceImage>]) -> (Vec<CameraBlock>, Vec<[f32; 4]>) {
    let mut cameras = Vec::with_capacity(images.len());
    let mut texels = Vec::with_capacity(images.iter().map(|image| image.borrow().texels.len()).sum());
    for image in images.iter().map(Borrow::borrow) {
        cameras.push(image.camera.block(texels.len() as u32));
        texels.extend_from_slice(&image.texels);
    }
    (cameras, texels)
}

/// The box around every point that is inside all silhouettes, or `None` if there is none. `texels` are those of the
/// cameras one after the other ([`joined`]).
pub fn bounding_box(cameras: &[CameraBlock], texels: &[[f32; 4]]) -> Option<ObjectBlock> {
    let view_count = cameras.len() as u32;
    let (middle, radius) = first_guess(cameras, texels)?;
    let reach = Vec3::splat(ALLOWANCE * radius);
    let mut object = ObjectBlock::new(middle - reach, middle + reach, view_count);
    for side in GRIDS {
        let (low, high) = corners(&object);
        let cell = (high - low) / side as f32;
        let boxes: Vec<_> = (0..side)
            .into_par_iter()
            .map(|slice| occupied_box(&object, cameras, texels, low, cell, side, slice))
            .collect();
        let inside = boxes.into_iter().flatten().reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))?;
        // Only centres of cells were tested: the object may reach up to a cell beyond them.
        object = ObjectBlock::new(inside.0 - cell, inside.1 + cell, view_count);
    }
    Some(object)
}

fn corners(object: &ObjectBlock) -> (Vec3, Vec3) {
    let [low, high] = [object.low, object.high].map(|c| Vec3::new(c[0], c[1], c[2]));
    (low, high)
}

/// The point nearest to the rays through the middles of the silhouettes, and the largest radius that a silhouette has
/// around it.
fn first_guess(cameras: &[CameraBlock], texels: &[[f32; 4]]) -> Option<(Vec3, f32)> {
    let silhouette = |camera: &CameraBlock| {
        let first = camera.first_texel as usize;
        let width = camera.width as usize;
        let count = width * camera.height as usize;
        texels[first..first + count]
            .iter()
            .enumerate()
            .filter(|(_, texel)| texel[3] > SILHOUETTE_ALPHA)
            .map(move |(pixel, _)| ((pixel % width) as f32 + 0.5, (pixel / width) as f32 + 0.5))
            .collect::<Vec<(f32, f32)>>()
    };
    let silhouettes: Vec<_> = cameras.par_iter().map(silhouette).collect();
    let lines: Vec<(Vec3, Vec3)> = cameras
        .iter()
        .zip(&silhouettes)
        .filter(|(_, pixels)| !pixels.is_empty())
        .map(|(camera, pixels)| {
            let count = pixels.len() as f64;
            let x = pixels.iter().map(|p| f64::from(p.0)).sum::<f64>() / count;
            let y = pixels.iter().map(|p| f64::from(p.1)).sum::<f64>() / count;
            (camera.centre_world(), camera.towards(x as f32, y as f32).normalize())
        })
        .collect();
    let middle = nearest_point_to_lines(&lines)?;
    let radius = cameras
        .iter()
        .zip(&silhouettes)
        .map(|(camera, pixels)| {
            let seen = camera.project(middle);
            let farthest = pixels.iter().map(|p| (p.0 - seen.x).hypot(p.1 - seen.y)).fold(0.0, f32::max);
            if seen.in_front { farthest * seen.depth / camera.intrinsics[0] } else { 0.0 }
        })
        .fold(0.0, f32::max);
    (radius > 0.0 && radius.is_finite()).then_some((middle, radius))
}

/// Least and greatest occupied cell centre in one slice of the grid.
fn occupied_box(
    object: &ObjectBlock,
    cameras: &[CameraBlock],
    texels: &[[f32; 4]],
    low: Vec3,
    cell: Vec3,
    side: usize,
    slice: usize,
) -> Option<(Vec3, Vec3)> {
    let mut found: Option<(Vec3, Vec3)> = None;
    for row in 0..side {
        for column in 0..side {
            let centre = low + cell * (Vec3::new(column as f32, row as f32, slice as f32) + 0.5);
            if hull_alpha(object, cameras, texels, centre, MIN_ALPHA) > 0.0 {
                let (least, greatest) = found.unwrap_or((centre, centre));
                found = Some((least.min(centre), greatest.max(centre)));
            }
        }
    }
    found
}
