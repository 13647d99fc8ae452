//! Feature images from volumes, and the denoiser's inputs.

use crate::genvs::{self, DenoiserInputBlock, FeatureBlock, VolumeBlock};
use crate::store::Store;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::fetch::Fetch;
use viewfuse_core::rays::RayPoint;

/// A feature of a point in a view.
#[inline]
pub fn gather_volume(
    block: &VolumeBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    volume: &[f32],
    gathered: &mut (impl Store<f32> + ?Sized),
    feature: u32,
) {
    let element = feature as usize;
    gathered.store(block.first() + element, genvs::volume_value(views, points, volume, block, element));
}

/// As [`gather_volume`], from a volume in half precision.
#[inline]
pub fn gather_volume_f16(
    block: &VolumeBlock,
    views: &(impl Fetch<CameraBlock> + ?Sized),
    points: &(impl Fetch<RayPoint> + ?Sized),
    volume: &[u32],
    gathered: &mut (impl Store<f32> + ?Sized),
    feature: u32,
) {
    let element = feature as usize;
    gathered.store(block.first() + element, genvs::volume_value_f16(views, points, volume, block, element));
}

/// Weights of the samples on a ray.
#[inline]
pub fn weigh_features(
    block: &FeatureBlock,
    raw: &[f32],
    points: &[RayPoint],
    weights: &mut (impl Store<f32> + ?Sized),
    ray: u32,
) {
    genvs::weigh_features(raw, points, block, ray as usize, move |sample, weight| weights.store(sample, weight));
}

/// A feature of a ray.
#[inline]
pub fn sum_features(
    block: &FeatureBlock,
    weights: &[f32],
    fused: &[f32],
    raw: &[f32],
    summed: &mut (impl Store<f32> + ?Sized),
    feature: u32,
) {
    let first = (block.first_ray * block.feature_count) as usize;
    let element = feature as usize;
    summed.store(first + element, genvs::summed_feature(weights, fused, raw, block, element));
}

/// A channel of a pixel.
#[inline]
pub fn denoiser_input(
    block: &DenoiserInputBlock,
    noisy: &[f32],
    condition: &[f32],
    inputs: &mut (impl Store<f32> + ?Sized),
    channel: u32,
) {
    inputs.store(channel as usize, genvs::denoiser_input(noisy, condition, block, channel as usize));
}
