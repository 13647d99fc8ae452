//! Feature images from volumes.

use crate::parallel::for_each_row;
use pulp::Arch;
use viewfuse_core::camera::CameraBlock;
use viewfuse_core::half_precision::fetch_f16;
use viewfuse_core::rays::RayPoint;
use viewfuse_kernels::genvs::{FeatureBlock, VolumeBlock, VolumePlace};

/// Sums the features of the eight nodes around each point: `add(first, weight, gathered)` adds those of the node whose
/// first feature is number `first` of the volume.
fn gather_nodes(
    block: &VolumeBlock,
    views: &[CameraBlock],
    points: &[RayPoint],
    gathered: &mut [f32],
    add: impl Fn(usize, f32, &mut [f32]) + Sync,
) {
    let features = block.feature_count as usize;
    let gathered = &mut gathered[block.first()..][..block.point_count as usize * features];
    let camera = &views[block.view as usize];
    for_each_row(gathered, features, 4096, |point, gathered| {
        let place = VolumePlace::of(camera, &points[point], block);
        gathered.fill(0.0);
        if place.is_outside() {
            return;
        }
        for corner in 0..8 {
            let (node, weight) = place.corner(block, corner);
            if node != u32::MAX {
                add(node as usize * features, weight, gathered);
            }
        }
    });
}

pub(super) fn gather_volume(
    block: &VolumeBlock,
    views: &[CameraBlock],
    points: &[RayPoint],
    volume: &[f32],
    gathered: &mut [f32],
) {
    gather_nodes(block, views, points, gathered, |first, weight, gathered| {
        let values = &volume[first..][..gathered.len()];
        gathered.iter_mut().zip(values).for_each(|(sum, value)| *sum += value * weight);
    });
}

pub(super) fn gather_volume_f16(
    block: &VolumeBlock,
    views: &[CameraBlock],
    points: &[RayPoint],
    volume: &[u32],
    gathered: &mut [f32],
) {
    gather_nodes(block, views, points, gathered, |first, weight, gathered| {
        let words = &volume[first / 2..(first + gathered.len()).div_ceil(2)];
        for (index, sum) in gathered.iter_mut().enumerate() {
            *sum += fetch_f16(words, first % 2 + index) * weight;
        }
    });
}

pub(super) fn sum_features(
    block: &FeatureBlock,
    ray_count: u32,
    weights: &[f32],
    fused: &[f32],
    raw: &[f32],
    summed: &mut [f32],
) {
    let (features, samples) = (block.feature_count as usize, block.sample_count as usize);
    let summed = &mut summed[block.first_ray as usize * features..][..ray_count as usize * features];
    for_each_row(summed, features, 1024, |ray, summed| {
        Arch::new().dispatch(
            #[inline(always)]
            || {
                summed.fill(0.0);
                for sample in ray * samples..(ray + 1) * samples {
                    let weight = weights[sample];
                    let fused = &fused[sample * features..][..features];
                    let raw = &raw[sample * (features + 1) + 1..][..features];
                    for (sum, (fused, raw)) in summed.iter_mut().zip(fused.iter().zip(raw)) {
                        *sum += weight * (fused + raw);
                    }
                }
            },
        );
    });
}
