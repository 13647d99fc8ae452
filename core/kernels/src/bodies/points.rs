//! The inputs of PixelNeRF's network at points, the fusion of views, and radiance from the network's outputs.

use crate::pixelnerf::{self, EmbedBlock, GatherBlock, GridPlace};
use crate::store::Store;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::{Fetch, StartingAt};
use viewfuse_core::fuse::{FuseBlock, fuse_element};
use viewfuse_core::half_precision::Halves;
use viewfuse_core::rays::RayPoint;

/// A feature of a point in a view.
#[inline]
pub fn embed_points(
    block: &EmbedBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    embedded: &mut (impl Store<f32> + ?Sized),
    feature: u32,
) {
    embedded.store(feature as usize, pixelnerf::embedded_value(views, points, block, feature as usize));
}

/// The weight of a view at a point.
#[inline]
pub fn visible_weights(
    view_count: &u32,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    weights: &[f32],
    points: &(impl Fetch<RayPoint> + ?Sized),
    visible: &mut (impl Store<f32> + ?Sized),
    weight: u32,
) {
    let point = points.fetch((weight / view_count) as usize);
    let value = pixelnerf::visible_weight(views, weights, *view_count, &point, weight % view_count);
    visible.store(weight as usize, value);
}

/// Four channels of a point in a view.
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn gather_latents(
    block: &GatherBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    grid: &(impl Fetch<f32> + ?Sized),
    residual: &[f32],
    gathered: &mut (impl Store<f32> + ?Sized),
    four: u32,
) {
    let (point, four) = (four / block.four_count(), four % block.four_count());
    let place = GridPlace::of(&views.fetch(block.view as usize), &points.fetch(point as usize), block);
    let row = block.first() + (point * block.channel_count) as usize;
    let mut channel = 4 * four;
    while channel < block.channel_count && channel < 4 * four + 4 {
        let value = place.value(grid, channel as usize);
        let at = row + channel as usize;
        gathered.store(at, if block.has_residual != 0 { residual[at] + value } else { value });
        channel += 1;
    }
}

/// As [`gather_latents`], from a grid in half precision.
#[inline]
#[allow(clippy::too_many_arguments)]
pub fn gather_latents_f16(
    block: &GatherBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    grid: &[u32],
    residual: &[f32],
    gathered: &mut (impl Store<f32> + ?Sized),
    four: u32,
) {
    gather_latents(block, views, points, &Halves(grid), residual, gathered, four);
}

/// A channel of a point, fused.
#[inline]
pub fn fuse_views(
    block: &FuseBlock,
    weights: &[f32],
    latents: &[f32],
    fused: &mut (impl Store<f32> + ?Sized),
    channel: u32,
) {
    let element = channel as usize;
    let weights = StartingAt { all: weights, first: block.first_weight(element) };
    fused.store(element, fuse_element(&weights, &StartingAt { all: latents, first: element }, block));
}

/// The radiance of a point, stored at the point's sample.
#[inline]
pub fn radiance(
    raw: &[f32],
    points: &(impl Fetch<RayPoint> + ?Sized),
    samples: &mut (impl Store<[f32; 4]> + ?Sized),
    point: u32,
) {
    let there = points.fetch(point as usize);
    let raw = StartingAt { all: raw, first: point as usize * 4 };
    samples.store(there.sample as usize, pixelnerf::radiance(&raw, &there));
}
